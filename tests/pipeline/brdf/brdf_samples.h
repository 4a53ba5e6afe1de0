// Analytic BRDFs as sources, for tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

class FunctionTable : public Table {
 public:
  using Function = std::function<bool(const Direction&, const Direction&, float*)>;
  explicit FunctionTable(Function f) : f_(std::move(f)) {}
  bool Evaluate(const Direction& wi, const Direction& wo, float rgb[3]) const override {
    rgb[0] = rgb[1] = rgb[2] = 0;
    return wi.z > 0 && wo.z > 0 && f_(wi, wo, rgb);
  }

 private:
  Function f_;
};

inline Source SourceOf(FunctionTable::Function f, bool isotropic = true) {
  Source source;
  source.format = "test";
  source.isotropic = isotropic;
  source.table = std::make_shared<FunctionTable>(std::move(f));
  source.cells = 1;
  return source;
}

// GGX of roughness alpha over a diffuse base; reciprocal.
inline bool Plastic(float alpha, const Direction& wi, const Direction& wo, float* rgb) {
  const float hx = wi.x + wo.x, hy = wi.y + wo.y, hz = wi.z + wo.z;
  const float length = std::sqrt(hx * hx + hy * hy + hz * hz);
  const float z = hz / length, a2 = alpha * alpha;
  const float bottom = z * z * (a2 - 1) + 1;
  const float d = a2 / (3.14159265f * bottom * bottom);
  const auto g1 = [&](float c) { return 2 * c / (c + std::sqrt(a2 + (1 - a2) * c * c)); };
  const float cosine = (wi.x * hx + wi.y * hy + wi.z * hz) / length;
  const float fresnel = 0.04f + 0.96f * std::pow(1 - std::min(1.0f, cosine), 5.0f);
  const float specular = d * g1(wi.z) * g1(wo.z) * fresnel / (4 * wi.z * wo.z);
  const float base[3] = {0.2f, 0.1f, 0.03f};
  for (int c = 0; c < 3; ++c) rgb[c] = base[c] / 3.14159265f + specular;
  return true;
}

}  // namespace patina::brdf
