#include "pipeline/metrics/psnr.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/metrics/row_sums.h"

namespace patina::metrics {
namespace {

double RowSquaredError(const float* a, const float* b, int width) {
  constexpr int kLanes = 8;
  double partial[kLanes] = {};
  int x = 0;
  for (; x + kLanes <= width; x += kLanes) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const double d = static_cast<double>(a[x + lane]) - static_cast<double>(b[x + lane]);
      partial[lane] += d * d;
    }
  }
  double tail = 0;
  for (; x < width; ++x) {
    const double d = static_cast<double>(a[x]) - static_cast<double>(b[x]);
    tail += d * d;
  }
  return ((partial[0] + partial[4]) + (partial[2] + partial[6])) +
         ((partial[1] + partial[5]) + (partial[3] + partial[7])) + tail;
}

}  // namespace

double SumSquaredError(const PlanarView& a, const PlanarView& b, ThreadPool& pool) {
  return SumOverRows(
      a.height, [&](int y) { return RowSquaredError(a.Row(y), b.Row(y), a.width); }, pool);
}

double PsnrDb(double mse, double peak) {
  const double floor = peak * peak * std::pow(10.0, -kMaxPsnrDb / 10.0);
  return mse <= floor ? kMaxPsnrDb : 10.0 * std::log10(peak * peak / mse);
}

}  // namespace patina::metrics
