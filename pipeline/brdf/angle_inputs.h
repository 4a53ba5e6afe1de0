// The scalars that the network sees besides the features, and the canonical form of a pair of
// directions.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "formats/brdf/angles.h"
#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

// In: unit directions as they are, before any fold of the azimuth. Out, each in about [-1, 1]:
//   l = 2 log(1 + 200 theta_h) / 5.75 - 1     fine near the mirror direction
//   t = 4 theta_d / pi - 1                    the difference angle: Fresnel
//   q = sin 2 phi_d                           signed: what a folded azimuth difference loses
// All are unchanged when wi and wo are exchanged. Angles come from lengths, not from arc cosines,
// so that a mirror direction keeps its digits.
inline void AngleInputs(const Direction& wi, const Direction& wo, float out[3]) {
  const float sx = wi.x + wo.x, sy = wi.y + wo.y, sz = wi.z + wo.z;
  const float length = std::sqrt(sx * sx + sy * sy + sz * sz);
  const float inverse = length > 1e-12f ? 1 / length : 0.0f;
  const float hx = sx * inverse, hy = sy * inverse, hz = length > 1e-12f ? sz * inverse : 1.0f;
  const float sine = std::sqrt(hx * hx + hy * hy);
  const float theta_h = Atan2(sine, hz);
  const float ex = wi.x - wo.x, ey = wi.y - wo.y, ez = wi.z - wo.z;
  const float theta_d = Atan2(std::sqrt(ex * ex + ey * ey + ez * ez), length);
  const bool pole = sine < 1e-7f;
  const float c = pole ? 1.0f : hx / sine, s = pole ? 0.0f : hy / sine;
  // d = Ry(-theta_h) Rz(-phi_h) (wi - wo) / 2: the part along h is the same in both and drops out.
  const float along = c * ex + s * ey;
  const float dx = hz * along - sine * ez, dy = c * ey - s * ex;
  const float squared = dx * dx + dy * dy;
  out[0] = 2 * std::log(1 + 200 * theta_h) / 5.75f - 1;
  out[1] = 4 * theta_d / kPi - 1;
  out[2] = squared > 4e-12f ? 2 * dx * dy / squared : 0.0f;
}

// Where the half vector of an anisotropic material lies: X and Y, its components along the tangent
// and the bitangent, v -> sign(v) log(1 + 200 |v|) / log(201), each in [-1, 1]. Unchanged when wi
// and wo are exchanged.
inline void HalfVectorInputs(const Direction& wi, const Direction& wo, float out[2]) {
  const float sx = wi.x + wo.x, sy = wi.y + wo.y, sz = wi.z + wo.z;
  const float inverse = 1 / std::max(std::sqrt(sx * sx + sy * sy + sz * sz), 1e-12f);
  out[0] = std::copysign(std::log(1 + 200 * std::abs(sx * inverse)) / 5.30330491f, sx);
  out[1] = std::copysign(std::log(1 + 200 * std::abs(sy * inverse)) / 5.30330491f, sy);
}

// Exchanges the two so that wi is the one nearer to the normal: a model that only sees such pairs
// is reciprocal.
inline void MakeCanonical(Direction* wi, Direction* wo) {
  if (wo->z > wi->z) std::swap(*wi, *wo);
}

}  // namespace patina::brdf
