// Squared errors and the PSNR they give.
#pragma once

#include "pipeline/base/thread_pool.h"
#include "pipeline/metrics/plane.h"

namespace patina::metrics {

// What stands for "no error at all", since JSON has no infinity; better values are reported as this
// one.
inline constexpr double kMaxPsnrDb = 100.0;

// Sum of (a - b)^2 over two planes of the same size, in double. The same bits for any number of
// threads.
double SumSquaredError(const PlanarView& a, const PlanarView& b, ThreadPool& pool);

// 10 log10(peak^2 / mse), at most kMaxPsnrDb. mse >= 0.
double PsnrDb(double mse, double peak = 1.0);

}  // namespace patina::metrics
