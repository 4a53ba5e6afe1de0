#include "pipeline/brdf/quantiser.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "pipeline/base/aligned_buffer.h"

namespace patina::brdf {
namespace {

constexpr int kStride = 16;

// `clusters` well separated heaps of points.
AlignedBuffer<float> Heaps(int points, int clusters, uint64_t seed) {
  AlignedBuffer<float> rows(static_cast<size_t>(points) * kStride);
  Rng rng(seed);
  for (int p = 0; p < points; ++p) {
    for (int k = 0; k < 4; ++k) rows[static_cast<size_t>(p) * kStride + k] = 0.01f * rng.Uniform();
    rows[static_cast<size_t>(p) * kStride] += static_cast<float>(p % clusters);
  }
  return rows;
}

TEST(Quantiser, FindsHeapsThatAreFarApart) {
  const int points = 300, clusters = 8;
  const auto rows = Heaps(points, clusters, 1);
  const std::vector<float> weight(points, 1.0f);
  std::vector<float> codes(clusters * kStride);
  std::vector<int32_t> index(points);
  ThreadPool pool(2);
  Rng rng(2);
  KMeans({rows.data(), static_cast<size_t>(points), kStride}, weight, clusters, 10, &rng, pool,
         codes.data(), index);
  for (int p = 0; p < points; ++p) EXPECT_EQ(index[p], index[p % clusters]);
  EXPECT_EQ(std::set<int32_t>(index.begin(), index.end()).size(), static_cast<size_t>(clusters));
  EXPECT_NEAR(UsagePerplexity(index, weight, clusters), clusters, 0.05);
}

TEST(Quantiser, IsTheSameForAnyNumberOfThreads) {
  const int points = 1000;
  const auto rows = Heaps(points, 100, 3);
  std::vector<float> weight(points);
  for (int p = 0; p < points; ++p) weight[p] = static_cast<float>(p % 5);
  std::vector<std::vector<float>> codes;
  for (const int threads : {1, 2, 3}) {
    ThreadPool pool(threads);
    Rng rng(4);
    codes.emplace_back(32 * kStride);
    std::vector<int32_t> index(points);
    KMeans({rows.data(), static_cast<size_t>(points), kStride}, weight, 32, 5, &rng, pool,
           codes.back().data(), index);
  }
  EXPECT_EQ(codes[0], codes[1]);
  EXPECT_EQ(codes[0], codes[2]);
}

TEST(Quantiser, PointsWithoutWeightDecideNothing) {
  auto rows = Heaps(100, 4, 5);
  std::vector<float> weight(100, 1.0f);
  rows[50 * kStride] = 1e6f;
  weight[50] = 0;
  std::vector<float> codes(4 * kStride);
  std::vector<int32_t> index(100);
  ThreadPool pool(1);
  Rng rng(6);
  KMeans({rows.data(), 100, kStride}, weight, 4, 10, &rng, pool, codes.data(), index);
  for (const float c : codes) EXPECT_LT(c, 100.0f);
  EXPECT_EQ(index[50], 0);
}

TEST(Quantiser, MoreCodesThanPointsLeavesNoneNonFinite) {
  const auto rows = Heaps(5, 5, 7);
  const std::vector<float> weight(5, 1.0f);
  std::vector<float> codes(16 * kStride);
  std::vector<int32_t> index(5);
  ThreadPool pool(1);
  Rng rng(8);
  KMeans({rows.data(), 5, kStride}, weight, 16, 5, &rng, pool, codes.data(), index);
  for (int p = 0; p < 5; ++p) {
    for (int k = 0; k < kStride; ++k)
      EXPECT_NEAR(codes[static_cast<size_t>(index[p]) * kStride + k],
                  rows[static_cast<size_t>(p) * kStride + k], 1e-6f);
  }
  for (const float c : codes) EXPECT_TRUE(std::isfinite(c));
}

}  // namespace
}  // namespace patina::brdf
