// References made of a function, without files: for tests of what follows the reading of maps.
#pragma once

#include <algorithm>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/material/target_pyramid.h"

namespace patina::test {

// value(u, v, channel) sampled at texel centres; coarser mips by averaging.
inline MaterialReference MakeReference(int width, int height, int channels, AddressMode address,
                                       const std::function<float(double, double, int)>& value) {
  MaterialReference reference;
  reference.pyramid.channels = channels;
  reference.pyramid.address = address;
  std::vector<float> texels(static_cast<size_t>(width) * height * channels);
  for (int c = 0; c < channels; ++c) {
    TargetChannel channel;
    channel.map = "map" + std::to_string(c);
    channel.learned_index = c;
    channel.min_value = std::numeric_limits<float>::max();
    channel.max_value = -channel.min_value;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const float v = value((x + 0.5) / width, (y + 0.5) / height, c);
        texels[(static_cast<size_t>(y) * width + x) * channels + c] = v;
        channel.min_value = std::min(channel.min_value, v);
        channel.max_value = std::max(channel.max_value, v);
      }
    }
    reference.channels.push_back(channel);
  }
  for (int w = width, h = height;;) {
    TargetLevel level;
    level.Allocate(w, h, channels);
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        for (int c = 0; c < channels; ++c)
          level.Set(x, y, c, texels[(static_cast<size_t>(y) * w + x) * channels + c]);
      }
    }
    level.FillPadding(address);
    reference.pyramid.levels.push_back(std::move(level));
    if (w == 1 && h == 1) break;
    const int nw = std::max(1, w / 2), nh = std::max(1, h / 2);
    std::vector<float> next(static_cast<size_t>(nw) * nh * channels);
    for (int y = 0; y < nh; ++y) {
      for (int x = 0; x < nw; ++x) {
        for (int c = 0; c < channels; ++c) {
          float sum = 0;
          for (int k = 0; k < 4; ++k) {
            const int sx = std::min(2 * x + (k & 1), w - 1), sy = std::min(2 * y + (k >> 1), h - 1);
            sum += texels[(static_cast<size_t>(sy) * w + sx) * channels + c];
          }
          next[(static_cast<size_t>(y) * nw + x) * channels + c] = 0.25f * sum;
        }
      }
    }
    texels.swap(next);
    w = nw;
    h = nh;
  }
  return reference;
}

}  // namespace patina::test
