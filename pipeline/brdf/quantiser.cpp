#include "pipeline/brdf/quantiser.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace patina::brdf {
namespace {

constexpr int kPointsPerTask = 256;

float SquaredDistance(const float* a, const float* b, int stride) {
  float part[16] = {};
  for (int k = 0; k < stride; k += 16) {
    for (int l = 0; l < 16; ++l) {
      const float d = a[k + l] - b[k + l];
      part[l] += d * d;
    }
  }
  for (int width = 8; width > 0; width /= 2) {
    for (int l = 0; l < width; ++l) part[l] += part[l + width];
  }
  return part[0];
}

void NearestCodes(const FeatureRows& points, std::span<const float> weight,
                  const FeatureRows& codes, ThreadPool& pool, std::span<int32_t> index,
                  std::span<float> distance) {
  const int tasks = static_cast<int>((points.count + kPointsPerTask - 1) / kPointsPerTask);
  pool.ParallelFor(tasks, [&](int task, int) {
    const size_t end = std::min(points.count, static_cast<size_t>(task + 1) * kPointsPerTask);
    for (size_t p = static_cast<size_t>(task) * kPointsPerTask; p < end; ++p) {
      int32_t best = 0;
      float least = std::numeric_limits<float>::infinity();
      if (weight[p] > 0) {
        for (size_t c = 0; c < codes.count; ++c) {
          const float d = SquaredDistance(points.data + p * points.stride,
                                          codes.data + c * points.stride, points.stride);
          if (d < least) {
            least = d;
            best = static_cast<int32_t>(c);
          }
        }
      } else {
        least = 0;
      }
      index[p] = best;
      distance[p] = least;
    }
  });
}

// k-means++: each further code is drawn with the odds of its weighted squared distance to those
// drawn before.
void DrawCodes(const FeatureRows& points, std::span<const float> weight, int count, Rng* rng,
               float* codes) {
  std::vector<double> odds(points.count);
  std::vector<float> distance(points.count, std::numeric_limits<float>::infinity());
  for (size_t p = 0; p < points.count; ++p) odds[p] = static_cast<double>(weight[p]);
  for (int c = 0; c < count; ++c) {
    double total = 0;
    for (const double o : odds) total += o;
    double pick = static_cast<double>(rng->Uniform()) * total;
    size_t chosen = 0;
    for (size_t p = 0; p < points.count; ++p) {
      if (odds[p] <= 0) continue;
      chosen = p;
      pick -= odds[p];
      if (pick < 0) break;
    }
    float* code = codes + static_cast<size_t>(c) * points.stride;
    std::copy_n(points.data + chosen * points.stride, points.stride, code);
    for (size_t p = 0; p < points.count; ++p) {
      if (!(weight[p] > 0)) continue;
      distance[p] = std::min(distance[p],
                             SquaredDistance(points.data + p * points.stride, code, points.stride));
      odds[p] = static_cast<double>(weight[p]) * static_cast<double>(distance[p]);
    }
  }
}

}  // namespace

void KMeans(const FeatureRows& points, std::span<const float> weight, int count, int rounds,
            Rng* rng, ThreadPool& pool, float* codes, std::span<int32_t> index) {
  const int stride = points.stride;
  DrawCodes(points, weight, count, rng, codes);
  std::vector<float> distance(points.count);
  std::vector<double> sum(static_cast<size_t>(count) * stride), mass(count);
  for (int round = 0; round < rounds; ++round) {
    NearestCodes(points, weight, {codes, static_cast<size_t>(count), stride}, pool, index,
                 distance);
    std::fill(sum.begin(), sum.end(), 0.0);
    std::fill(mass.begin(), mass.end(), 0.0);
    for (size_t p = 0; p < points.count; ++p) {
      if (!(weight[p] > 0)) continue;
      mass[index[p]] += static_cast<double>(weight[p]);
      for (int k = 0; k < stride; ++k) {
        sum[static_cast<size_t>(index[p]) * stride + k] +=
            static_cast<double>(weight[p]) * static_cast<double>(points.data[p * stride + k]);
      }
    }
    for (int c = 0; c < count; ++c) {
      float* code = codes + static_cast<size_t>(c) * stride;
      if (mass[c] > 0) {
        for (int k = 0; k < stride; ++k)
          code[k] = static_cast<float>(sum[static_cast<size_t>(c) * stride + k] / mass[c]);
        continue;
      }
      size_t worst = 0;
      double cost = -1;
      for (size_t p = 0; p < points.count; ++p) {
        const double own = static_cast<double>(weight[p]) * static_cast<double>(distance[p]);
        if (own > cost) {
          cost = own;
          worst = p;
        }
      }
      std::copy_n(points.data + worst * stride, stride, code);
      distance[worst] = 0;
    }
  }
  NearestCodes(points, weight, {codes, static_cast<size_t>(count), stride}, pool, index, distance);
}

double UsagePerplexity(std::span<const int32_t> index, std::span<const float> weight, int codes) {
  std::vector<double> mass(codes);
  double total = 0;
  for (size_t p = 0; p < index.size(); ++p) {
    mass[index[p]] += static_cast<double>(weight[p]);
    total += static_cast<double>(weight[p]);
  }
  double entropy = 0;
  for (const double m : mass) {
    if (m > 0) entropy -= m / total * std::log2(m / total);
  }
  return std::exp2(entropy);
}

}  // namespace patina::brdf
