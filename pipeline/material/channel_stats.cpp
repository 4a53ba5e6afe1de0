#include "pipeline/material/channel_stats.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pipeline/base/symmetric_eigen.h"

namespace patina {

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
  std::vector<double> scaled(covariance);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) scaled[i * n + j] *= std::sqrt(static_cast<double>(stats.weight[i]) * stats.weight[j]);
  }
  const SymmetricEigen eigen = EigenOf(n, std::move(scaled));
  for (int k = 0; k < n; ++k) {
    std::vector<float> component(n);
    for (int c = 0; c < n; ++c) component[c] = static_cast<float>(eigen.vectors[k * n + c] / std::sqrt(double{stats.weight[c]}));
    stats.component.push_back(std::move(component));
    stats.sigma.push_back(static_cast<float>(std::sqrt(std::max(0.0, eigen.values[k]))));
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
