// An analytic peer: Lambert and GGX, eight numbers, fitted to a measured BRDF.
#pragma once

#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/thread_pool.h"
#include "tests/bench/brdf_eval_kernels.h"
#include "tests/bench/brdf_eval_pairs.h"

namespace patina::bench {

inline constexpr double kGgxBytes = 8 * 4;

enum class FitNorm { kL1, kL2 };

struct GgxFitOptions {
  FitNorm norm = FitNorm::kL1;
  uint64_t seed = 1;
  size_t pairs = size_t{1} << 15;
  double half_angle_share = 0.5;
};

struct GgxFit {
  GgxMaterial material;
  double loss = 0;  // mean over samples and channels of |r| or r^2
};

// Minimises the norm of r = log1p(f c) - log1p(f* c), c the larger cosine, over the pairs that our
// trainer draws: Levenberg and Marquardt's method from ten starts, least of all kept; L1 by
// iterated weights 1/|r|. alpha stays in [0.001, 1.5], f0 in (0, 1), colours above 0. The same for
// any number of threads. Errors: kCorruptData (fewer than 64 pairs).
Result<GgxFit> FitGgx(const brdf::Source& source, const GgxFitOptions& options, ThreadPool& pool);

// In double precision, what the kernel evaluates and the fit differentiates.
void EvaluateGgx(const GgxMaterial& material, const brdf::Direction& wi, const brdf::Direction& wo,
                 double rgb[3]);

}  // namespace patina::bench
