#include "pipeline/svbrdf/neural_texture.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>

#include "formats/base/check.h"
#include "formats/half.h"
#include "pipeline/bc6/block_encoder.h"
#include "pipeline/material/feature_init.h"

namespace patina::svbrdf {
namespace {

constexpr int kProducts = 6;
constexpr int kBlocksPerTask = 64;
constexpr size_t kRowsPerTask = 4096;
constexpr double kMostFromOne = 0.875;

ModelShape StoreShape(const TextureShape& shape) {
  ModelShape model{};
  for (int t = 0; t < shape.textures; ++t)
    model[t] = FeatureShape{0, shape.width, shape.height, shape.levels};
  return model;
}

bc6::SoftBlock LoadSoftBlock(const FeatureLevel& level, int block) {
  const float* params =
      level.params.data() + static_cast<size_t>(block) * BlockStride(BlockForm::kSegments);
  bc6::SoftBlock soft;
  for (int e = 0; e < 4; ++e) {
    for (int c = 0; c < 3; ++c) soft.endpoint[e][c] = params[e * 3 + c];
  }
  std::memcpy(soft.index, params + 16, sizeof soft.index);
  soft.partition = level.partition[block];
  return soft;
}

}  // namespace

TexelTap TexelTapAt(float coordinate, int side, AddressMode address) {
  const bool wrap = address == AddressMode::kWrap;
  double at = static_cast<double>(coordinate);
  at = wrap ? at - std::floor(at) : std::clamp(at, 0.0, 1.0);
  // Centres of texels are no floats: what is left of them would touch a neighbour, and Adam takes
  // steps of full size for gradients of any.
  constexpr double kNearest = 0x1p-16;
  double position = at * side - 0.5;
  if (std::abs(position - std::round(position)) < kNearest) position = std::round(position);
  const double low = std::floor(position);
  const int a = static_cast<int>(low);
  const auto texel = [&](int x) { return wrap ? (x + side) % side : std::clamp(x, 0, side - 1); };
  return {texel(a), texel(a + 1), static_cast<float>(position - low)};
}

int64_t TextureShape::texels() const {
  int64_t sum = 0;
  for (int l = 0; l < levels; ++l)
    sum += static_cast<int64_t>(std::max(1, width >> l)) * std::max(1, height >> l);
  return sum;
}

NeuralTexture::NeuralTexture(const TextureShape& shape, const brdf::NetworkLayout& layout,
                             const brdf::BrdfKernels& brdf_kernels, const TextureKernels& kernels)
    : shape_(shape), layout_(layout), brdf_kernels_(brdf_kernels), kernels_(kernels) {
  store_.Allocate(StoreShape(shape), BlockForm::kFree, StoreUse::kAdam);
  const auto rows = static_cast<size_t>(shape.texels());
  values_.Reset(rows * kRowFloats);
  gradient_.Reset(rows * kRowFloats);
  block_of_row_.reserve(rows);
  level_of_row_.reserve(rows);
  for (int l = 0; l < shape.levels; ++l) {
    const FeatureLevel& level = store_.textures[0][l];
    first_row_.push_back(static_cast<int32_t>(block_of_row_.size()));
    for (int y = 0; y < level.height; ++y) {
      for (int x = 0; x < level.width; ++x) {
        block_of_row_.push_back(y / 4 * level.blocks_x + x / 4);
        level_of_row_.push_back(static_cast<uint8_t>(l));
      }
    }
    is_touched_.emplace_back(level.block_count());
    touched_.emplace_back();
  }
}

brdf::TexelTaps NeuralTexture::LookUp(float u, float v, float s) const {
  brdf::TexelTaps taps;
  const float level = std::clamp(s, 0.0f, static_cast<float>(shape_.levels - 1));
  const float low = std::floor(level);
  for (int k = 0; k < 2; ++k) {
    const int l = std::min(static_cast<int>(low) + k, shape_.levels - 1);
    const float share = k == 0 ? 1 - (level - low) : level - low;
    const FeatureLevel& at = store_.textures[0][l];
    const TexelTap x = TexelTapAt(u, at.width, shape_.address);
    const TexelTap y = TexelTapAt(v, at.height, shape_.address);
    const int32_t first = first_row_[l];
    const int32_t row[4] = {y.a * at.width + x.a, y.a * at.width + x.b, y.b * at.width + x.a,
                            y.b * at.width + x.b};
    const float weight[4] = {(1 - y.f) * (1 - x.f), (1 - y.f) * x.f, y.f * (1 - x.f), y.f * x.f};
    for (int c = 0; c < 4; ++c) {
      taps.row[4 * k + c] = first + row[c];
      taps.weight[4 * k + c] = share * weight[c];
    }
  }
  return taps;
}

LevelRows NeuralTexture::RowsOf(int texture, int level) {
  const FeatureLevel& at = store_.textures[texture][level];
  const size_t first = static_cast<size_t>(first_row_[level]) * kRowFloats;
  return {values_.data() + first, gradient_.data() + first, at.width, at.height, 3 * texture};
}

void NeuralTexture::DecodeAll(ThreadPool& pool) {
  for (int t = 0; t < shape_.textures; ++t) {
    for (int l = 0; l < shape_.levels; ++l) {
      const FeatureLevel& level = store_.textures[t][l];
      const LevelRows rows = RowsOf(t, l);
      pool.ParallelFor(
          (level.block_count() + kBlocksPerTask - 1) / kBlocksPerTask, [&](int task, int) {
            const int first = task * kBlocksPerTask;
            kernels_.decode_blocks(level, store_.form, first,
                                   std::min(kBlocksPerTask, level.block_count() - first), rows);
          });
    }
  }
}

void NeuralTexture::Scatter(const brdf::TexelTaps* taps, int count,
                            const brdf::ChunkResult& result) {
  if (fixed_) return;
  brdf_kernels_.scatter_texels(layout_, taps, count, result, gradient_.data());
  for (int s = 0; s < count; ++s) {
    for (int c = 0; c < 8; ++c) {
      if (taps[s].weight[c] == 0) continue;
      const int32_t row = taps[s].row[c];
      const int level = level_of_row_[row], block = block_of_row_[row];
      if (is_touched_[level][block] == 0) {
        is_touched_[level][block] = 1;
        touched_[level].push_back(block);
      }
    }
  }
}

bool NeuralTexture::Update(ThreadPool& pool) {
  if (fixed_) return true;
  pieces_.clear();
  for (int l = 0; l < shape_.levels; ++l) {
    const int count = static_cast<int>(touched_[l].size());
    for (int first = 0; first < count; first += kBlocksPerTask) {
      for (int t = 0; t < shape_.textures; ++t)
        pieces_.push_back({t, l, first, std::min(kBlocksPerTask, count - first)});
    }
  }
  std::atomic<bool> finite{true};
  pool.ParallelFor(static_cast<int>(pieces_.size()), [&](int task, int) {
    const Piece& piece = pieces_[task];
    if (!kernels_.update_blocks(&store_.textures[piece.texture][piece.level], store_.form,
                                touched_[piece.level].data() + piece.first, piece.count, rates_,
                                RowsOf(piece.texture, piece.level))) {
      finite.store(false, std::memory_order_relaxed);
    }
  });
  ForgetTouched();
  return finite.load();
}

void NeuralTexture::ForgetTouched() {
  for (int l = 0; l < shape_.levels; ++l) {
    for (const int32_t block : touched_[l]) is_touched_[l][block] = 0;
    touched_[l].clear();
  }
}

void NeuralTexture::Rollback(ThreadPool& pool) {
  if (fixed_) return;
  saved_.Restore(&store_);
  std::fill(gradient_.data(), gradient_.data() + gradient_.size(), 0.0f);
  ForgetTouched();
  DecodeAll(pool);
}

void NeuralTexture::Start(std::span<const float> rows, ThreadPool& pool) {
  PATINA_CHECK(rows.size() == values_.size() && store_.form == BlockForm::kFree);
  for (int f = 0; f < shape_.features(); ++f) {
    for (int l = 0; l < shape_.levels; ++l) {
      FeatureLevel& level = store_.textures[f / 3][l];
      const size_t first = static_cast<size_t>(first_row_[l]);
      for (int block = 0; block < level.block_count(); ++block) {
        float* texels = level.params.data() +
                        static_cast<size_t>(block) * BlockStride(BlockForm::kFree) + f % 3 * 16;
        // What lies beyond the edge of the level repeats its last texels.
        for (int k = 0; k < 16; ++k) {
          const int x = std::min(block % level.blocks_x * 4 + k % 4, level.width - 1);
          const int y = std::min(block / level.blocks_x * 4 + k / 4, level.height - 1);
          texels[k] = rows[(first + static_cast<size_t>(y) * level.width + x) * kRowFloats + f];
        }
      }
    }
  }
  DecodeAll(pool);
}

size_t NeuralTexture::state_bytes() const {
  size_t floats = 0;
  for (const auto& texture : store_.textures) {
    for (const FeatureLevel& level : texture) floats += level.params.size();
  }
  return floats * sizeof(float);
}

TexelMoments NeuralTexture::Moments() const {
  const auto n = static_cast<size_t>(shape_.features()), rows = static_cast<size_t>(shape_.texels());
  TexelMoments moments{std::vector<double>(n), std::vector<double>(n * n)};
  for (size_t r = 0; r < rows; ++r) {
    for (size_t f = 0; f < n; ++f)
      moments.mean[f] += static_cast<double>(values_[r * kRowFloats + f]);
  }
  for (double& mean : moments.mean) mean /= static_cast<double>(rows);
  std::vector<double> d(n);
  for (size_t r = 0; r < rows; ++r) {
    for (size_t f = 0; f < n; ++f)
      d[f] = static_cast<double>(values_[r * kRowFloats + f]) - moments.mean[f];
    for (size_t f = 0; f < n; ++f) {
      for (size_t g = 0; g < n; ++g) moments.covariance[f * n + g] += d[f] * d[g];
    }
  }
  for (double& covariance : moments.covariance) covariance /= static_cast<double>(rows);
  return moments;
}

void NeuralTexture::Rebase(const FeatureBasis& basis, ThreadPool& pool) {
  const auto n = static_cast<size_t>(shape_.features());
  std::vector<float> places(values_.size());
  const auto rows = static_cast<size_t>(shape_.texels());
  const size_t tasks = (rows + kRowsPerTask - 1) / kRowsPerTask;
  pool.ParallelFor(static_cast<int>(tasks), [&](int task, int) {
    const size_t first = static_cast<size_t>(task) * kRowsPerTask;
    const size_t end = std::min(rows, first + kRowsPerTask);
    for (size_t r = first; r < end; ++r) {
      for (size_t place = 0; place < n; ++place) {
        double y = 0;
        for (size_t f = 0; f < n; ++f)
          y += basis.forward[place * n + f] *
               (static_cast<double>(values_[r * kRowFloats + f]) - basis.mean[f]);
        places[r * kRowFloats + place] =
            static_cast<float>(1 + std::clamp(y, -kMostFromOne, kMostFromOne));
      }
    }
  });
  Start(places, pool);
  store_.ResetMoments();
}

void NeuralTexture::UseBlocks(ThreadPool& pool) {
  FeatureStore blocks;
  blocks.Allocate(StoreShape(shape_), BlockForm::kSegments, StoreUse::kAdam);
  InitBlocksFromFreeTexels(store_, pool, &blocks);
  store_ = std::move(blocks);
  saved_ = FeatureSnapshot();
  DecodeAll(pool);
}

std::vector<float> NeuralTexture::MakeSensitivity() const {
  return std::vector<float>(static_cast<size_t>(shape_.texels()) * shape_.textures * kProducts);
}

void NeuralTexture::AddSensitivity(const brdf::TexelTaps* taps, int count,
                                   const brdf::ChunkResult& result, std::span<float> sums) const {
  for (int s = 0; s < count; ++s) {
    const float* gradient = result.feature_gradient.data() +
                            static_cast<size_t>(s) * layout_.feature_columns() +
                            2 * layout_.feature_stride;
    for (int c = 0; c < 8; ++c) {
      const float weight = taps[s].weight[c];
      if (weight == 0) continue;
      for (int t = 0; t < shape_.textures; ++t) {
        const float x = gradient[3 * t], y = gradient[3 * t + 1], z = gradient[3 * t + 2];
        float* to =
            sums.data() + (static_cast<size_t>(taps[s].row[c]) * shape_.textures + t) * kProducts;
        const float products[kProducts] = {x * x, x * y, x * z, y * y, y * z, z * z};
        for (int p = 0; p < kProducts; ++p) to[p] += weight * products[p];
      }
    }
  }
}

void NeuralTexture::Encode(std::span<const float> sensitivity, ThreadPool& pool) {
  for (int t = 0; t < shape_.textures; ++t) {
    blocks_[t].clear();
    for (int l = 0; l < shape_.levels; ++l) {
      const FeatureLevel& level = store_.textures[t][l];
      std::vector<bc6h::Block>& out = blocks_[t].emplace_back(level.block_count());
      const size_t first = static_cast<size_t>(first_row_[l]);
      pool.ParallelFor(level.block_count(), [&, t](int block, int) {
        const int x0 = block % level.blocks_x * 4, y0 = block / level.blocks_x * 4;
        const auto row_of = [&](int k) {
          const int x = std::min(x0 + k % 4, level.width - 1);
          const int y = std::min(y0 + k / 4, level.height - 1);
          return first + static_cast<size_t>(y) * level.width + x;
        };
        bc6::WeightedTarget target;
        for (int k = 0; k < 16; ++k) {
          const bool inside = x0 + k % 4 < level.width && y0 + k / 4 < level.height;
          const size_t row = row_of(k);
          for (int c = 0; c < 3; ++c) target.value[c][k] = values_[row * kRowFloats + 3 * t + c];
          const float* products = sensitivity.data() + (row * shape_.textures + t) * kProducts;
          for (int p = 0; p < kProducts; ++p) target.hessian[p][k] = inside ? products[p] : 0.0f;
        }
        const bc6::EncodedBlock encoded = bc6::Encode(target, LoadSoftBlock(level, block));
        out[block] = encoded.bytes;
        float decoded[3][16];
        bc6::DecodeToFloat(encoded.fields, decoded);
        for (int k = 0; k < 16; ++k) {
          if (x0 + k % 4 >= level.width || y0 + k / 4 >= level.height) continue;
          for (int c = 0; c < 3; ++c) values_[row_of(k) * kRowFloats + 3 * t + c] = decoded[c][k];
        }
      });
    }
  }
  fixed_ = true;
}

void NeuralTexture::RoundToHalves() {
  for (size_t i = 0; i < values_.size(); ++i) values_[i] = HalfToFloat(FloatToHalf(values_[i]));
  fixed_ = true;
}

}  // namespace patina::svbrdf
