// What the trainers of BRDFs have in common besides the step.
#pragma once

#include <span>

#include "pipeline/brdf/brdf_kernels.h"

namespace patina::brdf {

// The share of its rates that a step out of `steps` has: a hundred steps of warm-up, then a cosine
// down to zero.
float CosineRate(int step, int steps);

// Mean |log1p(f c) - log1p(f* c)| of outputs y [samples][kOutputs]; negative values as zero.
double MeanLogError(std::span<const float> y, const PoolSample* samples);

}  // namespace patina::brdf
