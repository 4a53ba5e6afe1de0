#include "pipeline/material/feature_store.h"

#include <algorithm>
#include <cstring>

namespace patina {

void FeatureStore::Allocate(const ModelShape& shape, BlockForm block_form, StoreUse use) {
  form = block_form;
  const size_t stride = BlockStride(form);
  for (int t = 0; t < kFeatureTextures; ++t) {
    textures[t].clear();
    textures[t].resize(shape[t].levels);
    for (int l = 0; l < shape[t].levels; ++l) {
      FeatureLevel& level = textures[t][l];
      level.width = std::max(1, shape[t].width >> l);
      level.height = std::max(1, shape[t].height >> l);
      level.blocks_x = (level.width + 3) / 4;
      level.blocks_y = (level.height + 3) / 4;
      const size_t blocks = level.block_count();
      level.params.Reset(blocks * stride);
      level.moments.Reset(use == StoreUse::kFixed ? 0 : blocks * stride * 2);
      level.updates.Reset(use == StoreUse::kFixed ? 0 : blocks);
      level.partition.Reset(blocks);
      level.gradient.Reset(use == StoreUse::kAccumulate ? blocks * stride : 0);
    }
  }
}

void FeatureStore::ResetMoments() {
  for (auto& texture : textures) {
    for (FeatureLevel& level : texture) {
      std::memset(level.moments.data(), 0, level.moments.size() * sizeof(float));
      std::memset(level.updates.data(), 0, level.updates.size() * sizeof(uint16_t));
    }
  }
}

}  // namespace patina
