#include "pipeline/metrics/flip.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/pipeline/metrics/flip_reference.h"
#include "tests/pipeline/metrics/test_planes.h"

namespace patina::metrics {
namespace {

using Rgb = std::array<TestPlane, 3>;

Rgb Constant(int width, int height, float r, float g, float b) {
  return {TestPlane(width, height, r), TestPlane(width, height, g), TestPlane(width, height, b)};
}

Rgb Random(int width, int height, uint64_t seed) {
  return {TestPlane::Random(width, height, seed), TestPlane::Random(width, height, seed + 1, 3),
          TestPlane::Random(width, height, seed + 2)};
}

// Structure at several scales, so that edges and points differ too.
Rgb Scene(int width, int height, double phase) {
  Rgb image = Constant(width, height, 0, 0, 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image[0].At(x, y) =
          static_cast<float>(0.5 + 0.4 * std::sin(0.31 * x + phase) * std::cos(0.17 * y));
      image[1].At(x, y) =
          static_cast<float>(((x / 9 + y / 7) & 1) * 0.6 + 0.2 * std::sin(0.05 * y + phase));
      image[2].At(x, y) = static_cast<float>((x * y % 23 == 0 ? 1.0 : 0.3) - 0.2 * phase);
    }
  }
  return image;
}

RgbView View(const Rgb& image) { return {image[0].View(), image[1].View(), image[2].View()}; }

double Flip(const Rgb& a, const Rgb& b) {
  ThreadPool pool(2);
  return MeanFlip(View(a), View(b), pool);
}

TEST(MeanFlip, IsZeroForEqualImages) {
  const Rgb image = Random(60, 45, 1);
  EXPECT_EQ(Flip(image, image), 0.0);
}

TEST(MeanFlip, OfBlackAndWhiteIsTheLastPartOfTheScale) {
  // HyAB of black and white is 100 (lightness only); the largest distance, of green and blue, is
  // 203.30 with Hunt's adjustment: 100^0.7 = 25.119 lies beyond the knee at 0.4 of 203.30^0.7
  // = 41.276.
  const double largest = std::pow(203.3016546, 0.7), knee = 0.4 * largest;
  const double expected = 0.95 + 0.05 * (std::pow(100.0, 0.7) - knee) / (largest - knee);
  EXPECT_NEAR(Flip(Constant(30, 20, 0, 0, 0), Constant(30, 20, 1, 1, 1)), expected, 1e-5);
}

TEST(MeanFlip, OfGreenAndBlueIsOne) {
  EXPECT_NEAR(Flip(Constant(16, 16, 0, 1, 0), Constant(16, 16, 0, 0, 1)), 1.0, 1e-5);
}

TEST(MeanFlip, IsSymmetric) {
  const Rgb a = Scene(70, 50, 0), b = Random(70, 50, 7);
  EXPECT_EQ(Flip(a, b), Flip(b, a));
}

TEST(MeanFlip, GrowsWithTheDifference) {
  const Rgb image = Scene(64, 64, 0);
  double last = 0;
  for (const double phase : {0.02, 0.1, 0.4, 1.2}) {
    const double value = Flip(image, Scene(64, 64, phase));
    EXPECT_GT(value, last);
    last = value;
  }
  EXPECT_LE(last, 1.0);
}

TEST(MeanFlip, TakesValuesOutsideTheUnitRangeAsClamped) {
  EXPECT_EQ(Flip(Constant(12, 12, -3, 7, 0.5f), Constant(12, 12, 0, 1, 0.5f)), 0.0);
}

TEST(MeanFlip, AgreesWithTheDefinition) {
  const int sizes[][2] = {{1, 1}, {5, 3}, {37, 21}, {140, 9}, {7, 133}};
  for (const auto& size : sizes) {
    const Rgb a = Scene(size[0], size[1], 0);
    for (const Rgb& b : {Scene(size[0], size[1], 0.3), Random(size[0], size[1], 20)}) {
      const auto expected = SlowFlip(a, b);
      std::vector<float> map(expected.size(), -1.0f);
      ThreadPool pool(2);
      const double mean = MeanFlip(View(a), View(b), pool, map.data());
      double sum = 0, worst = 0;
      for (size_t i = 0; i < expected.size(); ++i) {
        sum += expected[i];
        worst = std::max(worst, std::abs(expected[i] - static_cast<double>(map[i])));
      }
      // Bounded by single precision; the exponents 0.7 and 0.5 magnify it where two features are
      // nearly equal.
      EXPECT_LT(worst, 2e-3) << size[0] << "x" << size[1];
      EXPECT_NEAR(mean, sum / static_cast<double>(expected.size()), 5e-5)
          << size[0] << "x" << size[1];
    }
  }
}

TEST(MeanFlip, HasTheSameBitsForAnyNumberOfThreads) {
  const Rgb a = Scene(300, 270, 0), b = Scene(300, 270, 0.2);
  ThreadPool one(1), three(3);
  std::vector<float> first(300 * 270), second(300 * 270);
  EXPECT_EQ(MeanFlip(View(a), View(b), one, first.data()),
            MeanFlip(View(a), View(b), three, second.data()));
  EXPECT_EQ(first, second);
}

}  // namespace
}  // namespace patina::metrics
