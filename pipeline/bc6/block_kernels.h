// What block_encoder.cpp shares with the code that is compiled once for each SIMD target.
#pragma once

#include <cstdint>

#include "pipeline/bc6/block_encoder.h"

namespace patina::bc6 {

// The limits of a mode as the searches use them; whole numbers in floats.
struct ModeLimits {
  float max_code;       // 2^bits - 1
  float offset;         // code q stands for (q + offset) * step binades
  float step;           // binades between two codes
  float inverse_step;   // codes in a binade
  float wide_step;      // 2^(16 - bits) / 64: a code's step on the decoder's scale, over 64
  bool transformed;     // endpoints 1..3 are within [-half_range, half_range - 1] of endpoint 0
  float half_range[3];  // codes, per channel
};

// The modes of one index width, a mode a lane: two-region modes 0..9 in lanes 0..9, or one-region
// modes 10..13 in lanes 0..3. The other lanes repeat the last mode and are never chosen.
struct ModeLanes {
  alignas(64) float step[16];          // binades between two codes
  alignas(64) float inverse_step[16];  // codes in a binade
  alignas(64) float offset[16];        // code q stands for (q + offset) * step binades
  alignas(64) float max_code[16];
  alignas(64) float half_range[3][16];  // codes; 2^20 where the mode is not transformed
  int first_mode;
  int count;
};

struct BlockTables {
  // [partition / 16][texel][partition % 16]: 1 in region 1, else 0
  alignas(64) float member[2][16][16];
  // Index weights over 64, by lane: the 3-bit ones twice; the 4-bit ones
  alignas(64) float weight[2][16];
  uint16_t mask[bc6h::kPartitionCount];
  ModeLimits mode[bc6h::kModeCount];
  ModeLanes lanes[2];  // two regions, one region
};

const BlockTables& Tables();

struct SearchResult {
  bc6h::BlockFields fields;  // legal, anchors fixed
  int soft_partition = 0;    // the best two-region partition, also when the fields have one region
  float error = 0;
};

struct BlockKernels {
  void (*fit_texels)(const float texels[3][16], SoftBlock* block) noexcept;
  void (*encode)(const WeightedTarget& target, const SoftBlock& current, Effort effort,
                 SearchResult* result) noexcept;
  void (*refine)(const WeightedTarget& target, const bc6h::BlockFields& current,
                 SearchResult* result) noexcept;
};

extern const BlockKernels kBlockKernelsAvx2;
extern const BlockKernels kBlockKernelsAvx512;

}  // namespace patina::bc6
