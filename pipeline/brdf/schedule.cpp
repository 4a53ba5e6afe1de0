#include "pipeline/brdf/schedule.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace patina::brdf {

float CosineRate(int step, int steps) {
  constexpr int kWarmUpSteps = 100;
  const double warm = std::min(1.0, (step + 1.0) / kWarmUpSteps);
  return static_cast<float>(warm * 0.5 * (1 + std::cos(std::numbers::pi * step / steps)));
}

double MeanLogError(std::span<const float> y, const PoolSample* samples) {
  double sum = 0;
  const size_t count = y.size() / kOutputs;
  for (size_t s = 0; s < count; ++s) {
    for (int c = 0; c < kOutputs; ++c) {
      const double f = std::max(
          0.0, std::expm1(static_cast<double>(std::min(y[s * kOutputs + c], kMaxLogValue))));
      const double wanted = std::max(0.0, static_cast<double>(samples[s].value[c]));
      const double cosine = static_cast<double>(samples[s].cosine);
      sum += std::abs(std::log1p(f * cosine) - std::log1p(wanted * cosine));
    }
  }
  return sum / static_cast<double>(count * kOutputs);
}

}  // namespace patina::brdf
