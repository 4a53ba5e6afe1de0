// Angles of directions and of pairs of directions, in single precision: the same bits on every CPU
// (no call of libm but sqrt), and accurate at the poles, at grazing angles and near the mirror
// direction.
#pragma once

#include <cmath>

#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

inline constexpr float kPi = 3.14159265f;
inline constexpr float kHalfPi = 1.57079633f;
inline constexpr float kTwoPi = 6.28318531f;

// The angle of (x, y) in [-pi, pi], within 3e-7 rad; 0 for (0, 0).
inline float Atan2(float y, float x) {
  const float ax = std::abs(x);
  const float ay = std::abs(y);
  const float large = ax > ay ? ax : ay;
  const float small = ax > ay ? ay : ax;
  if (!(large > 0)) return 0;
  const float ratio = small / large;
  // atan(a) = pi/4 + atan((a - 1)/(a + 1)) brings the argument to +-tan(pi/8), where an odd
  // polynomial (Chebyshev fit of atan(s)/s in s^2) is within 7e-9.
  const bool upper = ratio > 0.41421356f;
  const float s = upper ? (ratio - 1) / (ratio + 1) : ratio;
  const float z = s * s;
  float angle =
      s * (0.99999998f +
           z * (-0.333327858f + z * (0.199740824f + z * (-0.138484902f + z * 0.0797629181f))));
  if (upper) angle += 0.785398163f;
  if (ay > ax) angle = kHalfPi - angle;
  if (x < 0) angle = kPi - angle;
  return y < 0 ? -angle : angle;
}

inline float Length2(float x, float y) { return std::sqrt(x * x + y * y); }

// The angle to the normal, [0, pi].
inline float Colatitude(const Direction& w) { return Atan2(Length2(w.x, w.y), w.z); }

// Rusinkiewicz's half and difference angles (1998): h = (wi + wo)/|wi + wo|; d is wi in the frame
// that turns h to the pole by -phi_h about z, then -theta_h about y.
struct HalfDifference {
  float theta_h = 0;  // [0, pi/2] for directions above the surface
  float theta_d = 0;  // [0, pi/2]
  float phi_d = 0;    // [-pi, pi]; wi and wo exchanged: turned by pi
};

// Both directions of unit length. Where an azimuth is undefined (h at the pole, wi = wo) it is 0.
inline HalfDifference ToHalfDifference(const Direction& wi, const Direction& wo) {
  // With s = wi + wo and m = wi - wo, m is perpendicular to h and d = (m . t, m . b, |s|)/2:
  // nothing cancels.
  const float sx = wi.x + wo.x;
  const float sy = wi.y + wo.y;
  const float sz = wi.z + wo.z;
  const float mx = wi.x - wo.x;
  const float my = wi.y - wo.y;
  const float mz = wi.z - wo.z;
  const float across = Length2(sx, sy);
  const float sum = std::sqrt(sx * sx + sy * sy + sz * sz);
  const float difference = std::sqrt(mx * mx + my * my + mz * mz);
  const float cos_phi = across > 0 ? sx / across : 1;
  const float sin_phi = across > 0 ? sy / across : 0;
  const float along = cos_phi * mx + sin_phi * my;
  HalfDifference angles;
  angles.theta_h = Atan2(across, sz);
  angles.theta_d = Atan2(difference, sum);
  angles.phi_d = Atan2((cos_phi * my - sin_phi * mx) * sum, along * sz - mz * across);
  return angles;
}

// The two directions of half and difference angles, with phi_h = 0; z may be negative.
void FromHalfDifference(double theta_h, double theta_d, double phi_d, Direction* wi, Direction* wo);

// A place on a row of `count` nodes: between `low` and `high` with the weight `t` of `high`.
struct Place {
  int low = 0;
  int high = 0;
  float t = 0;
};

// Position `x` in units of nodes; beyond the ends (and for NaN) the end's value holds.
inline Place PlaceOnRow(float x, int count) {
  const float last = static_cast<float>(count - 1);
  if (!(x > 0)) return {0, 0, 0};
  if (x >= last) return {count - 1, count - 1, 0};
  const int low = static_cast<int>(x);
  return {low, low + 1, x - static_cast<float>(low)};
}

// The same on a ring, with x in [-2 count, 2 count); NaN gives the first node.
inline Place PlaceOnRing(float x, int count) {
  const float period = static_cast<float>(count);
  if (x < 0) x += period;
  if (x < 0) x += period;
  if (x >= period) x -= period;
  if (!(x > 0) || x >= period) return {0, 0, 0};
  const int low = static_cast<int>(x);
  return {low, low + 1 == count ? 0 : low + 1, x - static_cast<float>(low)};
}

}  // namespace patina::brdf
