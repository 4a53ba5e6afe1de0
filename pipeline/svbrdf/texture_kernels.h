// The blocks of a neural texture in SIMD: from parameters to rows of texels, and from gradients of
// rows to an Adam step of the blocks. The arithmetic is that of
// pipeline/material/block_kernels.inl.
#pragma once

#include <cstdint>

#include "pipeline/kernels/dispatch.h"
#include "pipeline/material/feature_store.h"
#include "pipeline/material/window_kernels.h"

namespace patina::svbrdf {

// Floats of a row: the features of one texel, three of each texture.
inline constexpr int kRowFloats = 16;

// The texels of one level as rows [height][width][kRowFloats]; a texture has columns `column` to
// column + 2 of each row.
struct LevelRows {
  float* values = nullptr;
  float* gradient = nullptr;  // for update_blocks
  int width = 0;
  int height = 0;
  int column = 0;
};

struct TextureKernels {
  // Writes the texels of blocks first .. first + count - 1 into the rows.
  void (*decode_blocks)(const FeatureLevel& level, BlockForm form, int first, int count,
                        const LevelRows& rows) noexcept;
  // One Adam step of each of `count` different blocks with the gradient of its texels, which is
  // cleared; then as decode_blocks. False if a parameter or moment is not finite afterwards. Calls
  // for other blocks or textures may run at the same time.
  bool (*update_blocks)(FeatureLevel* level, BlockForm form, const int32_t* blocks, int count,
                        const AdamRates& rates, const LevelRows& rows) noexcept;
};

const TextureKernels& TextureKernelsFor(SimdTarget target);

}  // namespace patina::svbrdf
