// The trainable feature pyramids: BC6H-shaped blocks, or free texels while a recipe trains without the block constraint.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "pipeline/base/aligned_buffer.h"
#include "pipeline/material/train.h"

namespace patina {

// How the texels of a block follow from its parameters.
enum class BlockForm {
  kSegments,  // 32 floats: endpoints [4][3] in binades (lanes 0..11, 12..15 unused), then 16 indices in [0,1]
  kFree       // 48 floats: linear values [3][16]
};
constexpr int BlockStride(BlockForm form) { return form == BlockForm::kSegments ? 32 : 48; }

// Endpoints stay inside the normal halves, with room for the last code of every mode: values 2^-14 .. about 57000.
inline constexpr float kMinBinade = 1.0f;
inline constexpr float kMaxBinade = 30.75f;

enum class StoreUse {
  kFixed,      // parameters alone
  kAdam,       // with the optimiser's moments
  kAccumulate  // and with gradient buffers, for recipes that sum over windows
};

// One mip level of one texture. Blocks are row-major, ceil(width/4) x ceil(height/4); texels of a block are row-major.
// Texels beyond width or height exist in the parameters and influence nothing.
struct FeatureLevel {
  int width = 0;
  int height = 0;
  int blocks_x = 0;
  int blocks_y = 0;
  AlignedBuffer<float> params;      // [block][BlockStride]
  AlignedBuffer<float> moments;     // [block][2 * BlockStride]: Adam's first, then second moments
  AlignedBuffer<uint16_t> updates;  // [block] how often it was updated, saturating: Adam's bias correction
  AlignedBuffer<uint8_t> partition; // [block] 0..31; unused for kFree
  AlignedBuffer<float> gradient;    // [block][BlockStride] where a recipe sums gradients over windows; else empty

  int block_count() const { return blocks_x * blocks_y; }
};

struct FeatureStore {
  BlockForm form = BlockForm::kSegments;
  std::array<std::vector<FeatureLevel>, kFeatureTextures> textures;

  // Allocates all levels of `shape`, all zero.
  void Allocate(const ModelShape& shape, BlockForm block_form, StoreUse use);
  // Forgets the optimiser's state, keeps the parameters.
  void ResetMoments();
};

// A copy of a store's parameters, for rolling back; partitions are not in it, which no step changes.
class FeatureSnapshot {
 public:
  void Save(const FeatureStore& store, ThreadPool& pool);
  // Into the store that was saved; forgets the optimiser's state.
  void Restore(FeatureStore* store) const;

 private:
  std::vector<AlignedBuffer<float>> params_;  // of the levels in turn
};

}  // namespace patina
