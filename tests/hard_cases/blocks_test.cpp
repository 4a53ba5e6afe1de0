// Degenerate blocks and the limits of halves, through writers, readers and the decoder that engines
// copy.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/half.h"
#include "formats/index_pack.h"
#include "formats/weights.h"
#include "tests/hard_cases/map_cases.h"
#include "tests/hard_cases/material_runs.h"

namespace patina {
namespace {

using bc6h::BlockFields;
using bc6h::Format;

// Calls body(fields, format) with mode and partition set.
template <class Body>
void ForEveryModeAndPartition(Body&& body) {
  for (const Format format : {Format::kUf16, Format::kSf16}) {
    for (int mode = 0; mode < bc6h::kModeCount; ++mode) {
      for (int partition = 0;
           partition < (bc6h::Mode(mode).regions == 2 ? bc6h::kPartitionCount : 1); ++partition) {
        SCOPED_TRACE("mode " + std::to_string(mode) + " partition " + std::to_string(partition) +
                     (format == Format::kSf16 ? " signed" : ""));
        BlockFields fields;
        fields.mode = mode;
        fields.partition = partition;
        body(fields, format);
      }
    }
  }
}

int32_t LargestCode(int bits, Format format) {
  return format == Format::kUf16 ? (1 << bits) - 1 : (1 << (bits - 1)) - 1;
}

// With equal endpoints every index says the same, also those that an anchor cannot hold.
TEST(HardBlocks, EqualEndpointsGiveOneColourWhateverTheIndices) {
  ForEveryModeAndPartition([](BlockFields fields, Format format) {
    const bc6h::ModeInfo& mode = bc6h::Mode(fields.mode);
    const int32_t largest = LargestCode(mode.endpoint_bits, format);
    const int32_t smallest = format == Format::kUf16 ? 0 : -largest;
    for (const int32_t code : {smallest, int32_t{0}, int32_t{1}, largest}) {
      for (auto& endpoint : fields.endpoints) std::fill(endpoint, endpoint + 3, code);
      for (int t = 0; t < 16; ++t)
        fields.indices[t] = static_cast<uint8_t>((1 << mode.index_bits) - 1 - t % 3);
      bc6h::FixAnchors(&fields);
      const auto block = bc6h::Pack(fields, format);
      ASSERT_TRUE(block) << block.error().message;
      uint16_t texels[16][3];
      bc6h::Decode(block->data(), format, texels);
      const uint16_t wanted =
          bc6h::FinishUnquantize(bc6h::Unquantize(code, mode.endpoint_bits, format), format);
      for (const auto& texel : texels) {
        for (const uint16_t half : texel) {
          ASSERT_EQ(half, wanted);
          ASSERT_TRUE(HalfIsFinite(half));
        }
      }
    }
  });
}

// Each anchor's top bit set, alone and together: refused as it is, and put right without a change
// of what is decoded.
TEST(HardBlocks, AnchorsThatTheirBitsCannotHoldAreRefusedOrMended) {
  ForEveryModeAndPartition([](BlockFields fields, Format format) {
    const bc6h::ModeInfo& mode = bc6h::Mode(fields.mode);
    const bool two = mode.regions == 2;
    const int top = 1 << (mode.index_bits - 1);
    const int anchors[2] = {0, two ? bc6h::AnchorTexel(fields.partition) : 0};
    // As far apart as the smallest delta allows, and with both signs.
    for (int e = 0; e < 2 * mode.regions; ++e) {
      for (int c = 0; c < 3; ++c) fields.endpoints[e][c] = 20 + ((e + c) % 2 == 0 ? 3 : -3);
    }
    for (int which = 1; which < (two ? 4 : 2); ++which) {
      for (int t = 0; t < 16; ++t) fields.indices[t] = static_cast<uint8_t>(t % top);
      for (int region = 0; region < 2; ++region) {
        if ((which >> region & 1) != 0)
          fields.indices[anchors[region]] = static_cast<uint8_t>(2 * top - 1);
      }
      EXPECT_FALSE(bc6h::Pack(fields, format));
      BlockFields mended = fields;
      bc6h::FixAnchors(&mended);
      const auto block = bc6h::Pack(mended, format);
      ASSERT_TRUE(block) << block.error().message;
      uint16_t texels[16][3];
      bc6h::Decode(block->data(), format, texels);
      const unsigned mask = two ? bc6h::PartitionMask(fields.partition) : 0;
      for (int t = 0; t < 16; ++t) {
        const int region = static_cast<int>(mask >> t & 1);
        const int weight =
            two ? bc6h::kWeights3[fields.indices[t]] : bc6h::kWeights4[fields.indices[t]];
        for (int c = 0; c < 3; ++c) {
          const int32_t a =
              bc6h::Unquantize(fields.endpoints[2 * region][c], mode.endpoint_bits, format);
          const int32_t b =
              bc6h::Unquantize(fields.endpoints[2 * region + 1][c], mode.endpoint_bits, format);
          ASSERT_EQ(texels[t][c], bc6h::FinishUnquantize(bc6h::Interpolate(a, b, weight), format));
        }
      }
    }
  });
}

const uint16_t kLimits[] = {0x0000, 0x8000, 0x0001, 0x8001,
                            0x03FF, 0x0400, 0x7BFF, 0xFBFF};  // 0, denormals, 65504

TEST(HalfLimits, GoThroughWeightsAndCodebooksBitByBit) {
  WeightBuffer buffer{{{"a", {8}, {std::begin(kLimits), std::end(kLimits)}}}};
  const auto bytes = EncodeWeights(buffer);
  ASSERT_TRUE(bytes);
  EXPECT_EQ(ParseWeights(*bytes)->tensors[0].elements, buffer.tensors[0].elements);
  const std::vector<uint16_t> halves(std::begin(kLimits), std::end(kLimits));
  const auto codebook = EncodeCodebook({8, halves});
  ASSERT_TRUE(codebook);
  const auto again = ParseCodebook(*codebook);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->halves, halves);
}

// Features of 65504 and weights of +-65504 meet: 1e16 at most, which a float holds.
TEST(HalfLimits, TheLargestFeaturesAndWeightsDecodeToFiniteValues) {
  const MaterialReference reference = test::ReferenceOf(test::OrdinaryMap(8, 4, 3));
  TrainedMaterial model;
  model.shape = ShapeForProfile(Profile::kBcf1k, 8, 4);
  model.outputs = 3;
  BlockFields fields;
  fields.mode = 13;  // 16 bits
  for (auto& endpoint : fields.endpoints) std::fill(endpoint, endpoint + 3, 0xFFFF);
  const auto block = bc6h::Pack(fields, Format::kUf16);
  ASSERT_TRUE(block);
  for (int t = 0; t < kFeatureTextures; ++t) {
    for (int level = 0; level < model.shape[t].levels; ++level) {
      const int width = std::max(1, model.shape[t].width >> level),
                height = std::max(1, model.shape[t].height >> level);
      model.blocks[t].emplace_back(static_cast<size_t>((width + 3) / 4) * ((height + 3) / 4),
                                   *block);
    }
  }
  model.w1.assign(kNetworkHidden * kNetworkInputs, kMaxHalf);
  model.b1.assign(kNetworkHidden, kMaxHalf);
  model.w2.assign(3 * kNetworkHidden, kMaxHalf);
  for (size_t i = 0; i < kNetworkHidden; ++i) model.w2[i] = -kMaxHalf;
  for (size_t i = 0; i < kNetworkHidden; ++i) model.w2[2 * kNetworkHidden + i] = 0x1p-24f;
  model.b2 = {-0.0f, kMaxHalf, 0x1p-24f};
  const auto planes = test::DecodeMip0(model, reference);
  // Every step is exact or rounds to 24 bits, the accumulation of 12 and 16 terms to a few parts in
  // 1e6.
  const double hidden = 12.0 * 65504 * 65504 + 65504, output = 16 * hidden * 65504;
  EXPECT_NEAR(static_cast<double>(planes[0][0]), -1e6, 1e-6 * 1e6)
      << "clamped to the channel's range";
  EXPECT_NEAR(static_cast<double>(planes[1][0]), 1e6, 1e-6 * 1e6);
  EXPECT_NEAR(static_cast<double>(planes[2][0]), std::min(1e6, 16 * hidden * 0x1p-24), 1);
  EXPECT_TRUE(std::isfinite(static_cast<float>(output)));
}

}  // namespace
}  // namespace patina
