#include "pipeline/color/color_transform.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace patina {
namespace {

// Integer files have at most 65536 codes: with a cell for each, they meet the table's own points.
constexpr int kCells = 65535;

class CurveAndMatrix : public ColorTransform {
 public:
  CurveAndMatrix(const TransferCurve& curve, const Matrix3& matrix)
      : curve_(curve), linear_(curve == TransferCurve()) {
    for (int i = 0; i < 9; ++i) matrix_[i] = static_cast<float>(matrix[i]);
    if (linear_) return;
    table_.resize(kCells + 1);
    for (int i = 0; i <= kCells; ++i)
      table_[i] = static_cast<float>(curve.Decode(static_cast<double>(i) / kCells));
  }

 private:
  float Decode(float coded) const {
    const float magnitude = std::fabs(coded);
    if (!(magnitude < 1.0f)) return static_cast<float>(curve_.Decode(static_cast<double>(coded)));
    const float position = magnitude * static_cast<float>(kCells);
    const int cell = std::min(static_cast<int>(position), kCells - 1);
    const float fraction = position - static_cast<float>(cell);
    const float value = table_[cell] + fraction * (table_[cell + 1] - table_[cell]);
    return std::copysign(value, coded);
  }

  void Convert(float* r, float* g, float* b, size_t count) const noexcept override {
    if (!linear_) {
      for (float* plane : {r, g, b}) {
        for (size_t i = 0; i < count; ++i) plane[i] = Decode(plane[i]);
      }
    }
    const auto& m = matrix_;
    for (size_t i = 0; i < count; ++i) {
      const float x = r[i], y = g[i], z = b[i];
      r[i] = m[0] * x + m[1] * y + m[2] * z;
      g[i] = m[3] * x + m[4] * y + m[5] * z;
      b[i] = m[6] * x + m[7] * y + m[8] * z;
    }
  }

  TransferCurve curve_;
  bool linear_;
  std::array<float, 9> matrix_{};
  std::vector<float> table_;
};

}  // namespace

void ColorTransform::Apply(float* r, float* g, float* b, size_t count) const {
  bool bad[kRun];
  for (size_t begin = 0; begin < count; begin += kRun) {
    const size_t n = std::min(kRun, count - begin);
    float* const planes[3] = {r + begin, g + begin, b + begin};
    bool any = false;
    for (size_t i = 0; i < n; ++i) {
      // Zero unless one of them is not finite.
      bad[i] = !(0 * planes[0][i] + 0 * planes[1][i] + 0 * planes[2][i] == 0);
      any |= bad[i];
      if (bad[i]) planes[0][i] = planes[1][i] = planes[2][i] = 0;
    }
    Convert(planes[0], planes[1], planes[2], n);
    for (size_t i = 0; any && i < n; ++i) {
      if (bad[i]) planes[0][i] = planes[1][i] = planes[2][i] = NAN;
    }
  }
}

bool IsProportional(const ColorTransform& transform) {
  std::array<float, 3> r{0.2f, 0.4f, 0.8f}, g = r, b = r;
  transform.Apply(r.data(), g.data(), b.data(), r.size());
  const auto proportional = [](const std::array<float, 3>& v) {
    return std::fabs(v[1] - 2 * v[0]) <= 1e-3f * std::fabs(v[1]) &&
           std::fabs(v[2] - 2 * v[1]) <= 1e-3f * std::fabs(v[2]);
  };
  return proportional(r) && proportional(g) && proportional(b);
}

ColorTransformPtr TransformFromTag(const TransferCurve& curve, const Primaries& from,
                                   const Primaries& to) {
  const auto matrix = from == to ? kIdentity3 : ConversionMatrix(from, to);
  if (!matrix) return nullptr;
  return std::make_shared<CurveAndMatrix>(curve, *matrix);
}

}  // namespace patina
