#include "pipeline/material/exporter.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace patina {
namespace {

// Newton damping: above 1 where the majorised Hessian is known to be too large (level 0 of the fine textures is seen by
// several samples a texel); larger steps on coarse levels diverge.
constexpr double kFineStep = 1.8;
constexpr double kRidge = 1e-3;

// The damped Newton step -k (H + ridge)^-1 g of one texel, each component at most half the value.
void WantedShift(const float sums[9], double step, const float value[3], float shift[3]) {
  const double trace = static_cast<double>(sums[3]) + sums[6] + sums[8];
  shift[0] = shift[1] = shift[2] = 0;
  if (!(trace > 1e-20)) return;
  const double ridge = kRidge * trace / 3;
  const double xx = sums[3] + ridge, xy = sums[4], xz = sums[5], yy = sums[6] + ridge, yz = sums[7], zz = sums[8] + ridge;
  const double c00 = yy * zz - yz * yz, c01 = xz * yz - xy * zz, c02 = xy * yz - xz * yy;
  const double determinant = xx * c00 + xy * c01 + xz * c02;
  if (!(determinant > 1e-12 * trace * trace * trace)) return;
  const double c11 = xx * zz - xz * xz, c12 = xy * xz - xx * yz, c22 = xx * yy - xy * xy;
  const double g0 = sums[0], g1 = sums[1], g2 = sums[2];
  const double solved[3] = {c00 * g0 + c01 * g1 + c02 * g2, c01 * g0 + c11 * g1 + c12 * g2, c02 * g0 + c12 * g1 + c22 * g2};
  for (int d = 0; d < 3; ++d) {
    const double limit = 0.5 * std::abs(static_cast<double>(value[d]));
    shift[d] = static_cast<float>(std::clamp(-step * solved[d] / determinant, -limit, limit));
  }
}

bc6::SoftBlock LoadSoftBlock(const FeatureLevel& level, int block) {
  const float* params = level.params.data() + static_cast<size_t>(block) * BlockStride(BlockForm::kSegments);
  bc6::SoftBlock soft;
  for (int e = 0; e < 4; ++e) {
    for (int c = 0; c < 3; ++c) soft.endpoint[e][c] = params[e * 3 + c];
  }
  std::memcpy(soft.index, params + 16, sizeof soft.index);
  soft.partition = level.partition[block];
  return soft;
}

float ValueOfBinades(float binades) {
  const float exponent = std::floor(binades);
  return std::ldexp(1 + binades - exponent, static_cast<int>(exponent) - 15);
}

void SoftTexels(const bc6::SoftBlock& soft, float out[3][16]) {
  const uint16_t mask = bc6h::PartitionMask(soft.partition);
  for (int k = 0; k < 16; ++k) {
    const int region = (mask >> k) & 1;
    for (int c = 0; c < 3; ++c) {
      const float a = soft.endpoint[2 * region][c], b = soft.endpoint[2 * region + 1][c];
      out[c][k] = ValueOfBinades(a + soft.index[k] * (b - a));
    }
  }
}

// What a block should become: each texel's Newton step by `planes` from its value now, and what a deviation costs.
bc6::WeightedTarget WantedBlock(const float* planes, const FeatureLevel& level, int bx, int by, double step, const float texels[3][16]) {
  const size_t plane = static_cast<size_t>(level.width) * level.height;
  bc6::WeightedTarget target;
  for (int k = 0; k < 16; ++k) {
    const int x = 4 * bx + (k & 3), y = 4 * by + (k >> 2);
    float sums[9] = {};
    const float value[3] = {texels[0][k], texels[1][k], texels[2][k]};
    if (x < level.width && y < level.height) {
      for (int c = 0; c < 9; ++c) sums[c] = planes[c * plane + static_cast<size_t>(y) * level.width + x];
    }
    float shift[3];
    WantedShift(sums, step, value, shift);
    for (int c = 0; c < 3; ++c) target.value[c][k] = value[c] + shift[c];
    for (int c = 0; c < 6; ++c) target.hessian[c][k] = sums[3 + c];
  }
  return target;
}

}  // namespace

Exporter::Exporter(Trainer* trainer, const ModelShape& shape, FeatureStore* store, ThreadPool& pool)
    : trainer_(trainer), shape_(shape), store_(store), pool_(pool) {
  for (int t = 0; t < kFeatureTextures; ++t) {
    for (const FeatureLevel& level : store->textures[t]) {
      fields_[t].emplace_back(level.block_count());
      blocks_[t].emplace_back(level.block_count());
    }
  }
}

