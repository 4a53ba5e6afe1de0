// report.html: a container as a page for the people who have to judge it, one artist and one
// engineer. It holds times, so that it differs from run to run, and is not listed in the manifest.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/manifest.h"
#include "pipeline/jobs/brdf_package.h"
#include "pipeline/jobs/ingest.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/measure.h"
#include "pipeline/jobs/measure_brdf.h"
#include "pipeline/jobs/measure_svbrdf.h"
#include "pipeline/jobs/page_pictures.h"
#include "pipeline/jobs/run_record.h"
#include "pipeline/material/train.h"
#include "pipeline/svbrdf/train_svbrdf.h"

namespace patina {

// What pages of both kinds are made of.
struct PageFacts {
  const Job& job;
  const Manifest& manifest;  // with payloads and quality
  const RunRecord& run;      // of the stages so far
  std::string stopped_by;    // as in the result
  std::vector<std::string> warnings;
  // Size of each payload of the manifest as a zstd frame; 0 where nobody asked.
  std::vector<uint64_t> zstd_bytes;
};

// model: null when every channel is constant.
std::string MaterialReportPage(const PageFacts& facts, const JobSource& source,
                               const Measurement& measurement, const TrainedMaterial* model,
                               const std::vector<PageTrio>& pictures);

// sphere: the lit sphere; without a source for a list of measurements.
std::string BrdfReportPage(const PageFacts& facts, const BrdfSource& source,
                           const BrdfMeasurement& measurement, const brdf::TrainedBrdf& model,
                           const PageTrio& sphere);

// planes: of the measurement, in its order.
std::string SvbrdfReportPage(const PageFacts& facts, const SvbrdfMeasurement& measurement,
                             const svbrdf::TrainedSvbrdf& model,
                             const std::vector<PageTrio>& planes);

// The payloads in `directory` that engines load, compressed: what an archive of them would take.
// One number for each payload, 0 for those that engines do not load. Errors: those of ReadFile and
// CompressZstd.
Result<std::vector<uint64_t>> ZstdSizes(const std::string& directory,
                                        const std::vector<ManifestPayload>& payloads);

}  // namespace patina
