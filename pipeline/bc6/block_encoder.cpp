#include "pipeline/bc6/block_encoder.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "formats/base/check.h"
#include "formats/half.h"
#include "pipeline/bc6/block_kernels.h"
#include "pipeline/kernels/dispatch.h"

namespace patina::bc6 {
namespace {

BlockTables MakeTables() {
  BlockTables tables = {};
  for (int p = 0; p < bc6h::kPartitionCount; ++p) {
    tables.mask[p] = bc6h::PartitionMask(p);
    for (int t = 0; t < 16; ++t) {
      tables.member[p / 16][t][p % 16] = static_cast<float>((tables.mask[p] >> t) & 1);
    }
  }
  for (int k = 0; k < 16; ++k) {
    tables.weight[0][k] = static_cast<float>(bc6h::kWeights3[k % 8]);
    tables.weight[1][k] = static_cast<float>(bc6h::kWeights4[k]);
  }
  for (int m = 0; m < bc6h::kModeCount; ++m) {
    const bc6h::ModeInfo& info = bc6h::Mode(m);
    ModeLimits& limits = tables.mode[m];
    limits.max_code = static_cast<float>((1 << info.endpoint_bits) - 1);
    limits.offset = info.endpoint_bits >= 15 ? 0.0f : 0.5f;
    limits.step = std::ldexp(31.0f, -info.endpoint_bits);
    limits.inverse_step = 1.0f / limits.step;
    limits.wide_step = std::ldexp(1.0f, 10 - info.endpoint_bits);
    limits.transformed = info.transformed;
    for (int c = 0; c < 3; ++c)
      limits.half_range[c] = static_cast<float>(1 << (info.delta_bits[c] - 1));
  }
  for (int table = 0; table < 2; ++table) {
    ModeLanes& lanes = tables.lanes[table];
    lanes.first_mode = table == 0 ? 0 : 10;
    lanes.count = table == 0 ? 10 : 4;
    for (int l = 0; l < 16; ++l) {
      const ModeLimits& limits = tables.mode[lanes.first_mode + std::min(l, lanes.count - 1)];
      lanes.step[l] = limits.step;
      lanes.inverse_step[l] = limits.inverse_step;
      lanes.offset[l] = limits.offset;
      lanes.max_code[l] = limits.max_code;
      for (int c = 0; c < 3; ++c) {
        lanes.half_range[c][l] = limits.transformed ? limits.half_range[c] : 0x1p20f;
      }
    }
  }
  return tables;
}

const BlockKernels& Kernels() {
  const Result<SimdTarget> target = ActiveSimdTarget();
  PATINA_CHECK(target.has_value());  // programs test the CPU before they start to work
  return *target == SimdTarget::kAvx512 ? kBlockKernelsAvx512 : kBlockKernelsAvx2;
}

SoftBlock SoftOf(const bc6h::BlockFields& fields, int soft_partition) {
  const bc6h::ModeInfo& mode = bc6h::Mode(fields.mode);
  SoftBlock soft;
  soft.partition = mode.regions == 2 ? fields.partition : soft_partition;
  for (int e = 0; e < 4; ++e) {
    for (int c = 0; c < 3; ++c) {
      const int code = fields.endpoints[mode.regions == 2 ? e : e % 2][c];
      const auto wide =
          static_cast<float>(bc6h::Unquantize(code, mode.endpoint_bits, bc6h::Format::kUf16));
      soft.endpoint[e][c] = std::clamp(wide * (31.0f / 65536), 1.0f, 30.9f);
    }
  }
  for (int t = 0; t < 16; ++t) {
    const int weight = mode.index_bits == 3 ? bc6h::kWeights3[fields.indices[t]]
                                            : bc6h::kWeights4[fields.indices[t]];
    soft.index[t] = static_cast<float>(weight) * (1.0f / 64);
  }
  return soft;
}

EncodedBlock Finish(const SearchResult& found) {
  EncodedBlock block;
  block.fields = found.fields;
  Result<bc6h::Block> bytes = bc6h::Pack(found.fields, bc6h::Format::kUf16);
  PATINA_CHECK(bytes.has_value());  // the search keeps to what a mode can hold
  block.bytes = *bytes;
  block.soft = SoftOf(found.fields, found.soft_partition);
  block.error = found.error;
  return block;
}

}  // namespace

const BlockTables& Tables() {
  static const BlockTables tables = MakeTables();
  return tables;
}

SoftBlock FitTexels(const float texels[3][16]) {
  SoftBlock block;
  Kernels().fit_texels(texels, &block);
  return block;
}

EncodedBlock Encode(const WeightedTarget& target, const SoftBlock& current, Effort effort) {
  SearchResult found;
  Kernels().encode(target, current, effort, &found);
  return Finish(found);
}

EncodedBlock Refine(const WeightedTarget& target, const bc6h::BlockFields& current) {
  SearchResult found;
  Kernels().refine(target, current, &found);
  return Finish(found);
}

void DecodeToFloat(const bc6h::BlockFields& fields, float out[3][16]) {
  const bc6h::ModeInfo& mode = bc6h::Mode(fields.mode);
  int32_t wide[4][3];
  for (int e = 0; e < 2 * mode.regions; ++e) {
    for (int c = 0; c < 3; ++c) {
      wide[e][c] =
          bc6h::Unquantize(fields.endpoints[e][c], mode.endpoint_bits, bc6h::Format::kUf16);
    }
  }
  const unsigned mask = mode.regions == 2 ? bc6h::PartitionMask(fields.partition) : 0u;
  for (int t = 0; t < 16; ++t) {
    const int region = (mask >> t) & 1;
    const int weight = mode.index_bits == 3 ? bc6h::kWeights3[fields.indices[t]]
                                            : bc6h::kWeights4[fields.indices[t]];
    for (int c = 0; c < 3; ++c) {
      const int32_t value = bc6h::Interpolate(wide[2 * region][c], wide[2 * region + 1][c], weight);
      out[c][t] = HalfToFloat(bc6h::FinishUnquantize(value, bc6h::Format::kUf16));
    }
  }
}

}  // namespace patina::bc6
