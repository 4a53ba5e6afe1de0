#include "pipeline/metrics/psnr.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/pipeline/metrics/test_planes.h"

namespace patina::metrics {
namespace {

TEST(SumSquaredError, IsZeroForEqualPlanes) {
  ThreadPool pool(2);
  const auto plane = TestPlane::Random(33, 70, 1);
  EXPECT_EQ(SumSquaredError(plane.View(), plane.View(), pool), 0.0);
}

TEST(SumSquaredError, CountsEachTexelOnceAtEveryWidth) {
  ThreadPool pool(2);
  for (int width = 1; width <= 20; ++width) {
    const TestPlane zero(width, 3, 0.0f, 5);
    const TestPlane half(width, 3, 0.5f, 2);
    EXPECT_EQ(SumSquaredError(zero.View(), half.View(), pool), 0.25 * 3 * width) << width;
  }
}

TEST(SumSquaredError, SeesASingleTexelAnywhere) {
  ThreadPool pool(1);
  for (int at = 0; at < 17 * 3; ++at) {
    const TestPlane a(17, 3, 0.25f);
    TestPlane b = a;
    b.At(at % 17, at / 17) = 0.75f;
    EXPECT_EQ(SumSquaredError(a.View(), b.View(), pool), 0.25) << at;
  }
}

TEST(SumSquaredError, KeepsSmallErrorsOfALargePlane) {
  ThreadPool pool(2);
  const TestPlane a(512, 512, 0.5f);
  const TestPlane b(512, 512, 0.5f + 0x1p-12f);
  EXPECT_EQ(SumSquaredError(a.View(), b.View(), pool), 512.0 * 512.0 * 0x1p-24);
}

TEST(SumSquaredError, HasTheSameBitsForAnyNumberOfThreads) {
  const auto a = TestPlane::Random(131, 97, 2);
  const auto b = TestPlane::Random(131, 97, 3);
  ThreadPool one(1), two(2), three(3);
  const double sum = SumSquaredError(a.View(), b.View(), one);
  EXPECT_EQ(SumSquaredError(a.View(), b.View(), two), sum);
  EXPECT_EQ(SumSquaredError(a.View(), b.View(), three), sum);
}

TEST(PsnrDb, FollowsItsDefinition) {
  EXPECT_DOUBLE_EQ(PsnrDb(0.01), 20.0);
  EXPECT_DOUBLE_EQ(PsnrDb(1.0), 0.0);
  EXPECT_DOUBLE_EQ(PsnrDb(4.0), 10.0 * std::log10(0.25));
  EXPECT_DOUBLE_EQ(PsnrDb(255.0 * 255.0 / 1000.0, 255.0), 30.0);
}

TEST(PsnrDb, StopsAtItsLargestValue) {
  EXPECT_EQ(PsnrDb(0.0), kMaxPsnrDb);
  EXPECT_EQ(PsnrDb(1e-30), kMaxPsnrDb);
  EXPECT_LT(PsnrDb(1.1e-10), kMaxPsnrDb);
}

}  // namespace
}  // namespace patina::metrics
