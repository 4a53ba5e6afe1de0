// A surface whose normal a map has tilted, seen from the plane that the map lies on.
//
// A tilted facet reflects f(wi', wo') (n . wi) of the light that comes in at wi; against the
// plane's own cosine that is f(wi', wo') (n . wi) / wi.z, which is what a container holds, so that
// f times wi.z is what renderers get that shade with the tilted normal.
//
// Stable at both horizons: a facet that faces away from the light is black, which the factor
// approaches as light sinks behind it; one that faces away from the eye, which others would hide,
// is seen at kLeastCosine; and wi.z is not taken for less than that.
#pragma once

#include <algorithm>
#include <cmath>

#include "formats/brdf/brdf_source.h"

namespace patina::svbrdf {

inline constexpr float kLeastCosine = 0.02f;

struct TiltedFrame {
  brdf::Direction wi, wo;  // in the facet's frame, above its horizon, unit length
  float factor = 0;        // of f there; 0: black
};

inline float DotOf(const brdf::Direction& a, const brdf::Direction& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

// n: unit length, z >= 0. The frame's x is the plane's x, made orthogonal to n.
inline TiltedFrame TiltTo(const brdf::Direction& n, const brdf::Direction& wi,
                          const brdf::Direction& wo) {
  TiltedFrame frame;
  const float light = DotOf(n, wi);
  if (!(light > 0)) return frame;
  // Of a normal along x the frame's x is -z: any will do there.
  brdf::Direction t = {1 - n.x * n.x, -n.x * n.y, -n.x * n.z};
  const float length = std::sqrt(DotOf(t, t));
  t = length > 1e-4f ? brdf::Direction{t.x / length, t.y / length, t.z / length}
                     : brdf::Direction{0, 0, -1};
  const brdf::Direction b = {n.y * t.z - n.z * t.y, n.z * t.x - n.x * t.z, n.x * t.y - n.y * t.x};
  const auto local = [&](const brdf::Direction& w, float least) {
    brdf::Direction d = {DotOf(w, t), DotOf(w, b), DotOf(w, n)};
    if (!(d.z < least)) return d;
    d.z = least;
    const float s = std::sqrt((1 - least * least) / std::max(1e-12f, d.x * d.x + d.y * d.y));
    return brdf::Direction{d.x * s, d.y * s, d.z};
  };
  frame.wi = local(wi, 1e-4f);
  frame.wo = local(wo, kLeastCosine);
  frame.factor = light / std::max(wi.z, kLeastCosine);
  return frame;
}

}  // namespace patina::svbrdf
