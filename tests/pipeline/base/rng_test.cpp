#include "pipeline/base/rng.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>

namespace patina {
namespace {

// Golden numbers: a change of the generator changes every baked byte and must raise the recipe
// version.
TEST(Rng, GivesTheNumbersItAlwaysGave) {
  Rng rng(1);
  const std::array<uint64_t, 3> golden = {0x5E41AB087439611Eull, 0xF18D6CE93D6CF1EEull,
                                          0x0B95F66D327E8D78ull};
  for (const uint64_t expected : golden) EXPECT_EQ(rng.Next(), expected);
}

TEST(Rng, RepeatsForASeedAndStream) {
  Rng a(42, 7), b(42, 7);
  for (int i = 0; i < 100; ++i) ASSERT_EQ(a.Next(), b.Next());
}

TEST(Rng, DiffersBetweenSeedsAndStreams) {
  std::set<uint64_t> first;
  for (uint64_t seed = 0; seed < 50; ++seed) {
    for (uint64_t stream = 0; stream < 50; ++stream) first.insert(Rng(seed, stream).Next());
  }
  // A seed and stream that add up to the same start would give the same sequence.
  EXPECT_EQ(first.size(), 2500u);
}

TEST(Rng, UniformStaysInItsRangeWithTheRightMoments) {
  Rng rng(3);
  double sum = 0, squares = 0;
  constexpr int kCount = 200000;
  for (int i = 0; i < kCount; ++i) {
    const float u = rng.Uniform();
    ASSERT_GE(u, 0.0f);
    ASSERT_LT(u, 1.0f);
    sum += static_cast<double>(u);
    squares += static_cast<double>(u) * static_cast<double>(u);
  }
  // Statistical: five standard errors of the mean are 0.0032, of the mean square 0.0033.
  EXPECT_NEAR(sum / kCount, 0.5, 0.0035);
  EXPECT_NEAR(squares / kCount, 1.0 / 3.0, 0.0035);
}

TEST(Rng, BelowCoversItsRangeEvenly) {
  Rng rng(4);
  std::array<int, 7> counts = {};
  for (int i = 0; i < 70000; ++i) {
    const uint32_t value = rng.Below(7);
    ASSERT_LT(value, 7u);
    ++counts[value];
  }
  // Statistical: five standard deviations of a count are 463.
  for (const int count : counts) EXPECT_NEAR(count, 10000, 470);
}

TEST(Rng, BelowOneIsZero) {
  Rng rng(5);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(rng.Below(1), 0u);
}

TEST(Rng, NeighbouringStreamsAreUncorrelated) {
  double sum = 0;
  constexpr int kCount = 20000;
  for (uint64_t stream = 0; stream < kCount; ++stream) {
    Rng a(9, stream), b(9, stream + 1);
    sum += (static_cast<double>(a.Uniform()) - 0.5) * (static_cast<double>(b.Uniform()) - 0.5);
  }
  // Statistical: five standard errors of the product's mean (standard deviation 1/12) are 0.003.
  EXPECT_NEAR(sum / kCount, 0.0, 0.003);
}

}  // namespace
}  // namespace patina
