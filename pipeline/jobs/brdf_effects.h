// What of a BRDF was not learned, why, and what that saved.
#pragma once

#include <vector>

#include "formats/manifest.h"
#include "pipeline/brdf/train_brdf.h"
#include "pipeline/jobs/brdf_package.h"
#include "pipeline/jobs/job.h"

namespace patina {

// Of a model of `shape` that was trained for `job`. Savings of a model without azimuth are against
// the anisotropic model that the same job would get, sampler included.
std::vector<ManifestEffect> DescribeBrdfEffects(const Job& job, const BrdfSource& source,
                                                const brdf::ModelShape& shape);

}  // namespace patina
