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
#include "pipeline/jobs/svbrdf_source.h"
#include "pipeline/svbrdf/train_svbrdf.h"

namespace patina {

// Errors: kOutOfRange (a texel beyond halves). Those of writing are kInternal, since what was
// trained must be writable.
Status AddSvbrdfModel(const svbrdf::TrainedSvbrdf& model, StagingArea* staging);

// The manifest without its quality. cost: of what was simulated.
Manifest DescribeSvbrdf(const Job& job, const SvbrdfSource& source,
                        const svbrdf::SvbrdfShape& shape, const brdf::SimulationCost& cost);

void DescribeSvbrdfQuality(const SvbrdfMeasurement& measurement, ManifestBrdf* model);

std::string SvbrdfReportToJson(const Manifest& manifest,
                               const std::vector<ManifestPayload>& payloads,
                               const SvbrdfSource& source, const SvbrdfMeasurement& measurement,
                               const svbrdf::TrainedSvbrdf& model);

}  // namespace patina
