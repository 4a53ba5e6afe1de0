// SIMD kernels of the peers that neural BRDFs are compared with: their speed is measured, so they
// get what ours get (pipeline/kernels/simd16.h). The same bits on AVX2 and AVX-512.
#pragma once

#include <cstddef>

#include "formats/brdf/brdf_source.h"
#include "pipeline/base/aligned_buffer.h"
#include "pipeline/kernels/dispatch.h"

namespace patina::bench {

// NBRDF's network, 6-21-21-3 with ReLU, as the kernels hold it: for each layer a matrix of [inputs,
// a row of biases, zeros][outputs, zeros], both padded to fours. Padding stays zero.
inline constexpr int kNbrdfLayers = 3;
inline constexpr int kNbrdfInputs[kNbrdfLayers] = {6, 21, 21};
inline constexpr int kNbrdfOutputs[kNbrdfLayers] = {21, 21, 3};
inline constexpr int kNbrdfRows[kNbrdfLayers] = {8, 24, 24};
inline constexpr int kNbrdfColumns[kNbrdfLayers] = {24, 24, 4};
inline constexpr size_t kNbrdfOffset[kNbrdfLayers] = {0, 8 * 24, 8 * 24 + 24 * 24};
inline constexpr size_t kNbrdfPadded = 8 * 24 + 24 * 24 + 24 * 4;  // floats

// Sixteen training samples: lanes are samples.
struct alignas(64) NbrdfTile {
  float x[6][16];         // half and difference vector
  float wanted_g[3][16];  // log1p(f* cosine), a straight line below zero
  float wanted_y[3][16];  // log1p(f*), likewise
  float cosine[16];
  float importance[16];  // 0 for a lane without a sample
};
inline constexpr int kNbrdfChunkTiles = 8;

// activations[l]: inputs of layer l, [kNbrdfRows[l]][16 * kNbrdfChunkTiles]; gradients alike.
struct NbrdfScratch {
  NbrdfScratch();
  AlignedBuffer<float> activations[kNbrdfLayers];
  AlignedBuffer<float> gradients[kNbrdfLayers];
  AlignedBuffer<float> outputs;  // [kNbrdfColumns[2]][16 * kNbrdfChunkTiles]
};

// Lambert and GGX (D with height-correlated Smith shadowing and Schlick's Fresnel):
//   f_c = diffuse_c / pi + specular_c D V (f0 + (1 - f0) (1 - cos theta_d)^5)
struct GgxMaterial {
  float alpha = 0.3f;  // roughness as GGX has it, the square of "perceptual" ones
  float f0 = 0.5f;
  float diffuse[3] = {0.5f, 0.5f, 0.5f};
  float specular[3] = {0.5f, 0.5f, 0.5f};
};

struct PeerKernels {
  // f of `count` pairs, rgb [count][3]: max(exp(y) - 1, 0); 0 where a direction is not above the
  // horizon. isotropic: the half vector is turned to azimuth 0.
  void (*nbrdf_evaluate)(const float* parameters, bool isotropic, const brdf::Direction* wi,
                         const brdf::Direction* wo, size_t count, float* rgb);
  // Forward, loss and backward of kNbrdfChunkTiles tiles; adds to gradient [kNbrdfPadded] and
  // returns the loss, both summed over samples. Loss of a sample, as of our trainer (LossOf in
  // pipeline/brdf/brdf_kernels.inl), the sum over channels of
  //   |log1p(f c) - log1p(f* c)| + 0.05 |log1p(f) - log1p(f*)|,  f = exp(min(y, 12)) - 1
  double (*nbrdf_train)(const float* parameters, const NbrdfTile* tiles, NbrdfScratch* scratch,
                        float* gradient);
  void (*ggx_evaluate)(const GgxMaterial& material, const brdf::Direction* wi,
                       const brdf::Direction* wo, size_t count, float* rgb);
};

const PeerKernels& PeerKernelsFor(SimdTarget target);

}  // namespace patina::bench
