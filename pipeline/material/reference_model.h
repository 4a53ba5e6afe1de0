// The model written like the paper, one sample at a time: what the SIMD window kernels are tested against.
//
// S is double for values and std::complex<double> for complex-step derivatives. Weinreich 2024, Eq. 3 and 6-10.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "formats/bc6h.h"
#include "pipeline/material/feature_store.h"
#include "pipeline/nn/mlp.h"

namespace patina {

// Parameters of every level as S: [texture][level][block * stride + k], in the store's layout.
template <class S>
struct ReferenceParameters {
  std::array<std::vector<std::vector<S>>, kFeatureTextures> features;
  std::vector<S> network;  // mlp.h order
};

// Eq. 9 in binades: 2^floor(t) * (1 + t - floor(t)) / 2^15; the exponent is taken from the real part.
template <class S>
S ReferenceValueOfBinades(const S& binades) {
  const double exponent = std::floor(mlp::RealPart(binades));
  return std::ldexp(1.0, static_cast<int>(exponent) - 15) * (S(1) + binades - S(exponent));
}

// Texel (x, y) of a level, inside it.
template <class S>
void ReferenceTexel(const FeatureLevel& level, BlockForm form, const std::vector<S>& params, int x, int y, S out[3]) {
  const int block = (y / 4) * level.blocks_x + x / 4, texel = (y % 4) * 4 + x % 4;
  const S* p = params.data() + static_cast<size_t>(block) * BlockStride(form);
  const int region = (bc6h::PartitionMask(level.partition[block]) >> texel) & 1;
  for (int c = 0; c < 3; ++c) {
    if (form == BlockForm::kFree) {
      out[c] = p[c * 16 + texel];
    } else {
      const S a = p[6 * region + c], b = p[6 * region + 3 + c];
      out[c] = ReferenceValueOfBinades(a + p[16 + texel] * (b - a));
    }
  }
}

inline int ReferenceAddress(int texel, int size, AddressMode address) {
  if (address == AddressMode::kClamp) return std::clamp(texel, 0, size - 1);
  const int m = texel % size;
  return m < 0 ? m + size : m;
}

// The twelve inputs at (u, v) in [0,1) and level of detail s, trilinear (Eq. 10).
template <class S>
void ReferenceInputs(const FeatureStore& store, const ModelShape& shape, const ReferenceParameters<S>& params, AddressMode address,
                     double u, double v, double s, S out[kNetworkInputs]) {
  for (int t = 0; t < kFeatureTextures; ++t) {
    const double lod = std::clamp(s - shape[t].lod_shift, 0.0, static_cast<double>(shape[t].levels - 1));
    const int fine = static_cast<int>(lod);
    for (int c = 0; c < 3; ++c) out[3 * t + c] = S(0);
    for (int k = 0; k < 2; ++k) {
      const double blend = k == 0 ? 1 - (lod - fine) : lod - fine;
      if (blend == 0) continue;
      const FeatureLevel& level = store.textures[t][fine + k];
      const double x = u * level.width - 0.5, y = v * level.height - 0.5;
      const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
      const double fx = x - ix, fy = y - iy;
      for (int corner = 0; corner < 4; ++corner) {
        const int cx = corner & 1, cy = corner >> 1;
        const double weight = blend * (cx ? fx : 1 - fx) * (cy ? fy : 1 - fy);
        if (weight == 0) continue;
        S texel[3];
        ReferenceTexel(level, store.form, params.features[t][fine + k], ReferenceAddress(ix + cx, level.width, address),
                       ReferenceAddress(iy + cy, level.height, address), texel);
        for (int c = 0; c < 3; ++c) out[3 * t + c] += weight * texel[c];
      }
    }
  }
}

}  // namespace patina
