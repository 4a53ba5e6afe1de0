#include "pipeline/material/channel_stats.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace patina {
namespace {

// Eigenvectors of a symmetric matrix by cyclic Jacobi rotations; columns of `vectors`. Fine for 64 x 64.
void SymmetricEigen(int n, std::vector<double>* matrix, std::vector<double>* vectors) {
  auto& a = *matrix;
  auto& v = *vectors;
  v.assign(static_cast<size_t>(n) * n, 0.0);
  for (int i = 0; i < n; ++i) v[i * n + i] = 1;
  for (int sweep = 0; sweep < 60; ++sweep) {
    double off = 0, diagonal = 0;
    for (int i = 0; i < n; ++i) {
      diagonal += a[i * n + i] * a[i * n + i];
      for (int j = i + 1; j < n; ++j) off += a[i * n + j] * a[i * n + j];
    }
    if (off <= 1e-26 * diagonal) return;
    for (int p = 0; p < n; ++p) {
      for (int q = p + 1; q < n; ++q) {
        const double apq = a[p * n + q];
        if (apq == 0) continue;
        const double theta = (a[q * n + q] - a[p * n + p]) / (2 * apq);
        const double t = (theta >= 0 ? 1 : -1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (int k = 0; k < n; ++k) {
          const double akp = a[k * n + p], akq = a[k * n + q];
          a[k * n + p] = c * akp - s * akq;
          a[k * n + q] = s * akp + c * akq;
        }
        for (int k = 0; k < n; ++k) {
          const double apk = a[p * n + k], aqk = a[q * n + k];
          a[p * n + k] = c * apk - s * aqk;
          a[q * n + k] = s * apk + c * aqk;
        }
        for (int k = 0; k < n; ++k) {
          const double vkp = v[k * n + p], vkq = v[k * n + q];
          v[k * n + p] = c * vkp - s * vkq;
          v[k * n + q] = s * vkp + c * vkq;
        }
      }
    }
  }
}

}  // namespace

std::vector<float> ChannelWeights(const MaterialReference& reference) {
  std::vector<float> weight(reference.pyramid.channels, 0.0f);
  for (const TargetChannel& channel : reference.channels) {
    if (channel.learned_index < 0) continue;
    const float range = std::max(1.0f, channel.max_value - channel.min_value);
    weight[channel.learned_index] += 1.0f / (range * range);
  }
  return weight;
}

ChannelStats MeasureChannels(const MaterialReference& reference, int mip, ThreadPool& pool) {
  const TargetLevel& level = reference.pyramid.levels[mip];
  const int n = level.channels;
  ChannelStats stats;
  stats.weight = ChannelWeights(reference);

  // Row sums in double, added in row order: the same for any number of threads.
  std::vector<double> row_sums(static_cast<size_t>(level.height) * n);
  pool.ParallelFor(level.height, [&](int y, int) {
    for (int c = 0; c < n; ++c) {
      double sum = 0;
      for (int x = 0; x < level.width; ++x) sum += level.At(x, y, c);
      row_sums[static_cast<size_t>(y) * n + c] = sum;
    }
  });
  const double count = static_cast<double>(level.width) * level.height;
  std::vector<double> mean(n);
  for (int y = 0; y < level.height; ++y) {
    for (int c = 0; c < n; ++c) mean[c] += row_sums[static_cast<size_t>(y) * n + c];
  }
  for (int c = 0; c < n; ++c) mean[c] /= count;

  constexpr int kBands = 64;
  std::vector<std::vector<double>> bands(kBands, std::vector<double>(static_cast<size_t>(n) * n));
  pool.ParallelFor(kBands, [&](int band, int) {
    auto& sum = bands[band];
    std::vector<double> d(n);
    for (int y = band; y < level.height; y += kBands) {
      for (int x = 0; x < level.width; ++x) {
        for (int c = 0; c < n; ++c) d[c] = level.At(x, y, c) - mean[c];
        for (int i = 0; i < n; ++i) {
          for (int j = i; j < n; ++j) sum[i * n + j] += d[i] * d[j];
        }
      }
    }
  });
  std::vector<double> covariance(static_cast<size_t>(n) * n);
  for (const auto& band : bands) {
    for (size_t k = 0; k < covariance.size(); ++k) covariance[k] += band[k];
  }
  stats.deviation.resize(n);
  stats.mean.assign(mean.begin(), mean.end());
  for (int i = 0; i < n; ++i) {
    for (int j = i; j < n; ++j) covariance[j * n + i] = covariance[i * n + j] /= count;
    stats.deviation[i] = static_cast<float>(std::sqrt(std::max(0.0, covariance[i * n + i])));
  }
  std::vector<double> scaled(covariance), vectors;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) scaled[i * n + j] *= std::sqrt(static_cast<double>(stats.weight[i]) * stats.weight[j]);
  }
  SymmetricEigen(n, &scaled, &vectors);
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return scaled[a * n + a] > scaled[b * n + b]; });
  for (const int k : order) {
    std::vector<float> component(n);
    for (int c = 0; c < n; ++c) component[c] = static_cast<float>(vectors[c * n + k] / std::sqrt(double{stats.weight[c]}));
    stats.component.push_back(std::move(component));
    stats.sigma.push_back(static_cast<float>(std::sqrt(std::max(0.0, scaled[k * n + k]))));
  }
  return stats;
}

float ProjectChannel(const ChannelStats& stats, int k, const TargetLevel& level, int x, int y) {
  if (!(stats.sigma[k] > 1e-7f)) return 0;
  float dot = 0;
  for (int c = 0; c < level.channels; ++c) {
    dot += stats.component[k][c] * stats.weight[c] * (level.At(x, y, c) - stats.mean[c]);
  }
  return dot / stats.sigma[k];
}

}  // namespace patina
