#include "pipeline/color/color_tag.h"

#include <algorithm>
#include <cmath>

namespace patina {

double TransferCurve::Decode(double coded) const {
  const double x = std::fabs(coded);
  double y;
  if (!table.empty()) {
    const double last = static_cast<double>(table.size() - 1);
    const double cell = std::clamp(std::floor(x * last), 0.0, std::max(0.0, last - 1));
    const size_t i = static_cast<size_t>(cell);
    const double low = static_cast<double>(table[i]);
    const double high = static_cast<double>(table[std::min(i + 1, table.size() - 1)]);
    y = low + (x * last - cell) * (high - low);
  } else if (x >= d) {
    y = std::pow(std::max(0.0, a * x + b), gamma) + e;
  } else {
    y = c * x + f;
  }
  return std::copysign(y, coded);
}

TransferCurve SrgbCurve() {
  TransferCurve curve;
  curve.gamma = 2.4;
  curve.a = 1 / 1.055;
  curve.b = 0.055 / 1.055;
  curve.c = 1 / 12.92;
  curve.d = 0.04045;
  return curve;
}

TransferCurve PowerCurve(double gamma) {
  TransferCurve curve;
  curve.gamma = gamma;
  return curve;
}

bool AreClose(const TransferCurve& a, const TransferCurve& b, double tolerance) {
  constexpr int kSteps = 1024;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = static_cast<double>(i) / kSteps;
    if (!(std::fabs(a.Decode(x) - b.Decode(x)) <= tolerance)) return false;
  }
  return true;
}

}  // namespace patina
