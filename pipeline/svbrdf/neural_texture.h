// The neural texture of a spatially varying BRDF: up to four textures of three features with their
// mips, trained as free texels or as BC6H blocks, and the rows of texels that samples look up.
//
// Based on: Weinreich 2024 (block parameters are what is trained) for the texture that Dou 2023,
// section 4, puts beside the index grid. Differs from both: all textures have one size, so that the
// features of a texel lie in one row.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/bc6h.h"
#include "pipeline/brdf/texture_part.h"
#include "pipeline/material/feature_store.h"
#include "pipeline/svbrdf/feature_basis.h"
#include "pipeline/svbrdf/texture_kernels.h"

namespace patina::svbrdf {

struct TextureShape {
  int width = 0;  // of level 0
  int height = 0;
  int levels = 0;
  int textures = kFeatureTextures;  // 1..4
  AddressMode address = AddressMode::kWrap;

  int features() const { return 3 * textures; }
  int64_t texels() const;  // of all levels of one texture
};

// The two texels of a row or column that a coordinate lies between, as decoders find them but for
// coordinates within 2^-16 texels of a centre, which are taken for it.
struct TexelTap {
  int a = 0, b = 0;
  float f = 0;  // the share of b
};
TexelTap TexelTapAt(float coordinate, int side, AddressMode address);

// Of the texels of all levels alike.
struct TexelMoments {
  std::vector<double> mean;        // [feature]
  std::vector<double> covariance;  // [feature][feature]
};

class NeuralTexture : public brdf::TexturePart {
 public:
  // Free texels, all zero. layout: of the network, with shape.features() texture inputs. The last
  // three must outlive it.
  NeuralTexture(const TextureShape& shape, const brdf::NetworkLayout& layout,
                const brdf::BrdfKernels& brdf_kernels, const TextureKernels& kernels);

  const TextureShape& shape() const { return shape_; }

  // Trilinear taps at texture coordinates u, v (texel centres at half integers of u * width) and
  // level s, which is clamped to the levels there are: as decoders sample.
  brdf::TexelTaps LookUp(float u, float v, float s) const;

  // Gives free texels the values of these rows (see rows(); padding is not looked at).
  void Start(std::span<const float> rows, ThreadPool& pool);

  // The step of the next Update; 0 leaves the texture as it is.
  void SetRates(float texel, float index) { rates_.endpoint = texel, rates_.index = index; }

  TexelMoments Moments() const;
  // Puts the places y of the basis in place of the features, within 1 +- 7/8, so that BC6H holds
  // them well. The texels are free.
  void Rebase(const FeatureBasis& basis, ThreadPool& pool);
  // Goes over from free texels to blocks that are fitted to them.
  void UseBlocks(ThreadPool& pool);
  // Makes legal blocks of what was trained; errors cost what the products of gradients say. The
  // texture is then what a decoder gives, and is not trained further. sensitivity: as
  // AddSensitivity has filled it.
  void Encode(std::span<const float> sensitivity, ThreadPool& pool);
  // Rounds free texels to halves.
  void RoundToHalves();

  // Sums of products of the gradients of texels: [row][texture][xx, xy, xz, yy, yz, zz], for
  // Encode.
  std::vector<float> MakeSensitivity() const;
  void AddSensitivity(const brdf::TexelTaps* taps, int count, const brdf::ChunkResult& result,
                      std::span<float> sums) const;

  // After Encode: [texture][level][block].
  const std::array<std::vector<std::vector<bc6h::Block>>, kFeatureTextures>& blocks() const {
    return blocks_;
  }

  const float* rows() const override { return values_.data(); }
  void Scatter(const brdf::TexelTaps* taps, int count, const brdf::ChunkResult& result) override;
  bool Update(ThreadPool& pool) override;
  void Save(ThreadPool& pool) override { saved_.Save(store_, pool); }
  void Rollback(ThreadPool& pool) override;
  size_t state_bytes() const override;

 private:
  // Blocks of a level that are updated together.
  struct Piece {
    int texture, level, first, count;
  };

  LevelRows RowsOf(int texture, int level);
  void DecodeAll(ThreadPool& pool);
  void ForgetTouched();

  TextureShape shape_;
  const brdf::NetworkLayout& layout_;
  const brdf::BrdfKernels& brdf_kernels_;
  const TextureKernels& kernels_;
  FeatureStore store_;
  FeatureSnapshot saved_;
  AdamRates rates_;
  bool fixed_ = false;                      // Encode or RoundToHalves has been there
  std::vector<int32_t> first_row_;          // of each level
  AlignedBuffer<float> values_, gradient_;  // [row][kRowFloats]
  std::vector<int32_t> block_of_row_;       // in its level
  std::vector<uint8_t> level_of_row_;
  std::vector<std::vector<uint8_t>> is_touched_;  // [level][block]
  std::vector<std::vector<int32_t>> touched_;     // [level]
  std::vector<Piece> pieces_;
  std::array<std::vector<std::vector<bc6h::Block>>, kFeatureTextures> blocks_;
};

}  // namespace patina::svbrdf
