#include "pipeline/metrics/normal_angle.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/pipeline/metrics/test_planes.h"

namespace patina::metrics {
namespace {

float Coded(double component) { return static_cast<float>(0.5 + 0.5 * component); }

double Angle(double ax, double ay, double bx, double by) {
  ThreadPool pool(1);
  const TestPlane rx(3, 2, Coded(ax)), ry(3, 2, Coded(ay)), tx(3, 2, Coded(bx)),
      ty(3, 2, Coded(by));
  return MeanNormalAngleDeg(rx.View(), ry.View(), tx.View(), ty.View(), pool);
}

TEST(CodedNormalZ, CompletesAUnitVector) {
  EXPECT_FLOAT_EQ(CodedNormalZ(0.5f, 0.5f), 1.0f);
  EXPECT_FLOAT_EQ(CodedNormalZ(Coded(0.6), 0.5f), Coded(0.8));
  EXPECT_EQ(CodedNormalZ(1.0f, 1.0f), 0.5f);
}

TEST(MeanNormalAngleDeg, IsZeroForEqualMaps) {
  EXPECT_EQ(Angle(0.3, -0.2, 0.3, -0.2), 0.0);
  EXPECT_EQ(Angle(1.0, 1.0, 1.0, 1.0), 0.0);
}

TEST(MeanNormalAngleDeg, KnowsRightAngles) {
  EXPECT_NEAR(Angle(1, 0, 0, 1), 90.0, 1e-5);
  EXPECT_NEAR(Angle(1, 0, -1, 0), 180.0, 1e-5);
  EXPECT_NEAR(Angle(0, 0, 0, 1), 90.0, 1e-5);
}

TEST(MeanNormalAngleDeg, ResolvesSmallAngles) {
  const double tiny_rad = 1e-4;
  // Bounded by the step of a float near 0.5: 6e-8 of component, 3.4e-6 degrees.
  EXPECT_NEAR(Angle(0, 0, std::sin(tiny_rad), 0), tiny_rad * 180 / M_PI, 4e-6);
}

TEST(MeanNormalAngleDeg, ProjectsOverlongVectorsToTheHorizon) {
  EXPECT_NEAR(Angle(1, 1, std::sqrt(0.5), std::sqrt(0.5)), 0.0, 0.04);
  EXPECT_NEAR(Angle(1, 1, 0, 0), 90.0, 1e-5);
}

TEST(MeanNormalAngleDeg, AveragesOverTexels) {
  ThreadPool pool(2);
  const TestPlane flat(10, 10, 0.5f);
  TestPlane tilted(10, 10, 0.5f);
  for (int y = 0; y < 10; ++y) tilted.At(y, y) = 1.0f;  // one texel in ten lies on the horizon
  EXPECT_NEAR(MeanNormalAngleDeg(flat.View(), flat.View(), tilted.View(), flat.View(), pool), 9.0,
              1e-9);
}

TEST(MeanNormalAngleDeg, HasTheSameBitsForAnyNumberOfThreads) {
  const auto a = TestPlane::Random(50, 99, 5), b = TestPlane::Random(50, 99, 6);
  const auto c = TestPlane::Random(50, 99, 7), d = TestPlane::Random(50, 99, 8);
  ThreadPool one(1), three(3);
  EXPECT_EQ(MeanNormalAngleDeg(a.View(), b.View(), c.View(), d.View(), one),
            MeanNormalAngleDeg(a.View(), b.View(), c.View(), d.View(), three));
}

}  // namespace
}  // namespace patina::metrics
