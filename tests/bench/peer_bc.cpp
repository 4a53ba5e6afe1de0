#include "tests/bench/peer_bc.h"

#include <squish.h>

#include <algorithm>
#include <cstring>
#include <limits>

namespace patina::bench {
namespace {

constexpr int kSearch = 8;  // codes that an endpoint moves inwards

// A mode of BC4: `steps` + 1 interpolated values between two endpoints, and perhaps the constants 0
// and 255.
struct Fit {
  int squared_error = std::numeric_limits<int>::max();
  uint8_t values[16] = {};
};

void TryEndpoints(const uint8_t in[16], int low, int high, int steps, bool with_extremes,
                  Fit* best) {
  Fit fit;
  fit.squared_error = 0;
  const int span = high - low;
  for (int t = 0; t < 16; ++t) {
    const int index =
        span == 0 ? 0 : std::clamp(((in[t] - low) * 2 * steps + span) / (2 * span), 0, steps);
    int value = (low * (steps - index) + high * index + steps / 2) / steps;
    int error = (in[t] - value) * (in[t] - value);
    if (with_extremes) {
      for (const int extreme : {0, 255}) {
        const int other = (in[t] - extreme) * (in[t] - extreme);
        if (other < error) {
          error = other;
          value = extreme;
        }
      }
    }
    fit.values[t] = static_cast<uint8_t>(value);
    fit.squared_error += error;
    if (fit.squared_error >= best->squared_error) return;
  }
  *best = fit;
}

void Search(const uint8_t in[16], int low, int high, int steps, bool with_extremes, Fit* best) {
  for (int a = low; a <= std::min(low + kSearch, high); ++a) {
    for (int b = high; b >= std::max(high - kSearch, a); --b)
      TryEndpoints(in, a, b, steps, with_extremes, best);
  }
}

}  // namespace

void RoundTripBc4(const uint8_t in[16], uint8_t out[16]) {
  Fit best;
  const auto [low, high] = std::minmax_element(in, in + 16);
  Search(in, *low, *high, 7, false, &best);
  int inner_low = 255, inner_high = 0;
  for (int t = 0; t < 16; ++t) {
    if (in[t] == 0 || in[t] == 255) continue;
    inner_low = std::min<int>(inner_low, in[t]);
    inner_high = std::max<int>(inner_high, in[t]);
  }
  if (inner_low <= inner_high && (*low == 0 || *high == 255))
    Search(in, inner_low, inner_high, 5, true, &best);
  std::memcpy(out, best.values, 16);
}

Result<CodedLevel> BcCodec::RoundTrip(const Rgba8& image, bool normal, ThreadPool& pool) {
  const int flags = squish::kDxt1 | squish::kColourIterativeClusterFit;
  const int columns = (image.width + 3) / 4, rows = (image.height + 3) / 4;
  CodedLevel level;
  level.decoded = Rgba8(image.width, image.height);
  level.bytes = static_cast<uint64_t>(columns) * rows * (normal ? 16 : 8);
  pool.ParallelFor(rows, [&](int row, int) {
    for (int column = 0; column < columns; ++column) {
      // Texels outside the image repeat its border, so that they pull the block nowhere new.
      uint8_t texels[64];
      for (int t = 0; t < 16; ++t) {
        const int x = std::min(4 * column + t % 4, image.width - 1);
        const int y = std::min(4 * row + t / 4, image.height - 1);
        std::memcpy(texels + 4 * t, image.Texel(x, y), 4);
      }
      if (normal) {
        for (int c = 0; c < 2; ++c) {
          uint8_t plane[16];
          for (int t = 0; t < 16; ++t) plane[t] = texels[4 * t + c];
          RoundTripBc4(plane, plane);
          for (int t = 0; t < 16; ++t) texels[4 * t + c] = plane[t];
        }
      } else {
        uint8_t block[8];
        squish::Compress(texels, block, flags);
        squish::Decompress(texels, block, flags);
      }
      for (int t = 0; t < 16; ++t) {
        const int x = 4 * column + t % 4, y = 4 * row + t / 4;
        if (x < image.width && y < image.height)
          std::memcpy(level.decoded.Texel(x, y), texels + 4 * t, 4);
      }
    }
  });
  return level;
}

}  // namespace patina::bench
