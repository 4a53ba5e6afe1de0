// The filtered reference on texel centres: what the trainer learns and what quality is measured against.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/base/aligned_buffer.h"

namespace patina {

// What is beyond the edge of a texture. Values reach the manifest as "wrap" and "clamp".
enum class AddressMode { kWrap, kClamp };

// How a learned ("coded") value relates to the physical one. Names reach the manifest.
enum class Encoding {
  kLinear,    // coded = value / scale: data maps, and colour that came linear (float files)
  kSrgb,      // coded = sRGB transfer curve of the working space's linear values
  kNormalXy,  // coded = 0.5 + 0.5 * x of a unit tangent-space normal, OpenGL (Y up); z = sqrt(1 - x^2 - y^2)
  kSignedLog  // coded = sign(x) log2(1 + |x| / scale): colour of large range
};
const char* EncodingName(Encoding encoding);  // "linear", "srgb", "normal_xy", "signed_log"

// One output channel of a material, in manifest order.
struct TargetChannel {
  std::string map;         // role: "albedo", "normal", "ao", "roughness", "metalness", "displacement", "emissive", ...
  std::string component;   // "r", "g", "b", "x", "y", or "" for a map of one channel
  Encoding encoding = Encoding::kLinear;
  bool constant = false;   // every texel of mip 0 has constant_value, within the tolerance: not learned
  float constant_value = 0;  // coded
  // A power of two. kLinear: brings coded values near [-1, 1], where half weights hold them. kSignedLog: see there. Else 1.
  float scale = 1;
  float min_value = 0;     // range of mip 0, coded; decoders clamp to it
  float max_value = 1;
  int learned_index = -1;  // channel of the TargetPyramid, or -1 when constant; equal channels have the same
};

// What an error of the channel's coded values is measured against: 1, but for logarithms the largest magnitude they reach.
float CodedPeak(const TargetChannel& channel);

// One mip level, all learned channels, coded values as float.
// Layout: data[((y * row_blocks + xb) * channels + c) * 16 + lane] is channel c of texel (16*xb + lane, y).
// Columns from `width` on repeat the texture (wrap) or its last column (clamp), up to 16*row_blocks: row_blocks is
// ceil(width/16) + kPadBlocks, so that a 64-wide window with its filter taps starting at any column below `width` can be
// read without a wrap test.
struct TargetLevel {
  static constexpr int kPadBlocks = 6;
  int width = 0;
  int height = 0;
  int channels = 0;
  int row_blocks = 0;
  AlignedBuffer<float> data;

  const float* Block(int xb, int y) const {
    return data.data() + (static_cast<size_t>(y) * row_blocks + xb) * channels * 16;
  }
  float At(int x, int y, int c) const { return Block(x >> 4, y)[c * 16 + (x & 15)]; }
  // Sizes the buffer. Padding is undefined until FillPadding.
  void Allocate(int level_width, int level_height, int level_channels);
  void Set(int x, int y, int c, float value) {
    data.data()[((static_cast<size_t>(y) * row_blocks + (x >> 4)) * channels + c) * 16 + (x & 15)] = value;
  }
  void FillPadding(AddressMode address);
};

// Levels `first_mip` of the source to the last one that is wanted, usually 0 to the 1x1 level; each side is
// max(1, floor(previous / 2)).
struct TargetPyramid {
  int channels = 0;  // learned channels only, equal ones once
  int first_mip = 0;
  AddressMode address = AddressMode::kWrap;
  std::vector<TargetLevel> levels;
};

// A material as the trainer, the verifier and the manifest see it.
struct MaterialReference {
  std::vector<TargetChannel> channels;  // all, constants included, maps contiguous
  TargetPyramid pyramid;
};

}  // namespace patina