void Exporter::StoreEncoded(const bc6::EncodedBlock& encoded, int texture, int level_index, int block) {
  fields_[texture][level_index][block] = encoded.fields;
  blocks_[texture][level_index][block] = encoded.bytes;
  FeatureLevel& level = store_->textures[texture][level_index];
  float* params = level.params.data() + static_cast<size_t>(block) * BlockStride(BlockForm::kSegments);
  for (int e = 0; e < 4; ++e) {
    for (int c = 0; c < 3; ++c) params[e * 3 + c] = std::clamp(encoded.soft.endpoint[e][c], kMinBinade, kMaxBinade);
  }
  std::memcpy(params + 16, encoded.soft.index, sizeof encoded.soft.index);
  level.partition[block] = static_cast<uint8_t>(encoded.soft.partition);
}

template <class EncodeBlock>
void Exporter::PassTexture(int texture, int first_level, bool guarded_pass, EncodeBlock&& encode) {
  AlignedBuffer<float> planes;
  for (int l = first_level; l < shape_[texture].levels; ++l) {
    trainer_->Sensitivity(texture, l, &planes);
    const FeatureLevel& level = store_->textures[texture][l];
    const bool guarded = guarded_pass && l > 0;
    const double error_before = guarded ? trainer_->MipError(shape_[texture].lod_shift + l) : 0;
    const LevelState before = guarded ? SaveLevel(texture, l) : LevelState{};
    const double step = l == 0 && texture < 3 ? kFineStep : 1.0;
    pool_.ParallelFor(level.blocks_y, [&](int by, int) {
      for (int bx = 0; bx < level.blocks_x; ++bx) {
        const int block = by * level.blocks_x + bx;
        const bc6::SoftBlock current = LoadSoftBlock(level, block);
        float texels[3][16];
        SoftTexels(current, texels);
        StoreEncoded(encode(WantedBlock(planes.data(), level, bx, by, step, texels), current, fields_[texture][l][block]), texture, l, block);
      }
    });
    if (guarded && trainer_->MipError(shape_[texture].lod_shift + l) > error_before) RestoreLevel(texture, l, before);
  }
}

Exporter::LevelState Exporter::SaveLevel(int texture, int level_index) const {
  const FeatureLevel& level = store_->textures[texture][level_index];
  return {fields_[texture][level_index], blocks_[texture][level_index],
          std::vector<float>(level.params.data(), level.params.data() + level.params.size()),
          std::vector<uint8_t>(level.partition.data(), level.partition.data() + level.partition.size())};
}

void Exporter::RestoreLevel(int texture, int level_index, const LevelState& state) {
  FeatureLevel& level = store_->textures[texture][level_index];
  fields_[texture][level_index] = state.fields;
  blocks_[texture][level_index] = state.blocks;
  std::copy(state.params.begin(), state.params.end(), level.params.data());
  std::copy(state.partition.begin(), state.partition.end(), level.partition.data());
}

void Exporter::Encode(bc6::Effort effort) {
  for (int t = 0; t < kFeatureTextures; ++t) {
    PassTexture(t, 0, false, [effort](const bc6::WeightedTarget& target, const bc6::SoftBlock& current, const bc6h::BlockFields&) {
      return bc6::Encode(target, current, effort);
    });
  }
  store_->ResetMoments();
}

void Exporter::Refine(int first_level) {
  for (int t = 0; t < kFeatureTextures; ++t) {
    PassTexture(t, first_level, true, [](const bc6::WeightedTarget& target, const bc6::SoftBlock&, const bc6h::BlockFields& fields) {
      return bc6::Refine(target, fields);
    });
  }
  store_->ResetMoments();
}

