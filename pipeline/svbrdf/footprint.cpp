#include "pipeline/svbrdf/footprint.h"

#include <algorithm>
#include <cmath>

#include "pipeline/material/mip_filter.h"
#include "pipeline/svbrdf/neural_texture.h"

namespace patina::svbrdf {

FootprintFinder::FootprintFinder(int width, int height, int levels, AddressMode address)
    : widths_{width}, heights_{height}, address_(address) {
  for (int l = 1; l < levels; ++l) {
    widths_.push_back(NextMipSide(widths_.back()));
    heights_.push_back(NextMipSide(heights_.back()));
  }
}

Footprint FootprintFinder::At(float u, float v, float s) const {
  Footprint footprint;
  const auto last = static_cast<int>(widths_.size()) - 1;
  const float level = std::clamp(s, 0.0f, static_cast<float>(last));
  const float low = std::floor(level);
  for (int k = 0; k < 2; ++k) {
    const float share = k == 0 ? 1 - (level - low) : level - low;
    const int l = std::min(static_cast<int>(low) + k, last);
    const TexelTap x = TexelTapAt(u, widths_[static_cast<size_t>(l)], address_);
    const TexelTap y = TexelTapAt(v, heights_[static_cast<size_t>(l)], address_);
    const auto add = [&](int column, int row, float weight) {
      if (weight > 0) footprint.taps[footprint.count++] = {l, column, row, weight};
    };
    add(x.a, y.a, share * (1 - y.f) * (1 - x.f));
    add(x.b, y.a, share * (1 - y.f) * x.f);
    add(x.a, y.b, share * y.f * (1 - x.f));
    add(x.b, y.b, share * y.f * x.f);
  }
  return footprint;
}

size_t FootprintFinder::MostTexels(const Footprint& footprint) const {
  size_t texels = 0;
  for (int t = 0; t < footprint.count; ++t) {
    // Of an odd side three texels become one.
    const auto most = [&](const std::vector<int>& sides) {
      size_t count = 1;
      for (int l = 0; l < footprint.taps[t].level; ++l) {
        const int side = sides[static_cast<size_t>(l)];
        count *= side == 1 ? 1 : side % 2 == 0 ? 2 : 3;
      }
      return std::min(count, static_cast<size_t>(sides[0]));
    };
    texels += most(widths_) * most(heights_);
  }
  return texels;
}

size_t FootprintFinder::Draw(const Footprint& footprint, Rng* rng) const {
  float pick = rng->Uniform();
  int t = 0;
  for (; t + 1 < footprint.count && pick >= footprint.taps[t].weight; ++t)
    pick -= footprint.taps[t].weight;
  const Footprint::Tap& tap = footprint.taps[t];
  const int x = Descend(widths_, tap.level, tap.x, rng);
  const int y = Descend(heights_, tap.level, tap.y, rng);
  return static_cast<size_t>(y) * static_cast<size_t>(widths_[0]) + static_cast<size_t>(x);
}

int FootprintFinder::Descend(const std::vector<int>& sides, int level, int index, Rng* rng) {
  for (int l = level - 1; l >= 0; --l) {
    const BoxTaps taps = BoxTapsFor(sides[static_cast<size_t>(l)], index);
    if (taps.count == 1) {
      index = taps.first;
      continue;
    }
    float pick = rng->Uniform();
    int k = 0;
    for (; k + 1 < taps.count && pick >= taps.weight[k]; ++k) pick -= taps.weight[k];
    index = taps.first + k;
  }
  return index;
}

void FootprintFinder::Spread(const std::vector<int>& sides, int level, int index,
                             std::vector<Share>* shares) {
  *shares = {{index, 1}};
  std::vector<Share> below;
  for (int l = level - 1; l >= 0; --l) {
    below.clear();
    for (const Share& share : *shares) {
      const BoxTaps taps = BoxTapsFor(sides[static_cast<size_t>(l)], share.index);
      for (int k = 0; k < taps.count; ++k) {
        const double weight = share.weight * static_cast<double>(taps.weight[k]);
        if (weight > 0) below.push_back({taps.first + k, weight});
      }
    }
    shares->swap(below);
  }
}

}  // namespace patina::svbrdf
