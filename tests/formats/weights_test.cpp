#include "formats/weights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"
#include "formats/half.h"
#include "tests/formats/test_support.h"

namespace patina {
namespace {

using test::MessageOf;

NetworkWeights SmallNetwork() {
  NetworkWeights network;
  network.inputs = 12;
  network.hidden = 16;
  network.outputs = 9;
  test::Random random(31);
  const auto fill = [&](std::vector<float>* values, int count) {
    for (int i = 0; i < count; ++i)
      values->push_back(HalfToFloat(FloatToHalf(static_cast<float>(random.Unit() * 4 - 2))));
  };
  fill(&network.w1, 16 * 12);
  fill(&network.b1, 16);
  fill(&network.w2, 9 * 16);
  fill(&network.b2, 9);
  return network;
}

std::vector<uint8_t> SmallFile() { return *EncodeWeights(*PackNetwork(SmallNetwork())); }

// Makes the checksum right again, so that what lies behind it is reached.
std::vector<uint8_t> Resealed(std::vector<uint8_t> bytes) {
  StoreLittle32(&bytes[24], 0);
  StoreLittle32(&bytes[24], Crc32(bytes));
  return bytes;
}

bool StartsWith(const std::string& text, const char* start) { return text.rfind(start, 0) == 0; }

TEST(Weights, KeepsNetworksExactly) {
  const NetworkWeights network = SmallNetwork();
  const auto buffer = ParseWeights(SmallFile());
  ASSERT_OK(buffer);
  const auto read = UnpackNetwork(*buffer);
  ASSERT_OK(read);
  EXPECT_EQ(read->inputs, 12);
  EXPECT_EQ(read->hidden, 16);
  EXPECT_EQ(read->outputs, 9);
  EXPECT_EQ(read->w1, network.w1);
  EXPECT_EQ(read->b1, network.b1);
  EXPECT_EQ(read->w2, network.w2);
  EXPECT_EQ(read->b2, network.b2);
}

TEST(Weights, WritesTheBytesOfVersionOne) {
  const WeightBuffer buffer{{{"a", {2}, {0x3C00, 0xBC00}}, {"bb", {1, 3}, {1, 2, 3}}}};
  const auto bytes = EncodeWeights(buffer);
  ASSERT_OK(bytes);
  ASSERT_EQ(bytes->size(), 64u + 2 * 64 + 64 + 64);
  EXPECT_EQ(std::memcmp(bytes->data(), "PATINAWT", 8), 0);
  EXPECT_EQ(LoadLittle32(&(*bytes)[8]), 1u);
  EXPECT_EQ(LoadLittle32(&(*bytes)[12]), 2u);
  EXPECT_EQ(LoadLittle64(&(*bytes)[16]), 320u);
  EXPECT_EQ(LoadLittle32(&(*bytes)[24]),
            0x6D6A957Eu);  // from an independent zlib over the same layout
  EXPECT_EQ(std::memcmp(&(*bytes)[64], "a\0", 2), 0);
  EXPECT_EQ(LoadLittle32(&(*bytes)[64 + 32]), 1u);
  EXPECT_EQ(LoadLittle32(&(*bytes)[64 + 36]), 1u);
  EXPECT_EQ(LoadLittle32(&(*bytes)[64 + 40]), 2u);
  EXPECT_EQ(LoadLittle64(&(*bytes)[64 + 56]), 192u);
  EXPECT_EQ(LoadLittle64(&(*bytes)[128 + 56]), 256u);
  const uint8_t data[] = {0x00, 0x3C, 0x00, 0xBC, 0x00};
  EXPECT_EQ(std::memcmp(&(*bytes)[192], data, 5), 0);
}

TEST(Weights, ChecksumIsTheOneOfZlib) {
  EXPECT_EQ(Crc32(AsBytes("123456789")), 0xCBF43926u);
  EXPECT_EQ(Crc32(AsBytes("56789"), Crc32(AsBytes("1234"))), 0xCBF43926u);
  EXPECT_EQ(Crc32({}), 0u);
}

TEST(Weights, AlignsEveryTensor) {
  const std::vector<uint8_t> bytes = SmallFile();
  EXPECT_EQ(bytes.size() % kWeightsAlignment, 0u);
  for (int i = 0; i < 4; ++i)
    EXPECT_EQ(LoadLittle64(&bytes[64 + 64 * i + 56]) % kWeightsAlignment, 0u);
}

TEST(Weights, NoticesEveryTruncation) {
  const std::vector<uint8_t> bytes = SmallFile();
  for (size_t size = 0; size < bytes.size(); ++size) {
    const auto result = ParseWeights(test::Prefix(bytes, size));
    ASSERT_FALSE(result) << size;
    ASSERT_EQ(result.error().code, ErrorCode::kCorruptData);
    ASSERT_TRUE(StartsWith(result.error().message, "truncated"))
        << size << ": " << result.error().message;
  }
}

TEST(Weights, NoticesTrailingBytes) {
  std::vector<uint8_t> bytes = SmallFile();
  bytes.push_back(0);
  EXPECT_TRUE(StartsWith(MessageOf(ParseWeights(bytes)), "trailing bytes"));
}

TEST(Weights, NoticesABadMagicAndAFutureVersion) {
  std::vector<uint8_t> bytes = SmallFile();
  bytes[3] ^= 1;
  EXPECT_TRUE(StartsWith(MessageOf(ParseWeights(bytes)), "bad magic"));
  bytes = SmallFile();
  StoreLittle32(&bytes[8], 2);
  const auto result = ParseWeights(bytes);
  EXPECT_EQ(result.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(result.error().message.find("newer"), std::string::npos);
  StoreLittle32(&bytes[8], 0);
  EXPECT_TRUE(StartsWith(MessageOf(ParseWeights(bytes)), "bad header"));
}

TEST(Weights, NoticesEveryFlippedBit) {
  const std::vector<uint8_t> bytes = SmallFile();
  for (size_t bit = 0; bit < bytes.size() * 8; ++bit) {
    std::vector<uint8_t> damaged = bytes;
    damaged[bit / 8] = static_cast<uint8_t>(damaged[bit / 8] ^ 1 << (bit % 8));
    ASSERT_FALSE(ParseWeights(damaged)) << "bit " << bit;
  }
}

TEST(Weights, RefusesNonFiniteWeights) {
  WeightBuffer buffer = *PackNetwork(SmallNetwork());
  for (const int bad : {0x7C00, 0xFC00, 0x7E00, 0x7C01}) {
    std::vector<uint8_t> bytes = *EncodeWeights(buffer);
    bytes[320 + 10] = static_cast<uint8_t>(bad & 0xFF);
    bytes[320 + 11] = static_cast<uint8_t>(bad >> 8);
    const auto result = ParseWeights(Resealed(bytes));
    ASSERT_FALSE(result);
    EXPECT_TRUE(StartsWith(result.error().message,
                           "non-finite weight: element 5 of tensor \"layer0.weight\""));
  }
  buffer.tensors[0].elements[3] = 0x7C00;
  EXPECT_EQ(EncodeWeights(buffer).error().code, ErrorCode::kInvalidArgument);
  NetworkWeights network = SmallNetwork();
  network.w2[0] = 65520;  // rounds to infinity
  EXPECT_EQ(PackNetwork(network).error().code, ErrorCode::kInvalidArgument);
  network.w2[0] = NAN;
  EXPECT_EQ(PackNetwork(network).error().code, ErrorCode::kInvalidArgument);
}

TEST(Weights, RefusesImpossibleEntries) {
  const auto broken = [](size_t offset, uint32_t value) {
    std::vector<uint8_t> bytes = SmallFile();
    StoreLittle32(&bytes[offset], value);
    return ParseWeights(Resealed(bytes));
  };
  for (const auto& [offset, value] :
       std::initializer_list<std::pair<size_t, uint32_t>>{{12, 0},
                                                          {12, 65},
                                                          {12, 0xFFFFFFFF},
                                                          {12, 3},
                                                          {16, 0},
                                                          {20, 1},  // header
                                                          {64, 0},
                                                          {64 + 36, 0},
                                                          {64 + 36, 5},
                                                          {64 + 40, 0},
                                                          {64 + 40, 17},  // name, rank, shape
                                                          {64 + 40, 0xFFFFFFFF},
                                                          {64 + 44, 0x80000000},
                                                          {64 + 56, 0},
                                                          {64 + 60, 1},
                                                          {128 + 40, 33}}) {
    const auto result = broken(offset, value);
    ASSERT_FALSE(result) << offset << " = " << value;
    EXPECT_EQ(result.error().code, ErrorCode::kCorruptData)
        << offset << ": " << result.error().message;
  }
  EXPECT_EQ(broken(64 + 32, 2).error().code, ErrorCode::kUnsupported);
}

TEST(Weights, RefusesNetworksThatDoNotFitTogether) {
  const WeightBuffer good = *PackNetwork(SmallNetwork());
  WeightBuffer buffer = good;
  buffer.tensors.pop_back();
  EXPECT_EQ(UnpackNetwork(buffer).error().code, ErrorCode::kCorruptData);
  buffer = good;
  buffer.tensors.push_back({"extra", {1}, {0}});
  EXPECT_EQ(UnpackNetwork(buffer).error().code, ErrorCode::kCorruptData);
  buffer = good;
  buffer.tensors[1].shape = {15};
  buffer.tensors[1].elements.resize(15);
  EXPECT_EQ(UnpackNetwork(buffer).error().code, ErrorCode::kCorruptData);
  NetworkWeights network = SmallNetwork();
  network.b1.pop_back();
  EXPECT_EQ(PackNetwork(network).error().code, ErrorCode::kInvalidArgument);
}

TEST(Weights, RefusesIllegalTensors) {
  const auto refuses = [](const WeightBuffer& buffer) {
    const auto result = EncodeWeights(buffer);
    return !result && result.error().code == ErrorCode::kInvalidArgument;
  };
  EXPECT_TRUE(refuses({}));
  EXPECT_TRUE(refuses({{{"", {1}, {0}}}}));
  EXPECT_TRUE(refuses({{{"a b", {1}, {0}}}}));
  EXPECT_TRUE(refuses({{{std::string(32, 'n'), {1}, {0}}}}));
  EXPECT_FALSE(refuses({{{std::string(31, 'n'), {1}, {0}}}}));
  EXPECT_TRUE(refuses({{{"a", {1}, {0}}, {"a", {1}, {0}}}}));
  EXPECT_TRUE(refuses({{{"a", {}, {}}}}));
  EXPECT_TRUE(refuses({{{"a", {0}, {}}}}));
  EXPECT_TRUE(refuses({{{"a", {2, 2}, {0, 0, 0}}}}));
  EXPECT_TRUE(refuses({{{"a", {1, 1, 1, 1, 1}, {0}}}}));
}

TEST(Weights, FilesRoundTrip) {
  const test::TemporaryDirectory directory;
  const std::string path = directory / "decoder.weights";
  ASSERT_OK(WriteWeights(path, *PackNetwork(SmallNetwork())));
  const auto buffer = ReadWeights(path);
  ASSERT_OK(buffer);
  EXPECT_EQ(*EncodeWeights(*buffer), SmallFile());
  EXPECT_EQ(ReadWeights(directory / "absent").error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace patina
