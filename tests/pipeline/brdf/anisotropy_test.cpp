#include "pipeline/brdf/anisotropy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "formats/brdf/rgl.h"
#include "formats/brdf/utia.h"
#include "formats/brdf/write_brdf.h"
#include "pipeline/base/rng.h"
#include "tests/pipeline/brdf/brdf_samples.h"

namespace patina::brdf {
namespace {

constexpr double kQuarter = std::numbers::pi / 2;

double Of(FunctionTable::Function f) {
  return MeasureAnisotropy(FunctionTable(std::move(f)), kQuarter);
}

// Light from the half plane x > 0 is brighter by a share.
FunctionTable::Function Sided(float share) {
  return [share](const Direction& wi, const Direction&, float* rgb) {
    rgb[0] = rgb[1] = rgb[2] = 0.3f * (1 + share * (wi.x > 0 ? 1 : -1));
    return true;
  };
}

TEST(Anisotropy, IsNothingWhereTurningChangesNothing) {
  for (const float alpha : {0.5f, 0.02f}) {
    EXPECT_LT(Of([=](const Direction& wi, const Direction& wo, float* rgb) {
                return Plastic(alpha, wi, wo, rgb);
              }),
              0.001)
        << alpha;
  }
}

TEST(Anisotropy, IsTheShareThatTurningChanges) {
  EXPECT_NEAR(Of(Sided(0.02f)), 0.02, 0.004);
  EXPECT_NEAR(Of(Sided(0.2f)), 0.2, 0.04);
}

TEST(Anisotropy, SeesNarrowLobesThatTurn) {
  // A ridge one degree wide in the half vector's place along x.
  const double ridge = Of([](const Direction& wi, const Direction& wo, float* rgb) {
    const float hx = wi.x + wo.x, hz = wi.z + wo.z;
    rgb[0] = rgb[1] = rgb[2] = 0.1f + 5 * std::exp(-std::pow(hx / hz / 0.017f, 2.0f));
    return true;
  });
  EXPECT_GT(ridge, 5 * kIsotropicWithin);
}

TEST(Anisotropy, PassesOverWhatIsMissing) {
  EXPECT_EQ(Of([](const Direction&, const Direction&, float*) { return false; }), 0);
  EXPECT_EQ(Of([](const Direction&, const Direction&, float*) { return true; }), 0);  // black
  const double holes = Of([](const Direction& wi, const Direction&, float* rgb) {
    rgb[0] = rgb[1] = rgb[2] = 0.5f;
    return wi.x > 0;
  });
  EXPECT_NEAR(holes, 0, 1e-12);
}

TEST(Anisotropy, FormatsThatInterpolateAddLittle) {
  const BrdfFunction plastic = [](const Direction& wi, const Direction& wo, float* rgb) {
    Plastic(0.3f, wi, wo, rgb);
  };
  const auto utia = ParseUtia(EncodeUtia(plastic), "plastic.bin");
  ASSERT_TRUE(utia) << utia.error().message;
  EXPECT_LT(MeasureAnisotropy(*utia->table, static_cast<double>(utia->max_theta_rad)), 1e-4);
  RglLayout layout;
  layout.isotropic = false;
  const auto rgl = ParseRgl(EncodeRgl(plastic, layout, "plastic"), "plastic.bsdf");
  ASSERT_TRUE(rgl) << rgl.error().message;
  EXPECT_FALSE(rgl->isotropic);
  EXPECT_LT(MeasureAnisotropy(*rgl->table, kQuarter), kIsotropicWithin);
}

}  // namespace
}  // namespace patina::brdf
