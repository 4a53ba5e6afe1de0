#include "pipeline/material/mip_filter.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace patina {

BoxTaps BoxTapsFor(int size, int index) {
  BoxTaps taps;
  if (size == 1) return taps;
  taps.first = 2 * index;
  if (size % 2 == 0) {
    taps.count = 2;
    taps.weight[0] = taps.weight[1] = 0.5f;
    return taps;
  }
  const int next = size / 2;
  taps.count = 3;
  const float n = static_cast<float>(size);
  taps.weight[0] = static_cast<float>(next - index) / n;
  taps.weight[1] = static_cast<float>(next) / n;
  taps.weight[2] = static_cast<float>(index + 1) / n;
  return taps;
}

void AddBoxRow(const float* in, int width, float weight, float* out) {
  if (width == 1) {
    out[0] += weight * in[0];
    return;
  }
  const int next = width / 2;
  if (width % 2 == 0) {
    const float half = 0.5f * weight;
    for (int x = 0; x < next; ++x) out[x] += half * (in[2 * x] + in[2 * x + 1]);
    return;
  }
  for (int x = 0; x < next; ++x) {
    const BoxTaps taps = BoxTapsFor(width, x);
    out[x] += weight * (taps.weight[0] * in[2 * x] + taps.weight[1] * in[2 * x + 1] +
                        taps.weight[2] * in[2 * x + 2]);
  }
}

void PlaneLevel::Allocate(int level_width, int level_height, int level_planes) {
  width = level_width;
  height = level_height;
  planes = level_planes;
  data.assign(static_cast<size_t>(width) * height * planes, 0.0f);
}

PlaneLevel NextLevel(const PlaneLevel& level, ThreadPool& pool) {
  PlaneLevel next;
  next.Allocate(NextMipSide(level.width), NextMipSide(level.height), level.planes);
  pool.ParallelFor(next.height, [&](int y, int) {
    const BoxTaps taps = BoxTapsFor(level.height, y);
    for (int p = 0; p < level.planes; ++p) {
      for (int tap = 0; tap < taps.count; ++tap) {
        AddBoxRow(level.Row(p, taps.first + tap), level.width, taps.weight[tap], next.Row(p, y));
      }
    }
  });
  return next;
}

float WidenRoughness(float roughness, float mean_length) {
  constexpr float kRounding = 1e-6f;
  constexpr float kShortest = 1e-3f;  // opposite normals: any roughness would be right, 1 is
  const float length = std::clamp(mean_length, kShortest, 1.0f);
  const float variance = (1.0f - length) / length;
  if (variance <= kRounding) return roughness;
  const float alpha = roughness * roughness;
  const float widened = std::sqrt(std::sqrt(std::min(1.0f, alpha * alpha + 2.0f * variance)));
  return std::max(roughness, widened);
}

float CoverageScale(std::span<const float> opacities, double coverage, float cutoff) {
  if (opacities.empty()) return 1.0f;
  const auto count = static_cast<double>(opacities.size());
  const auto share_at_least = [&](float threshold) {
    return static_cast<double>(std::count_if(opacities.begin(), opacities.end(),
                                             [&](float opacity) { return opacity >= threshold; })) /
           count;
  };
  // The texel that is the last to be visible, if `coverage` can be met; its equals go with it.
  const auto wanted = static_cast<long>(std::lround(std::clamp(coverage, 0.0, 1.0) * count));
  std::vector<float> sorted(opacities.begin(), opacities.end());
  const auto last = sorted.begin() + std::max(0l, wanted - 1);
  std::nth_element(sorted.begin(), last, sorted.end(), std::greater<float>());
  // Thresholds just below and just above it, and the one that is there already; the first of equals
  // is kept.
  constexpr float kJustBeyond = 1e-6f;
  float best = cutoff;
  double best_error = std::fabs(share_at_least(cutoff) - coverage);
  for (const float threshold : {*last * (1 - kJustBeyond), *last * (1 + kJustBeyond)}) {
    const double error = std::fabs(share_at_least(threshold) - coverage);
    if (threshold > 0 && error < best_error) {
      best = threshold;
      best_error = error;
    }
  }
  return cutoff / best;
}

}  // namespace patina
