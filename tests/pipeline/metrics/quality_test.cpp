#include "pipeline/metrics/quality.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/color/color.h"
#include "pipeline/metrics/flip.h"
#include "pipeline/metrics/normal_angle.h"
#include "pipeline/metrics/psnr.h"
#include "pipeline/metrics/ssim.h"
#include "tests/pipeline/metrics/test_planes.h"

namespace patina::metrics {
namespace {

PlanePair Pair(const TestPlane& reference, const TestPlane& test) {
  return {reference.View(), test.View(), 0, 0};
}
PlanePair Constant(float reference, float test) { return {{}, {}, reference, test}; }

TEST(QualityMeter, AveragesOverMipsAsThePaperDoes) {
  ThreadPool pool(2);
  QualityMeter meter({{"roughness", MapKind::kData, 1, false}});
  const TestPlane a0(4, 2, 0.0f), b0(4, 2, 0.1f), a1(2, 1, 0.5f), b1(2, 1, 0.7f);
  const PlanePair level0[] = {Pair(a0, b0)}, level1[] = {Pair(a1, b1)};
  meter.AddLevel(4, 2, level0, pool);
  meter.AddLevel(2, 1, level1, pool);
  const QualityResult result = meter.Finish();
  ASSERT_EQ(result.maps.size(), 1u);
  const PsnrTable& psnr = result.maps[0].psnr;
  EXPECT_NEAR(psnr.mip0_db, 20.0, 1e-5);
  EXPECT_NEAR(psnr.psnr_db[1], 10 * std::log10(1 / 0.04), 1e-5);
  EXPECT_NEAR(psnr.overall_db, 10 * std::log10(1 / 0.025), 1e-5);
  EXPECT_NEAR(psnr.mean_mips_db, (20.0 + 10 * std::log10(1 / 0.04)) / 2, 1e-5);
  EXPECT_EQ(result.psnr.overall_db, psnr.overall_db);
  EXPECT_FALSE(result.flip.has_value());
  EXPECT_FALSE(result.normal_angle_deg.has_value());
}

TEST(QualityMeter, WeighsChannelsAlikeAndCountsConstants) {
  ThreadPool pool(1);
  QualityMeter meter(
      {{"albedo", MapKind::kSrgbColor, 3, false}, {"metalness", MapKind::kData, 1, false}});
  const TestPlane a(8, 8, 0.2f), b(8, 8, 0.4f);
  const PlanePair planes[] = {Pair(a, b), Pair(a, a), Constant(0.3f, 0.3f), Constant(1, 1)};
  meter.AddLevel(8, 8, planes, pool);
  const QualityResult result = meter.Finish();
  EXPECT_NEAR(result.maps[0].psnr.mse[0], 0.04 / 3, 1e-8);
  EXPECT_EQ(result.maps[1].psnr.mse[0], 0.0);
  EXPECT_EQ(result.maps[1].psnr.mip0_db, kMaxPsnrDb);
  EXPECT_NEAR(result.psnr.mse[0], 0.04 / 4, 1e-8);
}

TEST(QualityMeter, ChargesAConstantThatIsOff) {
  ThreadPool pool(1);
  QualityMeter meter({{"ao", MapKind::kData, 1, false}});
  const PlanePair planes[] = {Constant(1.0f, 0.75f)};
  meter.AddLevel(5, 3, planes, pool);
  EXPECT_NEAR(meter.Finish().psnr.mse[0], 0.0625, 1e-12);
}

TEST(QualityMeter, ComparesAConstantWithAPlane) {
  ThreadPool pool(1);
  QualityMeter meter({{"ao", MapKind::kData, 1, false}});
  const TestPlane decoded(5, 3, 0.75f);
  const PlanePair planes[] = {{{}, decoded.View(), 1.0f, 0}};
  meter.AddLevel(5, 3, planes, pool);
  EXPECT_NEAR(meter.Finish().psnr.mse[0], 0.0625, 1e-12);
}

TEST(QualityMeter, CountsTheZOfNormals) {
  ThreadPool pool(1);
  QualityMeter meter({{"normal", MapKind::kNormalXy, 2, false}});
  const TestPlane flat(16, 16, 0.5f), tilted(16, 16, 0.8f);  // x = 0.6, so z = 0.8 against 1
  const PlanePair planes[] = {Pair(flat, tilted), Constant(0.5f, 0.5f)};
  meter.AddLevel(16, 16, planes, pool);
  const QualityResult result = meter.Finish();
  EXPECT_NEAR(result.psnr.mse[0], (0.3 * 0.3 + 0.1 * 0.1) / 3, 1e-7);
  ASSERT_TRUE(result.normal_angle_deg.has_value());
  EXPECT_NEAR(*result.normal_angle_deg, std::asin(0.6) * 180 / M_PI, 1e-4);
}

TEST(QualityMeter, MeasuresSsimAndFlipOnMip0Only) {
  ThreadPool pool(2);
  QualityMeter meter({{"albedo", MapKind::kSrgbColor, 3, true}});
  const auto r = TestPlane::Random(32, 32, 1), g = TestPlane::Random(32, 32, 2);
  const auto tr = TestPlane::Random(32, 32, 3), tg = TestPlane::Random(32, 32, 4);
  const PlanePair planes[] = {Pair(r, tr), Pair(g, tg), Constant(0.25f, 0.25f)};
  meter.AddLevel(32, 32, planes, pool);
  const TestPlane black(16, 16, 0.0f), white(16, 16, 1.0f);
  const PlanePair next[] = {Pair(black, white), Pair(black, white), Constant(0.25f, 0.25f)};
  meter.AddLevel(16, 16, next, pool);
  const QualityResult result = meter.Finish();
  ASSERT_TRUE(result.ssim.has_value());
  EXPECT_DOUBLE_EQ(*result.ssim,
                   (MeanSsim(r.View(), tr.View(), pool) + MeanSsim(g.View(), tg.View(), pool)) / 2);
  const TestPlane blue(32, 32, 0.25f);
  ASSERT_TRUE(result.flip.has_value());
  EXPECT_EQ(*result.flip,
            MeanFlip({r.View(), g.View(), blue.View()}, {tr.View(), tg.View(), blue.View()}, pool));
}

TEST(QualityMeter, ReadsAGreyColourMapAsThreeEqualChannels) {
  ThreadPool pool(1);
  QualityMeter meter({{"albedo", MapKind::kSrgbColor, 1, true}});
  const auto a = TestPlane::Random(20, 20, 1), b = TestPlane::Random(20, 20, 2);
  const PlanePair planes[] = {Pair(a, b)};
  meter.AddLevel(20, 20, planes, pool);
  EXPECT_EQ(meter.Finish().flip,
            MeanFlip({a.View(), a.View(), a.View()}, {b.View(), b.View(), b.View()}, pool));
}

TEST(QualityMeter, BringsColoursToRec709BeforeFlip) {
  ThreadPool pool(1);
  const Matrix3 to_wide = *ConversionMatrix(kRec709Primaries, kAp1Primaries);
  // The same colours in both spaces, coded.
  constexpr float kColors[2][3] = {{0.7f, 0.3f, 0.2f}, {0.5f, 0.4f, 0.1f}};
  std::vector<TestPlane> narrow, wide;
  for (const auto& color : kColors) {
    for (int c = 0; c < 3; ++c) {
      narrow.emplace_back(20, 20, static_cast<float>(LinearToSrgb(static_cast<double>(color[c]))));
      double in_wide = 0;
      for (int k = 0; k < 3; ++k)
        in_wide += to_wide[static_cast<size_t>(3 * c + k)] * static_cast<double>(color[k]);
      wide.emplace_back(20, 20, static_cast<float>(LinearToSrgb(in_wide)));
    }
  }
  const auto flip = [&](const std::vector<TestPlane>& planes, const Matrix3& matrix) {
    QualityMeter meter({{"albedo", MapKind::kSrgbColor, 3, true, matrix}});
    const PlanePair pairs[] = {Pair(planes[0], planes[3]), Pair(planes[1], planes[4]),
                               Pair(planes[2], planes[5])};
    meter.AddLevel(20, 20, pairs, pool);
    return *meter.Finish().flip;
  };
  const double right = flip(narrow, kIdentity3);
  EXPECT_NEAR(flip(wide, *ConversionMatrix(kAp1Primaries, kRec709Primaries)), right, 1e-4);
  EXPECT_GT(std::abs(flip(wide, kIdentity3) - right), 0.01);
}

TEST(QualityMeter, CodesLinearColourBeforeFlip) {
  ThreadPool pool(1);
  const TestPlane a(20, 20, 0.2140411f), b(20, 20, 0.0f);  // sRGB 0.5 and 0
  const TestPlane coded_a(20, 20, 0.5f), coded_b(20, 20, 0.0f);
  QualityMeter linear({{"albedo", MapKind::kLinearColor, 3, true}}),
      coded({{"albedo", MapKind::kSrgbColor, 3, true}});
  const PlanePair linear_planes[] = {Pair(a, b), Pair(a, b), Pair(a, b)};
  const PlanePair coded_planes[] = {Pair(coded_a, coded_b), Pair(coded_a, coded_b),
                                    Pair(coded_a, coded_b)};
  linear.AddLevel(20, 20, linear_planes, pool);
  coded.AddLevel(20, 20, coded_planes, pool);
  EXPECT_NEAR(*linear.Finish().flip, *coded.Finish().flip, 1e-5);
}

TEST(QualityMeter, OfEqualPlanesIsPerfect) {
  ThreadPool pool(1);
  QualityMeter meter({{"normal", MapKind::kNormalXy, 2, false}});
  const auto x = TestPlane::Random(12, 30, 1), y = TestPlane::Random(12, 30, 2);
  const PlanePair planes[] = {Pair(x, x), Pair(y, y)};
  meter.AddLevel(12, 30, planes, pool);
  const QualityResult result = meter.Finish();
  EXPECT_EQ(result.psnr.overall_db, kMaxPsnrDb);
  EXPECT_EQ(result.ssim, 1.0);
  EXPECT_EQ(result.normal_angle_deg, 0.0);
}

}  // namespace
}  // namespace patina::metrics
