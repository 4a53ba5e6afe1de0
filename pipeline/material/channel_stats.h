// Second-order statistics of the learned channels, and their principal components.
#pragma once

#include <vector>

#include "pipeline/base/thread_pool.h"
#include "pipeline/material/target_pyramid.h"

namespace patina {

struct ChannelStats {
  std::vector<float> mean;       // [channels], of the given mip, coded
  std::vector<float> deviation;  // [channels], > 0
  // Principal components by falling variance: component[k][channel] is a unit vector in weighted channel space divided by
  // nothing: value ~ mean + sum_k z_k * sigma[k] * component[k], with z_k of unit variance.
  std::vector<std::vector<float>> component;
  std::vector<float> sigma;      // [channels], falling, >= 0
  std::vector<float> weight;     // [channels] of the squared error, see ChannelWeights
};

// Weight of each channel's squared error: 1 for channels whose range is at most 1, else 1 / range^2, so that an HDR channel
// does not drown the others. An output that stands for several equal channels has the sum of their weights.
std::vector<float> ChannelWeights(const MaterialReference& reference);

// Statistics of one mip. Deterministic for any thread count.
ChannelStats MeasureChannels(const MaterialReference& reference, int mip, ThreadPool& pool);

// z_k of one texel: component[k] . (weight * (value - mean)) / sigma[k]; 0 where sigma is 0.
float ProjectChannel(const ChannelStats& stats, int k, const TargetLevel& level, int x, int y);

}  // namespace patina
