// An image in memory in the sample type of its file, and what can be asked of it without knowing
// the file format.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/base/aligned_buffer.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/color/color_tag.h"

namespace patina {

// How a sample is stored. Integers stand for value / maximum, so in [0, 1].
enum class SampleType { kUint8, kUint16, kHalf, kFloat };
const char* SampleTypeName(SampleType type);  // "uint8", "uint16", "half", "float"
int SampleBytes(SampleType type);
inline bool IsInteger(SampleType type) {
  return type == SampleType::kUint8 || type == SampleType::kUint16;
}

// What the header of an image file says.
struct ImageInfo {
  int width = 0;
  int height = 0;
  int channels = 0;         // of the file; only the first kMaxLoadedChannels are ever loaded
  int loaded_channels = 0;  // how many of them ReadImage gives: 1..kMaxLoadedChannels
  int alpha_channel = -1;   // index of the alpha channel if it is among the loaded ones, or -1
  SampleType type = SampleType::kUint8;
  std::string format;  // "png", "jpeg", "targa", "tiff", "openexr", "hdr", "dds"
  ColorTag color_tag;  // what the file itself says about its colours
  int subimages = 1;   // parts of the file; the first one is read
  uint64_t file_bytes = 0;
  std::vector<std::string> warnings;  // complete sentences without the file's name

  bool has_alpha() const { return alpha_channel >= 0; }
};

inline constexpr int kMaxLoadedChannels = 4;

// Pixels of one file: rows from the top, `info.loaded_channels` interleaved samples of `info.type`,
// no padding. Alpha is as the file has it: colour is not multiplied by it on reading.
struct Image {
  std::string path;
  ImageInfo info;
  AlignedBuffer<uint8_t> bytes;

  int width() const { return info.width; }
  int height() const { return info.height; }
  int channels() const { return info.loaded_channels; }
  size_t row_bytes() const {
    return static_cast<size_t>(info.width) * info.loaded_channels * SampleBytes(info.type);
  }
  // Sizes `bytes` by `info`; all samples zero.
  void Allocate() { bytes.Reset(row_bytes() * info.height); }
};

// out[x] = sample of channel `channel` at (x, y) as float, for all x: integers divided by their
// maximum, others as they are.
//   out: image.width() floats
void LoadRow(const Image& image, int y, int channel, float* out);

// Non-finite samples of an image. Positions count from 0, rows from the top.
struct NonFinite {
  uint64_t count = 0;
  int first_x = -1;  // the first in row order, channels of a pixel in order
  int first_y = -1;
  int first_channel = -1;
};
NonFinite FindNonFinite(const Image& image);

// Replaces every non-finite sample by the mean of the finite samples of its channel among its eight
// neighbours (inside the image), or by 0 if it has none. Neighbours count as the file had them, so
// the order of repair does not matter.
void RepairNonFinite(Image* image);

// Exact range of each channel, and how far the first three differ. Requires finite samples.
struct ImageStats {
  std::array<float, kMaxLoadedChannels> min{};  // as LoadRow gives the samples
  std::array<float, kMaxLoadedChannels> max{};
  // Largest |difference| between any two of the first three channels; 0 with fewer than three.
  float grey_difference = 0;

  bool constant(int channel) const { return min[channel] == max[channel]; }
};
ImageStats ScanImage(const Image& image, ThreadPool& pool);

}  // namespace patina
