#include "pipeline/material/color_encoding.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

namespace patina {
namespace {

// The curve's linear toe, mirrored: coded -0.04045.
constexpr float kSrgbToe = 0.0031308f;

constexpr int kRowsPerTask = 16;

// Bins of an eighth of an octave over all positive floats.
constexpr int kBinShift = 20;
constexpr size_t kBins = size_t{1} << (31 - kBinShift);

struct ValueStats {
  uint64_t non_finite = 0;
  float min = std::numeric_limits<float>::infinity();
  float peak = 0;                          // largest magnitude
  std::array<uint64_t, kBins> magnitudes;  // that are not 0

  ValueStats() { magnitudes.fill(0); }

  void Add(const float* values, int count) {
    for (int i = 0; i < count; ++i) {
      const float magnitude = std::fabs(values[i]);
      if (!std::isfinite(magnitude)) {
        ++non_finite;
        continue;
      }
      min = std::min(min, values[i]);
      peak = std::max(peak, magnitude);
      if (magnitude > 0) ++magnitudes[std::bit_cast<uint32_t>(magnitude) >> kBinShift];
    }
  }
  void Add(const ValueStats& other) {
    non_finite += other.non_finite;
    min = std::min(min, other.min);
    peak = std::max(peak, other.peak);
    for (size_t i = 0; i < kBins; ++i) magnitudes[i] += other.magnitudes[i];
  }

  // The lower end of the median's bin; 0 if all values are 0.
  float Median() const {
    uint64_t total = 0, below = 0;
    for (const uint64_t count : magnitudes) total += count;
    for (size_t i = 0; i < kBins; ++i) {
      below += magnitudes[i];
      if (2 * below >= total && below > 0)
        return std::bit_cast<float>(static_cast<uint32_t>(i) << kBinShift);
    }
    return 0;
  }
};

ValueStats Measure(const MapPlan& plan, const LoadedFile& file, int width, int height,
                   ThreadPool& pool) {
  std::vector<ValueStats> stats(pool.threads());
  std::vector<std::vector<float>> rows(pool.threads(), std::vector<float>(size_t{3} * width));
  pool.ParallelFor((height + kRowsPerTask - 1) / kRowsPerTask, [&](int task, int worker) {
    float* const row = rows[worker].data();
    float* const planes[3] = {row, row + width, row + 2 * static_cast<size_t>(width)};
    NormalDefects none;
    for (int y = task * kRowsPerTask; y < std::min(height, (task + 1) * kRowsPerTask); ++y) {
      LoadMapRow(plan, file, width, y, planes, &none);
      for (float* plane : planes) stats[worker].Add(plane, width);
    }
  });
  // Counts and extremes: the same in any order.
  for (size_t i = 1; i < stats.size(); ++i) stats[0].Add(stats[i]);
  return stats[0];
}

}  // namespace

Status ChooseEncodings(const std::vector<LoadedFile>& files,
                       const std::vector<ReferenceFile>& descriptions, int width, int height,
                       LogEncoding logarithms, ThreadPool& pool, std::vector<MapPlan>* plans) {
  for (MapPlan& plan : *plans) {
    if (plan.role->kind != MapKind::kColor) continue;
    const ReferenceFile& described = descriptions[plan.file];
    const bool floats = !IsInteger(described.type);
    if (!floats && plan.color.transform == nullptr) continue;
    const ValueStats stats = Measure(plan, files[plan.file], width, height, pool);
    if (stats.non_finite > 0) {
      return Fail(ErrorCode::kCorruptData,
                  described.path + ": " + std::to_string(stats.non_finite) +
                      " values are NaN or infinite once converted from \"" + plan.color.space +
                      "\"; is that its colour space?");
    }
    if (plan.encoding == Encoding::kSrgb) {
      if (!plan.loads_coded() && stats.min < -kSrgbToe) plan.encoding = Encoding::kLinear;
      continue;
    }
    const float median = stats.Median();
    const bool wide = stats.peak > kMinHdrPeak && stats.peak > kMinHdrRange * median;
    if (!floats || median == 0 || logarithms == LogEncoding::kNever) continue;
    if (!wide && logarithms != LogEncoding::kAlways) continue;
    plan.encoding = Encoding::kSignedLog;
    plan.scale = std::clamp(std::exp2(std::floor(std::log2(median))), 0x1p-100f, 0x1p100f);
  }
  return {};
}

}  // namespace patina
