#include "pipeline/material/target_pyramid.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace patina {

const char* EncodingName(Encoding encoding) {
  switch (encoding) {
    case Encoding::kLinear: return "linear";
    case Encoding::kSrgb: return "srgb";
    case Encoding::kNormalXy: return "normal_xy";
    case Encoding::kSignedLog: return "signed_log";
  }
  return "linear";
}

float CodedPeak(const TargetChannel& channel) {
  if (channel.encoding != Encoding::kSignedLog) return 1.0f;
  return std::max({1.0f, std::abs(channel.min_value), std::abs(channel.max_value)});
}

void TargetLevel::Allocate(int level_width, int level_height, int level_channels) {
  width = level_width;
  height = level_height;
  channels = level_channels;
  row_blocks = (width + 15) / 16 + kPadBlocks;
  data.Reset(static_cast<size_t>(height) * row_blocks * channels * 16);
}

void TargetLevel::FillPadding(AddressMode address) {
  for (int y = 0; y < height; ++y) {
    for (int x = width; x < row_blocks * 16; ++x) {
      const int from = address == AddressMode::kWrap ? x % width : width - 1;
      for (int c = 0; c < channels; ++c) Set(x, y, c, At(from, y, c));
    }
  }
}

}  // namespace patina
