// The codebook: k-means over the features of the corners, and how well it is used.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/base/rng.h"
#include "pipeline/base/thread_pool.h"

namespace patina::brdf {

// Points and codes are rows of `stride` floats, a multiple of 16; padding must be zero.
struct FeatureRows {
  const float* data = nullptr;
  size_t count = 0;
  int stride = 16;
};

// index[p] is the code of point p: the nearest, the lowest of equals, 0 for points without weight.
// Weighted k-means (Lloyd) from a weighted draw of points (k-means++). Empty codes move to the
// point that costs most. codes: `count` rows, overwritten. The same result for any number of
// threads.
void KMeans(const FeatureRows& points, std::span<const float> weight, int count, int rounds,
            Rng* rng, ThreadPool& pool, float* codes, std::span<int32_t> index);

// 2^entropy of the share of the weight that each code has: how many codes are really in use.
double UsagePerplexity(std::span<const int32_t> index, std::span<const float> weight, int codes);

}  // namespace patina::brdf
