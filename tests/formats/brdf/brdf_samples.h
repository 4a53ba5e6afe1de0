// Directions and analytic BRDFs that the tests of the readers share.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "formats/brdf/brdf_source.h"
#include "formats/brdf/write_brdf.h"
#include "tests/formats/test_support.h"

namespace patina::brdf {

inline constexpr double kDegree = std::numbers::pi / 180;

inline Direction FromDegrees(double theta, double phi) {
  const double t = theta * kDegree;
  const double p = phi * kDegree;
  return {static_cast<float>(std::sin(t) * std::cos(p)),
          static_cast<float>(std::sin(t) * std::sin(p)), static_cast<float>(std::cos(t))};
}

// Of even density over the solid angle down to max_theta.
inline Direction RandomDirection(test::Random& random, double max_theta) {
  const double z = 1 - (1 - std::cos(max_theta * kDegree)) * random.Unit();
  return FromDegrees(std::acos(z) / kDegree, 360 * random.Unit());
}

inline Direction Turned(const Direction& w, double degrees) {
  const double c = std::cos(degrees * kDegree);
  const double s = std::sin(degrees * kDegree);
  const double x = static_cast<double>(w.x);
  const double y = static_cast<double>(w.y);
  return {static_cast<float>(c * x - s * y), static_cast<float>(s * x + c * y), w.z};
}

// Isotropic and reciprocal, smooth, with a broad highlight; red has a term of one side of the plane
// of incidence, which a reader that mirrors azimuths gets wrong.
inline void SmoothBrdf(const Direction& wi, const Direction& wo, float rgb[3]) {
  const float hx = wi.x + wo.x;
  const float hy = wi.y + wo.y;
  const float hz = wi.z + wo.z;
  const float cos2 = hz * hz / (hx * hx + hy * hy + hz * hz);
  const float alpha2 = 0.3f * 0.3f;
  const float d = cos2 * (alpha2 - 1) + 1;
  const float lobe = 0.02f * alpha2 / (d * d);
  const float side = (wi.x * wo.y - wi.y * wo.x) * (wi.z - wo.z);
  const float dot = wi.x * wo.x + wi.y * wo.y + wi.z * wo.z;
  rgb[0] = 0.3f + lobe + 0.4f * side;
  rgb[1] = 0.2f + lobe + 0.1f * wi.z * wo.z;
  rgb[2] = 0.1f + lobe + 0.05f * dot;
}

// Reciprocal and the same when the surface is turned by 180 degrees, but not isotropic; green is
// not even mirrored.
inline void TurnedBrdf(const Direction& wi, const Direction& wo, float rgb[3]) {
  SmoothBrdf(wi, wo, rgb);
  rgb[0] += 0.1f * (wi.x * wo.x - wi.y * wo.y);
  rgb[1] += 0.1f * (wi.x * wo.y + wi.y * wo.x);
}

// Reciprocal, mirrored in x and in y, not isotropic.
inline void MirroredBrdf(const Direction& wi, const Direction& wo, float rgb[3]) {
  SmoothBrdf(wi, wo, rgb);
  rgb[0] = rgb[1] + 0.1f * (wi.x * wo.x - wi.y * wo.y);
}

// Reciprocal, without any symmetry of the surface.
inline void SkewBrdf(const Direction& wi, const Direction& wo, float rgb[3]) {
  TurnedBrdf(wi, wo, rgb);
  rgb[2] += 0.05f * (wi.x + wo.x) + 0.03f * (wi.y + wo.y);
}

}  // namespace patina::brdf