void Exporter::EncodeSixBit() {
  for (int t = 0; t < kFeatureTextures; ++t) {
    for (int l = 0; l < shape_[t].levels; ++l) {
      FeatureLevel& level = store_->textures[t][l];
      pool_.ParallelFor(level.block_count(), [&](int block, int) {
        const bc6::SoftBlock current = LoadSoftBlock(level, block);
        bc6::EncodedBlock encoded;
        encoded.fields.mode = bc6h::kModeSixBit;
        encoded.fields.partition = current.partition;
        for (int e = 0; e < 4; ++e) {
          for (int c = 0; c < 3; ++c) {
            int best = 0;
            float best_distance = 1e30f;
            for (int code = 0; code < 64; ++code) {
              const float binades = static_cast<float>(
                  bc6h::FinishUnquantize(bc6h::Unquantize(code, 6, bc6h::Format::kUf16), bc6h::Format::kUf16)) / 1024;
              const float distance = std::abs(binades - current.endpoint[e][c]);
              if (distance < best_distance) {
                best_distance = distance;
                best = code;
              }
            }
            encoded.fields.endpoints[e][c] = best;
          }
        }
        for (int k = 0; k < 16; ++k) {
          int best = 0;
          for (int i = 1; i < 8; ++i) {
            const auto distance = [&](int index) {
              return std::abs(static_cast<float>(bc6h::kWeights3[index]) / 64 - current.index[k]);
            };
            if (distance(i) < distance(best)) best = i;
          }
          encoded.fields.indices[k] = static_cast<uint8_t>(best);
        }
        bc6h::FixAnchors(&encoded.fields);
        if (auto bytes = bc6h::Pack(encoded.fields, bc6h::Format::kUf16)) encoded.bytes = *bytes;
        encoded.soft.partition = encoded.fields.partition;
        for (int e = 0; e < 4; ++e) {
          for (int c = 0; c < 3; ++c) {
            encoded.soft.endpoint[e][c] =
                static_cast<float>(bc6h::FinishUnquantize(
                    bc6h::Unquantize(encoded.fields.endpoints[e][c], 6, bc6h::Format::kUf16), bc6h::Format::kUf16)) / 1024;
          }
        }
        for (int k = 0; k < 16; ++k) {
          encoded.soft.index[k] = static_cast<float>(bc6h::kWeights3[encoded.fields.indices[k]]) / 64;
        }
        StoreEncoded(encoded, t, l, block);
      });
    }
  }
  store_->ResetMoments();
}

std::array<std::vector<std::vector<bc6h::Block>>, kFeatureTextures> Exporter::TakeBlocks() { return std::move(blocks_); }

void Exporter::DecodeTo(FeatureStore* free_store) const {
  free_store->Allocate(shape_, BlockForm::kFree, StoreUse::kFixed);
  for (int t = 0; t < kFeatureTextures; ++t) {
    for (int l = 0; l < shape_[t].levels; ++l) DecodeLevel(t, l, free_store);
  }
}

void Exporter::DecodeLevel(int texture, int level_index, FeatureStore* free_store) const {
  FeatureLevel& level = free_store->textures[texture][level_index];
  pool_.ParallelFor(level.blocks_y, [&](int by, int) {
    for (int bx = 0; bx < level.blocks_x; ++bx) {
      const int block = by * level.blocks_x + bx;
      float texels[3][16];
      bc6::DecodeToFloat(fields_[texture][level_index][block], texels);
      std::memcpy(level.params.data() + static_cast<size_t>(block) * BlockStride(BlockForm::kFree), texels, sizeof texels);
    }
  });
}

void Exporter::Polish(int rounds, Trainer* exact, FeatureStore* decoded) {
  AlignedBuffer<float> planes;
  for (int round = 0; round < rounds; ++round) {
    for (int t = 0; t < kFeatureTextures; ++t) {
      for (int l = 1; l < shape_[t].levels; ++l) {
        FeatureLevel& level = decoded->textures[t][l];
        if (level.block_count() > kPolishedBlocks) continue;
        const int mip = shape_[t].lod_shift + l;
        exact->Sensitivity(t, l, &planes);
        const double error_before = exact->MipError(mip);
        const LevelState before = SaveLevel(t, l);
        pool_.ParallelFor(level.block_count(), [&](int block, int) {
          float texels[3][16];
          std::memcpy(texels, level.params.data() + static_cast<size_t>(block) * BlockStride(BlockForm::kFree), sizeof texels);
          const bc6::WeightedTarget target =
              WantedBlock(planes.data(), level, block % level.blocks_x, block / level.blocks_x, 1.0, texels);
          StoreEncoded(round % 2 == 0 ? bc6::Encode(target, LoadSoftBlock(store_->textures[t][l], block))
                                      : bc6::Refine(target, fields_[t][l][block]),
                       t, l, block);
        });
        DecodeLevel(t, l, decoded);
        if (exact->MipError(mip) > error_before) {
          RestoreLevel(t, l, before);
          DecodeLevel(t, l, decoded);
        }
      }
    }
  }
}

}  // namespace patina
