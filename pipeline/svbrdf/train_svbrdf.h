// Trains a spatially varying BRDF: f(wi, wo, u) = network(index grid (wi, wo), scalars, neural
// texture(u)), the texture as BC6H blocks.
//
// Based on: Dou 2023 ("NeuBRDF"), section 4 and Eq. 8, and Weinreich 2024. In three parts: free
// features and free texels; codes and blocks whose parameters are trained; codes and network behind
// legal blocks. Differs from both papers: the texture is block-compressed, and has mips.
#pragma once

#include <array>
#include <vector>

#include "formats/bc6h.h"
#include "formats/index_pack.h"
#include "formats/weights.h"
#include "pipeline/brdf/train_brdf.h"
#include "pipeline/svbrdf/neural_texture.h"
#include "pipeline/svbrdf/varying_source.h"

namespace patina::svbrdf {

struct SvbrdfShape {
  brdf::ModelShape model;
  TextureShape texture;
};

// For a source of this size. Unless it is isotropic (VaryingSource::isotropic): with an azimuth of
// its own, without canonical order (texels of a rough surface shadow and hide each other, which is
// not reciprocal), with all scalars.
SvbrdfShape DefaultSvbrdfShape(int width, int height, AddressMode address, bool isotropic = false);

enum class TextureForm {
  kBlocks,  // BC6H
  kHalves   // uncompressed halves, to compare with
};

struct SvbrdfOptions {
  uint64_t seed = 1;
  TextureForm form = TextureForm::kBlocks;
  int batch = 2048;
  int free_steps = 5000;
  int block_steps = 5000;
  int final_steps = 3000;  // behind a texture that stays as it is
  float feature_rate = 0.01f;
  float network_rate = 0.004f;
  float texel_rate = 0.02f;   // of free texels
  float block_rate = 0.005f;  // of end points, binades
  float index_rate = 0.01f;
  float decay = 0.02f;
  const CancelToken* cancel = nullptr;
  RateFault rate_fault;  // for tests
};

// Samples that are worth drawing: as many as are trained on, but no more than the source has to say
// or 300 MB can hold.
size_t WantedSamples(const SvbrdfOptions& options, const TextureShape& texture,
                     const VaryingSource& source);

struct TrainedSvbrdf {
  SvbrdfShape shape;
  IndexPack pack;
  WeightBuffer network;
  // kBlocks: [texture][level][block], UF16. kHalves: the texels as decoded, rows of kRowFloats.
  std::array<std::vector<std::vector<bc6h::Block>>, kFeatureTextures> blocks;
  std::vector<float> texels;
  std::vector<brdf::CurvePoint> curve;
  double samples = 0;
  double used_codes = 0;
  double free_loss = 0;   // held-out mean |log1p(f c) - log1p(f* c)| of free features and texels
  double block_loss = 0;  // with trained blocks, before they were made legal
  double final_loss = 0;
  double recording_s = 0;
  int rollbacks = 0;

  uint64_t texture_bytes() const;  // of the texels or blocks alone
};

// pool: drawn for shape.model.grid and shape.texture.levels. Errors: kInvalidArgument (a shape out
// of range), kCancelled, kOutOfRange (weights beyond halves; RateGuard::kMaxRollbacks rollbacks),
// kUnsupported (CPU).
Result<TrainedSvbrdf> TrainSvbrdf(const TexelPool& pool, const SvbrdfShape& shape,
                                  const SvbrdfOptions& options, ThreadPool& threads,
                                  ProgressSink& progress);

}  // namespace patina::svbrdf
