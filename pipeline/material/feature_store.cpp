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

void FeatureSnapshot::Save(const FeatureStore& store, ThreadPool& pool) {
  constexpr size_t kPiece = size_t{1} << 16;
  size_t next = 0;
  for (const auto& texture : store.textures) {
    for (const FeatureLevel& level : texture) {
      if (next == params_.size()) params_.emplace_back(level.params.size());
      float* to = params_[next++].data();
      const float* from = level.params.data();
      const size_t count = level.params.size();
      pool.ParallelFor(static_cast<int>((count + kPiece - 1) / kPiece), [&](int piece, int) {
        const size_t first = static_cast<size_t>(piece) * kPiece;
        std::memcpy(to + first, from + first, std::min(kPiece, count - first) * sizeof(float));
      });
    }
  }
}

void FeatureSnapshot::Restore(FeatureStore* store) const {
  size_t next = 0;
  for (auto& texture : store->textures) {
    for (FeatureLevel& level : texture) {
      const AlignedBuffer<float>& from = params_[next++];
      std::memcpy(level.params.data(), from.data(), from.size() * sizeof(float));
    }
  }
  store->ResetMoments();
}

}  // namespace patina
