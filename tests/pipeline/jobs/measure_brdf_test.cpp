#include "pipeline/jobs/measure_brdf.h"

#include <gtest/gtest.h>

#include <numbers>

#include "pipeline/jobs/sample_brdf.h"

namespace patina {
namespace {

using brdf::Direction;

// f = 1/pi reflects everything. The quadrature has 64 steps over the half vector; what it loses is
// at the horizon.
TEST(DirectionalAlbedo, OfAWhiteSurfaceIsOne) {
  const auto white = [](int, size_t count, const Direction*, const Direction*, float* rgb) {
    for (size_t i = 0; i < 3 * count; ++i) rgb[i] = static_cast<float>(std::numbers::inv_pi);
  };
  for (const double degrees : kAlbedoDegrees) {
    const auto albedo = DirectionalAlbedo(white, degrees);
    for (const double value : albedo) EXPECT_NEAR(value, 1, 0.01) << degrees;
  }
}

// A lobe of 0.1 degree that a grid over wo would miss: at normal incidence it reflects its Fresnel
// term and nothing is shadowed.
TEST(DirectionalAlbedo, SeesTheNarrowestLobe) {
  const auto mirror = [](int, size_t count, const Direction* wi, const Direction* wo, float* rgb) {
    for (size_t i = 0; i < count; ++i)
      EvaluateAnalytic(AnalyticBrdf::kMirror, wi[i], wo[i], rgb + 3 * i);
  };
  const auto albedo = DirectionalAlbedo(mirror, 0);
  EXPECT_NEAR(albedo[0], 0.95, 0.03);
  EXPECT_NEAR(albedo[2], 0.88, 0.03);
}

}  // namespace
}  // namespace patina
