#include "formats/bc6h.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "tests/formats/test_support.h"

namespace patina::bc6h {
namespace {

using test::Random;
using test::RandomBlock;

constexpr Format kFormats[] = {Format::kUf16, Format::kSf16};

TEST(Bc6hPack, GivesBackEveryBitOfEveryLegalBlock) {
  Random random(1);
  for (const Format format : kFormats) {
    for (int mode = 0; mode < kModeCount; ++mode) {
      for (int i = 0; i < 4000; ++i) {
        const Block block = RandomBlock(random, mode);
        const auto fields = Unpack(block.data(), format);
        ASSERT_TRUE(fields.has_value());
        ASSERT_EQ(fields->mode, mode);
        const auto packed = Pack(*fields, format);
        ASSERT_OK(packed);
        ASSERT_EQ(*packed, block) << "mode " << mode;
      }
    }
  }
}

TEST(Bc6hPack, PlacesEverySingleBit) {
  for (const Format format : kFormats) {
    for (int mode = 0; mode < kModeCount; ++mode) {
      for (int bit = Mode(mode).mode_bit_count; bit < 128; ++bit) {
        Block block{};
        block[0] = static_cast<uint8_t>(Mode(mode).mode_bits);
        block[bit / 8] = static_cast<uint8_t>(block[bit / 8] | 1 << (bit % 8));
        const auto fields = Unpack(block.data(), format);
        ASSERT_TRUE(fields.has_value());
        const auto packed = Pack(*fields, format);
        ASSERT_OK(packed);
        ASSERT_EQ(*packed, block) << "mode " << mode << " bit " << bit;
      }
    }
  }
}

TEST(Bc6hPack, RefusesWhatDoesNotFit) {
  BlockFields fields;
  EXPECT_TRUE(Pack(fields, Format::kUf16).has_value());
  const auto refuses = [](BlockFields changed, Format format) {
    const auto result = Pack(changed, format);
    return !result && result.error().code == ErrorCode::kOutOfRange;
  };
  BlockFields changed = fields;
  changed.mode = 14;
  EXPECT_TRUE(refuses(changed, Format::kUf16));
  changed.mode = -1;
  EXPECT_TRUE(refuses(changed, Format::kUf16));
  changed = fields;
  changed.partition = 32;
  EXPECT_TRUE(refuses(changed, Format::kUf16));
  changed.mode = 10;
  changed.partition = 1;
  EXPECT_TRUE(refuses(changed, Format::kUf16));
  changed = fields;
  changed.endpoints[3][2] = 64;
  EXPECT_TRUE(refuses(changed, Format::kUf16));
  changed.endpoints[3][2] = -1;
  EXPECT_TRUE(refuses(changed, Format::kUf16));
  EXPECT_FALSE(refuses(changed, Format::kSf16));
  changed.endpoints[3][2] = 32;
  EXPECT_TRUE(refuses(changed, Format::kSf16));
  changed = fields;
  changed.indices[0] = 4;
  EXPECT_TRUE(refuses(changed, Format::kUf16));
  changed.indices[0] = 0;
  changed.indices[1] = 8;
  EXPECT_TRUE(refuses(changed, Format::kUf16));
  changed = fields;
  changed.mode = 0;  // 10 bits with deltas of 5 bits: -16..15
  changed.endpoints[0][0] = 500;
  for (int e = 1; e < 4; ++e) changed.endpoints[e][0] = 500;
  changed.endpoints[2][0] = 515;
  EXPECT_FALSE(refuses(changed, Format::kUf16));
  changed.endpoints[2][0] = 516;
  EXPECT_TRUE(refuses(changed, Format::kUf16));
  changed.endpoints[2][0] = 484;
  EXPECT_FALSE(refuses(changed, Format::kUf16));
}

TEST(Bc6hPack, UsesDeltasThatWrapAround) {
  BlockFields fields;
  fields.mode = 0;
  for (auto& endpoint : fields.endpoints) endpoint[0] = endpoint[1] = endpoint[2] = 1020;
  fields.endpoints[1][1] = 3;  // 1020 + 7 modulo 1024
  const auto block = Pack(fields, Format::kUf16);
  ASSERT_OK(block);
  EXPECT_EQ(Unpack(block->data(), Format::kUf16)->endpoints[1][1], 3);
}

TEST(Bc6hUnpack, RejectsReservedModes) {
  Random random(2);
  for (int mode = kModeCount; mode < kModeCount + 4; ++mode) {
    const Block block = RandomBlock(random, mode);
    EXPECT_FALSE(Unpack(block.data(), Format::kUf16).has_value());
    uint16_t texels[16][3];
    std::memset(texels, 0xFF, sizeof texels);
    Decode(block.data(), Format::kSf16, texels);
    for (const auto& texel : texels) EXPECT_EQ(texel[0] | texel[1] | texel[2], 0);
  }
}

TEST(Bc6hFixAnchors, KeepsTheDecodedTexels) {
  Random random(3);
  // The modes without deltas: any two endpoints may be exchanged.
  for (const int mode : {kModeSixBit, 10}) {
    for (const Format format : kFormats) {
      for (int i = 0; i < 3000; ++i) {
        BlockFields fields = *Unpack(RandomBlock(random, mode).data(), format);
        const int count = 1 << Mode(mode).index_bits;
        for (auto& index : fields.indices) index = static_cast<uint8_t>(random.Below(count));
        // Decoded from the definition, since the block cannot be written before the anchors are
        // right.
        uint16_t wanted[16][3];
        const int mask = Mode(mode).regions == 2 ? PartitionMask(fields.partition) : 0;
        for (int t = 0; t < 16; ++t) {
          const int region = (mask >> t) & 1;
          for (int c = 0; c < 3; ++c) {
            const int bits = Mode(mode).endpoint_bits;
            const int32_t a = Unquantize(fields.endpoints[2 * region][c], bits, format);
            const int32_t b = Unquantize(fields.endpoints[2 * region + 1][c], bits, format);
            const int weight =
                count == 8 ? kWeights3[fields.indices[t]] : kWeights4[fields.indices[t]];
            wanted[t][c] = FinishUnquantize(Interpolate(a, b, weight), format);
          }
        }
        FixAnchors(&fields);
        const auto block = Pack(fields, format);
        ASSERT_OK(block);
        uint16_t texels[16][3];
        Decode(block->data(), format, texels);
        ASSERT_EQ(std::memcmp(texels, wanted, sizeof wanted), 0) << "mode " << mode;
        const BlockFields fixed = fields;
        FixAnchors(&fields);
        EXPECT_EQ(std::memcmp(fixed.indices, fields.indices, sizeof fields.indices), 0)
            << "not idempotent";
      }
    }
  }
}

TEST(Bc6hPartition, AnchorsLieInRegionOneAndTexelZeroInRegionZero) {
  for (int p = 0; p < kPartitionCount; ++p) {
    EXPECT_EQ(PartitionMask(p) & 1, 0) << p;
    EXPECT_EQ((PartitionMask(p) >> AnchorTexel(p)) & 1, 1) << p;
    for (int q = 0; q < p; ++q) EXPECT_NE(PartitionMask(p), PartitionMask(q));
  }
}

TEST(Bc6hUnquantize, CoversTheWholeScaleInRisingOrder) {
  for (const Format format : kFormats) {
    for (const int bits : {6, 7, 8, 9, 10, 11, 12, 16}) {
      const int32_t low = format == Format::kUf16 ? 0 : -(1 << (bits - 1)) + 1;
      const int32_t high = format == Format::kUf16 ? (1 << bits) - 1 : (1 << (bits - 1)) - 1;
      EXPECT_EQ(Unquantize(low, bits, format), format == Format::kUf16 ? 0 : -0x7FFF);
      EXPECT_EQ(Unquantize(high, bits, format), format == Format::kUf16 ? 0xFFFF : 0x7FFF);
      for (int32_t code = low + 1; code <= high; ++code) {
        ASSERT_GT(Unquantize(code, bits, format), Unquantize(code - 1, bits, format))
            << bits << " bits, " << code;
      }
    }
  }
}

TEST(Bc6hFinishUnquantize, NeverGivesInfinityForUnsigned) {
  EXPECT_EQ(FinishUnquantize(0xFFFF, Format::kUf16), 0x7BFF);
  EXPECT_EQ(FinishUnquantize(0x7FFF, Format::kSf16), 0x7BFF);
  EXPECT_EQ(FinishUnquantize(-0x7FFF, Format::kSf16), 0xFBFF);
  EXPECT_EQ(FinishUnquantize(0, Format::kUf16), 0);
}

}  // namespace
}  // namespace patina::bc6h
