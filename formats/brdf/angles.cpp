#include "formats/brdf/angles.h"

namespace patina::brdf {

void FromHalfDifference(double theta_h, double theta_d, double phi_d, Direction* wi,
                        Direction* wo) {
  const double sin_h = std::sin(theta_h);
  const double cos_h = std::cos(theta_h);
  const double dx = std::sin(theta_d) * std::cos(phi_d);
  const double dy = std::sin(theta_d) * std::sin(phi_d);
  const double dz = std::cos(theta_d);
  const auto turned = [&](double x, double y) {
    return Direction{static_cast<float>(cos_h * x + sin_h * dz), static_cast<float>(y),
                     static_cast<float>(cos_h * dz - sin_h * x)};
  };
  *wi = turned(dx, dy);
  *wo = turned(-dx, -dy);
}

}  // namespace patina::brdf
