#include "pipeline/material/feature_init.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "pipeline/bc6/block_encoder.h"

namespace patina {
namespace {

constexpr float kSpread = 0.25f;   // features are 1 + kSpread * z
constexpr float kMaxZ = 3.5f;      // keeps them positive
constexpr float kShift = 4.0f;     // hidden pre-activations are z + kShift: positive for every z >= -kMaxZ
constexpr int kFirstFreeHidden = kNetworkInputs;

// Which component input i of the network carries, or -1.
int ComponentOfInput(int input, int components) {
  const int k = input < 9 ? input : input - 9;
  return k < components ? k : -1;
}

void StoreSoftBlock(const bc6::SoftBlock& soft, int block, FeatureLevel* level) {
  float* params = level->params.data() + static_cast<size_t>(block) * BlockStride(BlockForm::kSegments);
  for (int e = 0; e < 4; ++e) {
    for (int c = 0; c < 3; ++c) params[e * 3 + c] = std::clamp(soft.endpoint[e][c], kMinBinade, kMaxBinade);
  }
  std::memcpy(params + 16, soft.index, sizeof soft.index);
  level->partition[block] = static_cast<uint8_t>(soft.partition);
}

}  // namespace

void InitFeaturesFromComponents(const MaterialReference& reference, const ModelShape& shape, const ChannelStats& stats,
                                ThreadPool& pool, FeatureStore* store) {
  const int components = static_cast<int>(stats.component.size());
  const int mips = static_cast<int>(reference.pyramid.levels.size());
  for (int t = 0; t < kFeatureTextures; ++t) {
    for (int l = 0; l < shape[t].levels; ++l) {
      FeatureLevel* level = &store->textures[t][l];
      const TargetLevel& mip = reference.pyramid.levels[std::min(shape[t].lod_shift + l, mips - 1)];
      pool.ParallelFor(level->blocks_y, [&, t](int by, int) {
        for (int bx = 0; bx < level->blocks_x; ++bx) {
          float texels[3][16];
          for (int k = 0; k < 16; ++k) {
            const int x = std::min({4 * bx + (k & 3), level->width - 1, mip.width - 1});
            const int y = std::min({4 * by + (k >> 2), level->height - 1, mip.height - 1});
            for (int c = 0; c < 3; ++c) {
              const int component = ComponentOfInput(3 * t + c, components);
              const float z = component < 0 ? 0.0f : ProjectChannel(stats, component, mip, x, y);
              texels[c][k] = 1.0f + kSpread * std::clamp(z, -kMaxZ, kMaxZ);
            }
          }
          StoreSoftBlock(bc6::FitTexels(texels), by * level->blocks_x + bx, level);
        }
      });
    }
  }
}

void InitNetworkFromComponents(const ChannelStats& stats, std::span<const float> scale, Rng* rng, Network* network) {
  const int outputs = network->outputs();
  const int components = static_cast<int>(stats.component.size());
  float* p = network->normalised();
  std::fill(p, p + network->parameter_count(), 0.0f);
  for (int j = 0; j < kNetworkInputs; ++j) {
    p[mlp::kW1 + j * kNetworkInputs + j] = 1 / kSpread;
    p[mlp::kB1 + j] = kShift - 1 / kSpread;
  }
  for (int j = kFirstFreeHidden; j < kNetworkHidden; ++j) {
    float at_one = 0;
    for (int i = 0; i < kNetworkInputs; ++i) {
      const float w = (rng->Uniform() - 0.5f) / kSpread;
      p[mlp::kW1 + j * kNetworkInputs + i] = w;
      at_one += w;
    }
    p[mlp::kB1 + j] = rng->Uniform() - 0.5f - at_one;
  }
  for (int c = 0; c < outputs; ++c) {
    float bias = 0;
    for (int j = 0; j < std::min(9, components); ++j) {
      const float w = stats.component[j][c] * stats.sigma[j] / scale[c];
      p[mlp::kW2 + c * kNetworkHidden + j] = w;
      bias -= kShift * w;
    }
    p[mlp::OffsetB2(outputs) + c] = bias;
  }
  network->Unfold();
}

void InitFeaturesAtRandom(Rng* rng, FeatureStore* store) {
  for (auto& texture : store->textures) {
    for (FeatureLevel& level : texture) {
      for (size_t k = 0; k < level.params.size(); ++k) level.params[k] = rng->Uniform();
    }
  }
}

void InitNetworkAtRandom(Rng* rng, Network* network) {
  const int outputs = network->outputs();
  float* p = network->normalised();
  const auto fill = [&](int from, int count, int inputs) {
    const float bound = 1 / std::sqrt(static_cast<float>(inputs));
    for (int k = from; k < from + count; ++k) p[k] = (2 * rng->Uniform() - 1) * bound;
  };
  fill(mlp::kW1, kNetworkHidden * kNetworkInputs + kNetworkHidden, kNetworkInputs);
  fill(mlp::kW2, outputs * kNetworkHidden + outputs, kNetworkHidden);
  network->Unfold();
}

void InitBlocksFromFreeTexels(const FeatureStore& free_store, ThreadPool& pool, FeatureStore* store) {
  for (int t = 0; t < kFeatureTextures; ++t) {
    for (size_t l = 0; l < store->textures[t].size(); ++l) {
      const FeatureLevel& from = free_store.textures[t][l];
      FeatureLevel* to = &store->textures[t][l];
      pool.ParallelFor(to->blocks_y, [&](int by, int) {
        for (int bx = 0; bx < to->blocks_x; ++bx) {
          const int block = by * to->blocks_x + bx;
          float texels[3][16];
          const float* params = from.params.data() + static_cast<size_t>(block) * BlockStride(BlockForm::kFree);
          for (int k = 0; k < 16; ++k) {
            // Texels outside the level were never trained: repeat the last one inside.
            const int x = std::min(k & 3, to->width - 1 - 4 * bx), y = std::min(k >> 2, to->height - 1 - 4 * by);
            for (int c = 0; c < 3; ++c) texels[c][k] = params[c * 16 + y * 4 + x];
          }
          StoreSoftBlock(bc6::FitTexels(texels), block, to);
        }
      });
    }
  }
}

}  // namespace patina
