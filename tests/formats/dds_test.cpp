#include "formats/dds.h"

#include <gtest/gtest.h>

#include <cstring>

#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"
#include "tests/formats/test_support.h"

namespace patina {
namespace {

using test::MessageOf;
using test::Random;

std::vector<uint8_t> SmallFile() {
  Random random(21);
  return *EncodeDds(bc6h::Format::kUf16, 9, 5, test::RandomLevels(random, 9, 5, 4));
}

Result<DdsTexture> WithField(std::vector<uint8_t> bytes, int offset, uint32_t value) {
  StoreLittle32(bytes.data() + offset, value);
  return ParseDds(bytes);
}

TEST(DdsEncode, WritesTheHeaderByteForByte) {
  Random random(22);
  const auto levels = test::RandomLevels(random, 9, 5, 4);
  const auto bytes = EncodeDds(bc6h::Format::kSf16, 9, 5, levels);
  ASSERT_OK(bytes);
  const uint32_t golden[37] = {
      0x20534444, 124, 0x000A1007, 5, 9, 3 * 2 * 16, 1, 4, 0, 0,
      0,          0,   0,          0, 0, 0,          0, 0, 0,  // magic .. reserved1
      32,         4,   0x30315844, 0, 0, 0,          0, 0,     // pixel format
      0x00401008, 0,   0,          0, 0,                       // caps .. reserved2
      96,         3,   0,          1, 0};                      // DX10
  for (int i = 0; i < 37; ++i)
    EXPECT_EQ(LoadLittle32(bytes->data() + 4 * i), golden[i]) << "byte " << 4 * i;
  ASSERT_EQ(bytes->size(), 148u + 16 * (6 + 1 + 1 + 1));
  EXPECT_EQ(std::memcmp(bytes->data() + 148, levels[0].data(), 6 * 16), 0);
  EXPECT_EQ(std::memcmp(bytes->data() + 148 + 6 * 16, levels[1].data(), 16), 0);
  EXPECT_EQ(std::memcmp(bytes->data() + 148 + 8 * 16, levels[3].data(), 16), 0);
}

TEST(DdsEncode, WritesASingleLevelWithoutMipCaps) {
  const std::vector<std::vector<bc6h::Block>> levels(1, std::vector<bc6h::Block>(1));
  const auto bytes = EncodeDds(bc6h::Format::kUf16, 1, 1, levels);
  ASSERT_OK(bytes);
  EXPECT_EQ(LoadLittle32(bytes->data() + 108), 0x1000u);
  EXPECT_EQ(LoadLittle32(bytes->data() + 128), 95u);
}

std::vector<uint8_t> SmallHalves() {
  Random random(25);
  return *EncodeHalvesDds(9, 5, test::RandomHalfLevels(random, 9, 5, 4));
}

TEST(DdsEncodeHalves, WritesHeaderAndTexelsByteForByte) {
  const std::vector<std::vector<uint16_t>> levels = {
      {0x3C00, 0xC000, 0x0001, 0x7BFF, 0x8000, 0x1234}, {0xFBFF, 0x0000, 0x83FF}};
  const auto bytes = EncodeHalvesDds(2, 1, levels);
  ASSERT_OK(bytes);
  const uint32_t golden[43] = {
      0x20534444, 124, 0x0002100F, 1, 2, 2 * 8, 1, 2, 0, 0,
      0,          0,   0,          0, 0, 0,     0, 0, 0,  // magic .. reserved1
      32,         4,   0x30315844, 0, 0, 0,     0, 0,     // pixel format
      0x00401008, 0,   0,          0, 0,                  // caps .. reserved2
      10,         3,   0,          1, 0,                  // DX10
      0xC0003C00, 0x3C000001, 0x80007BFF, 0x3C001234,     // level 0, each with an alpha of 1
      0x0000FBFF, 0x3C0083FF};
  ASSERT_EQ(bytes->size(), sizeof golden);
  for (int i = 0; i < 43; ++i)
    EXPECT_EQ(LoadLittle32(bytes->data() + 4 * i), golden[i]) << "byte " << 4 * i;
}

TEST(DdsEncodeHalves, RefusesImpossibleTextures) {
  const std::vector<std::vector<uint16_t>> one(1, std::vector<uint16_t>(3));
  const auto code = [](const auto& result) { return result.error().code; };
  ASSERT_OK(EncodeHalvesDds(1, 1, one));
  EXPECT_EQ(code(EncodeHalvesDds(0, 1, one)), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(EncodeHalvesDds(1, 65537, one)), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(EncodeHalvesDds(2, 1, one)), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(EncodeHalvesDds(1, 1, {})), ErrorCode::kInvalidArgument);
  const std::vector<std::vector<uint16_t>> two(2, std::vector<uint16_t>(3));
  EXPECT_EQ(code(EncodeHalvesDds(1, 1, two)), ErrorCode::kInvalidArgument);
}

TEST(DdsEncode, RefusesImpossibleTextures) {
  const std::vector<std::vector<bc6h::Block>> one(1, std::vector<bc6h::Block>(1));
  const auto code = [](const auto& result) { return result.error().code; };
  EXPECT_EQ(code(EncodeDds(bc6h::Format::kUf16, 0, 1, one)), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(EncodeDds(bc6h::Format::kUf16, 1, 65537, one)), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(EncodeDds(bc6h::Format::kUf16, 8, 4, one)), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(EncodeDds(bc6h::Format::kUf16, 1, 1, {})), ErrorCode::kInvalidArgument);
  const std::vector<std::vector<bc6h::Block>> two(2, std::vector<bc6h::Block>(1));
  EXPECT_EQ(code(EncodeDds(bc6h::Format::kUf16, 1, 1, two)), ErrorCode::kInvalidArgument);
}

TEST(DdsParse, GivesBackWhatWasWritten) {
  Random random(23);
  const int sizes[][2] = {{1, 1}, {4, 4}, {5, 3}, {33, 17}, {1, 100}};
  for (const auto& size : sizes) {
    for (int levels = 1; levels <= DdsFullChainLevels(size[0], size[1]); ++levels) {
      const auto blocks = test::RandomLevels(random, size[0], size[1], levels);
      const auto bytes = EncodeDds(bc6h::Format::kSf16, size[0], size[1], blocks);
      ASSERT_OK(bytes);
      const auto texture = ParseDds(*bytes);
      ASSERT_OK(texture);
      EXPECT_EQ(texture->width, size[0]);
      EXPECT_EQ(texture->height, size[1]);
      EXPECT_EQ(texture->format, TextureFormat::kBc6hSf16);
      EXPECT_EQ(texture->levels, blocks);
      EXPECT_EQ(texture->level_count(), levels);
      EXPECT_EQ(*EncodeDds(*texture), *bytes);
    }
  }
}

TEST(DdsParse, GivesBackHalvesAsTheyWere) {
  Random random(26);
  const int sizes[][2] = {{1, 1}, {4, 4}, {5, 3}, {33, 17}, {1, 100}};
  for (const auto& size : sizes) {
    for (int count = 1; count <= DdsFullChainLevels(size[0], size[1]); ++count) {
      const auto levels = test::RandomHalfLevels(random, size[0], size[1], count);
      const auto bytes = EncodeHalvesDds(size[0], size[1], levels);
      ASSERT_OK(bytes);
      const auto texture = ParseDds(*bytes);
      ASSERT_OK(texture);
      EXPECT_EQ(texture->width, size[0]);
      EXPECT_EQ(texture->height, size[1]);
      EXPECT_EQ(texture->format, TextureFormat::kRgba16f);
      EXPECT_EQ(texture->halves, levels);
      EXPECT_TRUE(texture->levels.empty());
      ASSERT_EQ(texture->level_count(), count);
      for (int level = 0; level < count; ++level)
        EXPECT_EQ(DecodeDdsLevel(*texture, level), levels[static_cast<size_t>(level)]);
      EXPECT_EQ(*EncodeDds(*texture), *bytes);
    }
  }
}

TEST(DdsParse, PassesOverAlphaAndTakesHalvesThatAreNotFinite) {
  std::vector<uint8_t> bytes = SmallHalves();
  const auto before = ParseDds(bytes);
  ASSERT_OK(before);
  bytes[148 + 6] ^= 0xFF;
  const auto other_alpha = ParseDds(bytes);
  ASSERT_OK(other_alpha);
  EXPECT_EQ(other_alpha->halves, before->halves);
  StoreLittle16(bytes.data() + 148 + 8, 0x7E01);
  const auto with_nan = ParseDds(bytes);
  ASSERT_OK(with_nan);
  EXPECT_EQ(with_nan->halves[0][3], 0x7E01);
}

TEST(DdsParse, NoticesEveryTruncation) {
  for (const std::vector<uint8_t>& bytes : {SmallFile(), SmallHalves()}) {
    for (size_t size = 0; size < bytes.size(); ++size) {
      const auto result = ParseDds(test::Prefix(bytes, size));
      ASSERT_FALSE(result) << size;
      ASSERT_EQ(result.error().code, ErrorCode::kCorruptData);
      ASSERT_EQ(result.error().message.rfind("truncated", 0), 0u)
          << size << ": " << result.error().message;
    }
  }
}

TEST(DdsParse, NoticesTrailingBytes) {
  for (std::vector<uint8_t> bytes : {SmallFile(), SmallHalves()}) {
    bytes.push_back(0);
    EXPECT_EQ(MessageOf(ParseDds(bytes)).rfind("trailing bytes", 0), 0u);
  }
}

TEST(DdsParse, NoticesABadMagic) {
  EXPECT_EQ(MessageOf(WithField(SmallFile(), 0, 0x20534445)).rfind("bad magic", 0), 0u);
}

TEST(DdsParse, NoticesABadHeader) {
  const std::pair<int, uint32_t> changes[] = {{4, 123}, {76, 0},     {12, 0}, {12, 0xFFFFFFFF},
                                              {16, 0},  {16, 65537}, {28, 5}, {28, 0xFFFFFFFF}};
  for (const std::vector<uint8_t>& bytes : {SmallFile(), SmallHalves()}) {
    for (const auto& [offset, value] : changes) {
      const auto result = WithField(bytes, offset, value);
      EXPECT_EQ(MessageOf(result).rfind("bad header", 0), 0u)
          << offset << ": " << MessageOf(result);
    }
  }
}

TEST(DdsParse, TakesBlocksAndHalvesForEachOtherOnlyIfTheSizeFits) {
  EXPECT_EQ(MessageOf(WithField(SmallFile(), 128, 10)).rfind("truncated", 0), 0u);
  EXPECT_EQ(MessageOf(WithField(SmallHalves(), 128, 95)).rfind("trailing bytes", 0), 0u);
}

TEST(DdsParse, RefusesOtherKindsOfTextures) {
  const std::vector<uint8_t> bytes = SmallFile();
  const std::pair<int, uint32_t> changes[] = {{84, 0x31545844}, {80, 0x40}, {128, 98},
                                              {132, 4},         {136, 4},   {140, 6}};
  for (const auto& [offset, value] : changes) {
    const auto result = WithField(bytes, offset, value);
    ASSERT_FALSE(result) << offset;
    EXPECT_EQ(result.error().code, ErrorCode::kUnsupported) << offset;
  }
}

TEST(DdsParse, DoesNotAllocateForSizesThatTheFileDoesNotHold) {
  for (std::vector<uint8_t> bytes : {SmallFile(), SmallHalves()}) {
    StoreLittle32(bytes.data() + 12, 65536);
    StoreLittle32(bytes.data() + 16, 65536);
    StoreLittle32(bytes.data() + 28, 17);
    EXPECT_EQ(MessageOf(ParseDds(bytes)).rfind("truncated", 0), 0u);
  }
}

TEST(DdsParse, TakesMipCountZeroForOne) {
  Random random(24);
  std::vector<uint8_t> bytes =
      *EncodeDds(bc6h::Format::kUf16, 4, 4, test::RandomLevels(random, 4, 4, 1));
  const auto texture = WithField(bytes, 28, 0);
  ASSERT_OK(texture);
  EXPECT_EQ(texture->levels.size(), 1u);
}

TEST(DdsFile, ErrorsNameTheFile) {
  const test::TemporaryDirectory directory;
  EXPECT_EQ(ReadDds(directory / "absent.dds").error().code, ErrorCode::kNotFound);
  const std::string path = directory / "broken.dds";
  ASSERT_OK(WriteFileDurably(path, std::string_view("DDS ")));
  EXPECT_NE(MessageOf(ReadDds(path)).find("broken.dds: truncated"), std::string::npos);
  EXPECT_EQ(ReadDds(path, 3).error().code, ErrorCode::kOutOfRange);
}

}  // namespace
}  // namespace patina
