// The unit of training work: a lattice of up to 64 x 64 samples at one (fractional) level of detail.
//
// Samples of a window lie one texel of mip `mip` apart, with a common phase. Every feature level then has at most one
// texel a sample, and interpolation along x is a load or a lane permute instead of a gather. A plan holds all index and
// weight tables of a window; the SIMD kernels (window_kernels.h) only read it.
#pragma once

#include <cstdint>

#include "pipeline/material/feature_store.h"
#include "pipeline/material/target_pyramid.h"
#include "pipeline/material/train.h"

namespace patina {

inline constexpr int kWindowSide = 64;
inline constexpr int kMaxExtent = kWindowSide + 3;         // texels of a level that a window can touch along an axis
inline constexpr int kMaxAxisBlocks = kMaxExtent + 3;        // a level one texel wide repeats its block for every texel

// Linear interpolation along one axis of one feature level: sample k is
// texel[first + index[k]] * (1 - weight[k]) + texel[first + index[k] + 1] * weight[k], texels unwrapped.
struct AxisTaps {
  int first = 0;
  int extent = 0;          // texels touched: index + 1 < extent
  bool identity = false;   // sample k is texel first + k exactly
  bool contiguous = false; // index[k] == k
  alignas(64) int32_t index[kWindowSide];
  alignas(64) float weight[kWindowSide];

  // Blocks of the level whose parameters this window may update: at least half of their texels along the axis are owned,
  // i.e. have their centre inside the window. start is the unwrapped coordinate of the block's first texel.
  struct BlockSpan {
    int16_t block;
    int16_t count;  // texels of the block inside the level: 1..4
    int32_t start;
  };
  int span_count = 0;
  BlockSpan spans[kMaxAxisBlocks];

  // Blocks to decode, left to right, covering first .. first + extent - 1 (under clamp: its part inside the level).
  int decode_count = 0;
  BlockSpan decode[kMaxAxisBlocks];

  bool fold = false;       // gradients are folded to the level's own range before the update (see canonical_*)
  int canonical_first = 0; // unwrapped range after folding
  int canonical_extent = 0;
};

// One level of one texture as a window sees it.
struct LevelTaps {
  FeatureLevel* level = nullptr;
  int texture = 0;      // inputs 3*texture .. 3*texture + 2
  float weight = 1;     // of this level in the trilinear blend
  AxisTaps x, y;
};

// Catmull-Rom taps of a window in one mip of the target, along one axis: sample k reads texels
// first + index[k] .. +3 with weight[0..3][k].
struct FilterTaps {
  int first = 0;
  int extent = 0;
  alignas(64) int32_t index[kWindowSide];
  alignas(64) float weight[4][kWindowSide];
};

struct WindowPlan {
  int cols = 0;  // samples along x: a multiple of 16
  int rows = 0;
  int mip = 0;
  AddressMode address = AddressMode::kWrap;
  int level_count = 0;
  LevelTaps levels[2 * kFeatureTextures];

  // Texel centres of one mip need no filter: the target's own blocks are read.
  bool on_grid = true;
  const TargetLevel* target = nullptr;
  int target_block = 0;  // first block of 16 columns
  int target_row = 0;    // first row, below height; rows wrap or clamp
  // Otherwise: bicubic in `target` and in the next mip, blended by filter_weight.
  const TargetLevel* target_next = nullptr;
  float filter_weight[2] = {1, 0};
  FilterTaps filter_x[2], filter_y[2];
};

// Where a window is. x0 is a multiple of 16 below the mip's width rounded up to 16; y0 < height.
struct WindowSpec {
  int mip = 0;
  int x0 = 0;
  int y0 = 0;
  int rows = kWindowSide;
  int cols = kWindowSide;
  float phase_x = 0;   // texels of the mip, [0, 1)
  float phase_y = 0;
  float fraction = 0;  // s = mip + fraction; 0 with phases 0 means texel centres
};

// The largest useful window of a mip: at most 64 x 64, whole vectors along x.
int WindowCols(int width);
int WindowRows(int height);

// Fills the plan. store may be null for a plan without features (target only).
void PlanWindow(const TargetPyramid& target, const ModelShape& shape, FeatureStore* store, const WindowSpec& spec,
                WindowPlan* plan);

// Whether two windows touch (read or write) a common feature block. Conservative.
bool WindowsConflict(const WindowPlan& a, const WindowPlan& b);

}  // namespace patina
