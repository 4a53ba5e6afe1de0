// Filters from one mip level to the next, and what roughness and opacity need beside the plain area
// mean.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pipeline/base/thread_pool.h"

namespace patina {

// Side of the next mip level.
inline int NextMipSide(int side) { return side > 1 ? side / 2 : 1; }

// The texels of a side of `size` that texel `index` of the next level covers, with their shares of
// its area, which sum to 1. An even side gives two texels of 1/2, an odd side 2m+1 three of
// (m-i)/n, m/n, (i+1)/n: the polyphase box filter (Guthe and Heckbert 2005, "Non-Power-of-Two
// Mipmap Creation"), which keeps the mean of the level; a side of 1 gives itself.
struct BoxTaps {
  int first = 0;
  int count = 1;
  float weight[3] = {1, 0, 0};
};
BoxTaps BoxTapsFor(int size, int index);

// out[x] += weight * area mean of in over the columns of texel x of the next level.
//   in: width floats   out: NextMipSide(width) floats
void AddBoxRow(const float* in, int width, float weight, float* out);

// Planes of one mip level: plane p starts at data[p * width * height], rows from the top.
struct PlaneLevel {
  int width = 0;
  int height = 0;
  int planes = 0;
  std::vector<float> data;

  void Allocate(int level_width, int level_height, int level_planes);
  float* Row(int plane, int y) {
    return data.data() + (static_cast<size_t>(plane) * height + y) * width;
  }
  const float* Row(int plane, int y) const {
    return data.data() + (static_cast<size_t>(plane) * height + y) * width;
  }
};

// The next level of every plane by exact area means.
PlaneLevel NextLevel(const PlaneLevel& level, ThreadPool& pool);

// Roughness of a footprint whose mean roughness is `roughness` and whose unit normals average to
// length `mean_length`.
//   alpha = r^2 (GGX, Burley 2012);  alpha'^2 = min(1, alpha^2 + 2 (1 - L) / L);  r' = sqrt(alpha')
// (1 - L) / L is the variance of the normals about their mean (Toksvig 2005, "Mipmapping Normal
// Maps"), and slopes of variance s^2 widen a lobe by alpha^2 + 2 s^2 (Olano and Baker 2010, "LEAN
// Mapping"). Differs from Toksvig's formula, which scales a Blinn-Phong exponent, because GGX has
// none; the two agree to first order. Lost lengths below 1e-6 are rounding.
float WidenRoughness(float roughness, float mean_length);

// The factor for the opacities of a mip that makes the share of texels at or above `cutoff` the
// nearest possible to `coverage`; 1 where that is so already or no factor can do it. After Castano
// 2010 ("Computing Alpha Mipmaps"), which searches the factor by bisection; here it is read off the
// order statistics, so it is exact.
float CoverageScale(std::span<const float> opacities, double coverage, float cutoff);

}  // namespace patina
