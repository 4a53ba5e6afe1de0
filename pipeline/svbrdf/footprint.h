// Which texels of level 0 a lookup in the mips filters, and with which weights: as decoders filter,
// bilinear in a level and linear between two, each level the area mean of the one before.
#pragma once

#include <cstddef>
#include <vector>

#include "pipeline/base/rng.h"
#include "pipeline/material/target_pyramid.h"

namespace patina::svbrdf {

// Texels of one or two levels; weights sum to 1.
struct Footprint {
  struct Tap {
    int level = 0, x = 0, y = 0;
    float weight = 0;
  };
  Tap taps[8];
  int count = 0;
};

class FootprintFinder {
 public:
  FootprintFinder(int width, int height, int levels, AddressMode address);

  // Of texture coordinates u, v and level s, as NeuralTexture::LookUp.
  Footprint At(float u, float v, float s) const;
  // At least as many texels as it has.
  size_t MostTexels(const Footprint& footprint) const;
  // A texel of level 0, drawn by its weight.
  size_t Draw(const Footprint& footprint, Rng* rng) const;

  // Calls visit(texel, weight) for the texels of a footprint, one that lies in several of its taps
  // several times.
  template <class Visit>
  void ForEach(const Footprint& footprint, Visit&& visit) const {
    std::vector<Share> columns, rows;
    for (int t = 0; t < footprint.count; ++t) {
      const Footprint::Tap& tap = footprint.taps[t];
      Spread(widths_, tap.level, tap.x, &columns);
      Spread(heights_, tap.level, tap.y, &rows);
      for (const Share& row : rows) {
        for (const Share& column : columns) {
          visit(static_cast<size_t>(row.index) * static_cast<size_t>(widths_[0]) +
                    static_cast<size_t>(column.index),
                static_cast<double>(tap.weight) * row.weight * column.weight);
        }
      }
    }
  }

 private:
  struct Share {
    int index = 0;
    double weight = 0;
  };
  static void Spread(const std::vector<int>& sides, int level, int index,
                     std::vector<Share>* shares);
  static int Descend(const std::vector<int>& sides, int level, int index, Rng* rng);

  std::vector<int> widths_, heights_;  // [level]
  AddressMode address_;
};

}  // namespace patina::svbrdf
