#include "pipeline/metrics/ssim.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/pipeline/metrics/test_planes.h"

namespace patina::metrics {
namespace {

constexpr double kC1 = 0.01 * 0.01;
constexpr double kC2 = 0.03 * 0.03;

double Gauss(int k) { return std::exp(-0.5 * k * k / (1.5 * 1.5)); }

// Eq. 13 of the paper with two-pass moments, in double: the window of 11x11 around (cx, cy), cut at
// the border.
double WindowSsim(const TestPlane& a, const TestPlane& b, int cx, int cy) {
  double sum = 0, mean_a = 0, mean_b = 0;
  const auto each = [&](auto&& visit) {
    for (int dy = -5; dy <= 5; ++dy) {
      for (int dx = -5; dx <= 5; ++dx) {
        const int x = cx + dx, y = cy + dy;
        if (x < 0 || y < 0 || x >= a.width() || y >= a.height()) continue;
        visit(Gauss(dx) * Gauss(dy), static_cast<double>(a.At(x, y)),
              static_cast<double>(b.At(x, y)));
      }
    }
  };
  each([&](double w, double, double) { sum += w; });
  each([&](double w, double va, double vb) {
    mean_a += w / sum * va;
    mean_b += w / sum * vb;
  });
  double var_a = 0, var_b = 0, covariance = 0;
  each([&](double w, double va, double vb) {
    var_a += w / sum * (va - mean_a) * (va - mean_a);
    var_b += w / sum * (vb - mean_b) * (vb - mean_b);
    covariance += w / sum * (va - mean_a) * (vb - mean_b);
  });
  return (2 * mean_a * mean_b + kC1) * (2 * covariance + kC2) /
         ((mean_a * mean_a + mean_b * mean_b + kC1) * (var_a + var_b + kC2));
}

double SlowSsim(const TestPlane& a, const TestPlane& b) {
  const int x_margin = a.width() >= 11 ? 5 : 0, y_margin = a.height() >= 11 ? 5 : 0;
  double sum = 0;
  int count = 0;
  for (int y = y_margin; y < a.height() - y_margin; ++y) {
    for (int x = x_margin; x < a.width() - x_margin; ++x) {
      sum += WindowSsim(a, b, x, y);
      ++count;
    }
  }
  return sum / count;
}

TEST(MeanSsim, IsOneForEqualPlanes) {
  ThreadPool pool(2);
  const auto plane = TestPlane::Random(40, 90, 1);
  EXPECT_EQ(MeanSsim(plane.View(), plane.View(), pool), 1.0);
}

TEST(MeanSsim, OfConstantsIsTheLuminanceTerm) {
  ThreadPool pool(1);
  const TestPlane a(20, 20, 0.25f), b(20, 20, 0.75f);
  const double expected = (2 * 0.25 * 0.75 + kC1) / (0.25 * 0.25 + 0.75 * 0.75 + kC1);
  // Bounded by single precision: the variances of constants are zero only to about 1e-7, against C2
  // = 9e-4.
  EXPECT_NEAR(MeanSsim(a.View(), b.View(), pool), expected, 5e-4);
  EXPECT_NEAR(expected, 0.600064, 1e-6);
}

TEST(MeanSsim, OfOneTexelIsTheLuminanceTerm) {
  ThreadPool pool(1);
  const TestPlane a(1, 1, 0.0f), b(1, 1, 1.0f);
  EXPECT_NEAR(MeanSsim(a.View(), b.View(), pool), kC1 / (1 + kC1), 1e-9);
}

// Two texels (0, 1) against (1, 0): both windows are cut to the two texels, with weights p and q =
// 1 - p.
TEST(MeanSsim, OfTwoTexelsFollowsAHandComputation) {
  ThreadPool pool(1);
  TestPlane a(2, 1), b(2, 1);
  a.At(1, 0) = 1;
  b.At(0, 0) = 1;
  const double p = 1 / (1 + std::exp(-0.5 / 2.25)), q = 1 - p;
  const double expected =
      (2 * p * q + kC1) * (-2 * p * q + kC2) / ((p * p + q * q + kC1) * (2 * p * q + kC2));
  EXPECT_NEAR(MeanSsim(a.View(), b.View(), pool), expected, 1e-5);
}

TEST(MeanSsim, OfAnInvertedCheckerboardIsNearlyMinusOne) {
  ThreadPool pool(1);
  TestPlane a(32, 32), b(32, 32);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      a.At(x, y) = static_cast<float>((x + y) & 1);
      b.At(x, y) = 1 - a.At(x, y);
    }
  }
  EXPECT_LT(MeanSsim(a.View(), b.View(), pool), -0.99);
}

TEST(MeanSsim, AgreesWithTheDefinitionAtManySizes) {
  ThreadPool pool(2);
  const int sizes[][2] = {{1, 1},  {1, 9},   {2, 30}, {10, 10}, {11, 11}, {12, 10},
                          {11, 3}, {17, 65}, {40, 8}, {23, 86}, {64, 150}};
  uint64_t seed = 10;
  for (const auto& size : sizes) {
    const auto a = TestPlane::Random(size[0], size[1], ++seed, 3);
    auto b = TestPlane::Random(size[0], size[1], ++seed);
    for (int y = 0; y < size[1]; ++y) {
      for (int x = 0; x < size[0]; ++x) b.At(x, y) = 0.7f * a.At(x, y) + 0.3f * b.At(x, y);
    }
    // Bounded by single-precision moments.
    EXPECT_NEAR(MeanSsim(a.View(), b.View(), pool), SlowSsim(a, b), 2e-5)
        << size[0] << "x" << size[1];
  }
}

TEST(MeanSsim, ScalesWithThePeak) {
  ThreadPool pool(1);
  auto a = TestPlane::Random(30, 30, 4), b = TestPlane::Random(30, 30, 5);
  const double unit = MeanSsim(a.View(), b.View(), pool);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 30; ++x) {
      a.At(x, y) *= 256;
      b.At(x, y) *= 256;
    }
  }
  EXPECT_NEAR(MeanSsim(a.View(), b.View(), pool, 256.0), unit, 1e-6);
}

TEST(MeanSsim, HasTheSameBitsForAnyNumberOfThreads) {
  const auto a = TestPlane::Random(77, 300, 2), b = TestPlane::Random(77, 300, 3);
  ThreadPool one(1), two(2), three(3);
  const double value = MeanSsim(a.View(), b.View(), one);
  EXPECT_EQ(MeanSsim(a.View(), b.View(), two), value);
  EXPECT_EQ(MeanSsim(a.View(), b.View(), three), value);
}

}  // namespace
}  // namespace patina::metrics
