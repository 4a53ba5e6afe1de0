#include "pipeline/image/image.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "formats/half.h"

namespace patina {
namespace {

constexpr std::array<float, 256> MakeUnorm8() {
  std::array<float, 256> table{};
  for (int i = 0; i < 256; ++i) table[i] = static_cast<float>(i) / 255.0f;
  return table;
}
constexpr std::array<float, 256> kUnorm8 = MakeUnorm8();

bool SampleIsFinite(const Image& image, size_t index) {
  if (image.info.type == SampleType::kHalf) {
    uint16_t half;
    std::memcpy(&half, image.bytes.data() + index * 2, 2);
    return HalfIsFinite(half);
  }
  uint32_t bits;
  std::memcpy(&bits, image.bytes.data() + index * 4, 4);
  return (bits & 0x7F800000u) != 0x7F800000u;
}

float FloatingSample(const Image& image, size_t index) {
  if (image.info.type == SampleType::kHalf) {
    uint16_t half;
    std::memcpy(&half, image.bytes.data() + index * 2, 2);
    return HalfToFloat(half);
  }
  float value;
  std::memcpy(&value, image.bytes.data() + index * 4, 4);
  return value;
}

}  // namespace

const char* SampleTypeName(SampleType type) {
  switch (type) {
    case SampleType::kUint8:
      return "uint8";
    case SampleType::kUint16:
      return "uint16";
    case SampleType::kHalf:
      return "half";
    case SampleType::kFloat:
      return "float";
  }
  return "float";
}

int SampleBytes(SampleType type) {
  switch (type) {
    case SampleType::kUint8:
      return 1;
    case SampleType::kUint16:
    case SampleType::kHalf:
      return 2;
    case SampleType::kFloat:
      return 4;
  }
  return 4;
}

void LoadRow(const Image& image, int y, int channel, float* out) {
  const uint8_t* row = image.bytes.data() + static_cast<size_t>(y) * image.row_bytes();
  const int step = image.channels();
  const int width = image.width();
  switch (image.info.type) {
    case SampleType::kUint8: {
      const uint8_t* from = row + channel;
      for (int x = 0; x < width; ++x) out[x] = kUnorm8[from[static_cast<size_t>(x) * step]];
      break;
    }
    case SampleType::kUint16: {
      const uint16_t* from = reinterpret_cast<const uint16_t*>(row) + channel;
      for (int x = 0; x < width; ++x) {
        out[x] = static_cast<float>(from[static_cast<size_t>(x) * step]) / 65535.0f;
      }
      break;
    }
    case SampleType::kHalf: {
      const uint16_t* from = reinterpret_cast<const uint16_t*>(row) + channel;
      for (int x = 0; x < width; ++x) out[x] = HalfToFloat(from[static_cast<size_t>(x) * step]);
      break;
    }
    case SampleType::kFloat: {
      const float* from = reinterpret_cast<const float*>(row) + channel;
      for (int x = 0; x < width; ++x) out[x] = from[static_cast<size_t>(x) * step];
      break;
    }
  }
}

NonFinite FindNonFinite(const Image& image) {
  NonFinite found;
  if (IsInteger(image.info.type)) return found;
  const size_t samples = static_cast<size_t>(image.width()) * image.height() * image.channels();
  for (size_t i = 0; i < samples; ++i) {
    if (SampleIsFinite(image, i)) continue;
    if (found.count++ == 0) {
      const size_t pixel = i / image.channels();
      found.first_channel = static_cast<int>(i % image.channels());
      found.first_x = static_cast<int>(pixel % image.width());
      found.first_y = static_cast<int>(pixel / image.width());
    }
  }
  return found;
}

void RepairNonFinite(Image* image) {
  if (IsInteger(image->info.type)) return;
  struct Repair {
    size_t index;
    float value;
  };
  std::vector<Repair> repairs;
  const int channels = image->channels();
  const size_t samples = static_cast<size_t>(image->width()) * image->height() * channels;
  for (size_t i = 0; i < samples; ++i) {
    if (SampleIsFinite(*image, i)) continue;
    const int channel = static_cast<int>(i % channels);
    const int x = static_cast<int>(i / channels % image->width());
    const int y = static_cast<int>(i / channels / image->width());
    double sum = 0;
    int count = 0;
    for (int ny = std::max(0, y - 1); ny <= std::min(image->height() - 1, y + 1); ++ny) {
      for (int nx = std::max(0, x - 1); nx <= std::min(image->width() - 1, x + 1); ++nx) {
        const size_t at = (static_cast<size_t>(ny) * image->width() + nx) * channels + channel;
        if (!SampleIsFinite(*image, at)) continue;
        sum += FloatingSample(*image, at);
        ++count;
      }
    }
    repairs.push_back({i, count == 0 ? 0.0f : static_cast<float>(sum / count)});
  }
  for (const Repair& repair : repairs) {
    if (image->info.type == SampleType::kHalf) {
      const uint16_t half = FloatToHalf(repair.value);
      std::memcpy(image->bytes.data() + repair.index * 2, &half, 2);
    } else {
      std::memcpy(image->bytes.data() + repair.index * 4, &repair.value, 4);
    }
  }
}

ImageStats ScanImage(const Image& image, ThreadPool& pool) {
  constexpr int kRowsPerTask = 32;
  const int tasks = (image.height() + kRowsPerTask - 1) / kRowsPerTask;
  const int channels = image.channels();
  std::vector<ImageStats> partial(tasks);
  std::vector<std::array<std::vector<float>, kMaxLoadedChannels>> scratch(pool.threads());
  for (auto& rows : scratch) {
    for (auto& row : rows) row.resize(image.width());
  }
  pool.ParallelFor(tasks, [&](int task, int worker) {
    auto& rows = scratch[worker];
    ImageStats& stats = partial[task];
    const int end = std::min(image.height(), (task + 1) * kRowsPerTask);
    for (int y = task * kRowsPerTask; y < end; ++y) {
      for (int c = 0; c < channels; ++c) {
        LoadRow(image, y, c, rows[c].data());
        const bool first = y == task * kRowsPerTask;
        float low = first ? rows[c][0] : stats.min[c];
        float high = first ? rows[c][0] : stats.max[c];
        for (const float value : rows[c]) {
          low = std::min(low, value);
          high = std::max(high, value);
        }
        stats.min[c] = low;
        stats.max[c] = high;
      }
      if (channels < 3) continue;
      float difference = stats.grey_difference;
      for (int x = 0; x < image.width(); ++x) {
        const float r = rows[0][x], g = rows[1][x], b = rows[2][x];
        difference = std::max(difference, std::max({r, g, b}) - std::min({r, g, b}));
      }
      stats.grey_difference = difference;
    }
  });
  ImageStats total = partial[0];
  for (const ImageStats& stats : partial) {
    for (int c = 0; c < channels; ++c) {
      total.min[c] = std::min(total.min[c], stats.min[c]);
      total.max[c] = std::max(total.max[c], stats.max[c]);
    }
    total.grey_difference = std::max(total.grey_difference, stats.grey_difference);
  }
  return total;
}

}  // namespace patina
