// From a trained spatially varying BRDF to the payloads and the manifest of a container.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/container.h"
#include "formats/manifest.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/measure_svbrdf.h"
#include "pipeline/svbrdf/train_svbrdf.h"

namespace patina {

// An image set that was read, and the fingerprint of what is made from it.
struct SvbrdfSource {
  svbrdf::ImageSet set;
  std::string sha256;         // of the list
  std::string images_sha256;  // as in ManifestImageSet
  std::string fingerprint;    // recipe version, canonical job, list and images
};

// Reads the list and hashes the images, whose pixels DrawTexels looks at. Errors: those of
// ReadImageSet and Sha256OfFile, kCancelled.
Result<SvbrdfSource> ReadSvbrdfSource(const Job& job, ThreadPool& pool, const CancelToken& cancel);

// Errors of writing are kInternal, since what was trained must be writable.
Status AddSvbrdfModel(const svbrdf::TrainedSvbrdf& model, StagingArea* staging);

// The manifest without its quality.
Manifest DescribeSvbrdf(const Job& job, const SvbrdfSource& source,
                        const svbrdf::SvbrdfShape& shape);

void DescribeSvbrdfQuality(const SvbrdfMeasurement& measurement, ManifestBrdf* model);

std::string SvbrdfReportToJson(const Manifest& manifest,
                               const std::vector<ManifestPayload>& payloads,
                               const SvbrdfSource& source, const SvbrdfMeasurement& measurement,
                               const svbrdf::TrainedSvbrdf& model);

}  // namespace patina
