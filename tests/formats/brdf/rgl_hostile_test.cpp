#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "formats/base/little_endian.h"
#include "formats/brdf/rgl.h"
#include "formats/brdf/tensor_file.h"
#include "tests/formats/brdf/brdf_samples.h"
#include "tests/formats/brdf/tensors.h"

namespace patina::brdf {
namespace {

using test::MessageOf;
using test::Random;

std::vector<uint8_t> SmallFile() {
  RglLayout layout;
  layout.isotropic = false;
  layout.reduction = 4;
  layout.phi_count = 3;
  layout.theta_count = 2;
  layout.warp_side = 6;
  layout.colour_side = 3;
  return EncodeRgl(MirroredBrdf, layout, "small");
}

std::vector<TensorToWrite> SmallTensors() { return TensorsOf(SmallFile()); }

void SetFloat(TensorToWrite& tensor, size_t index, float value) {
  std::memcpy(&tensor.data[4 * index], &value, 4);
}

// Expects an error whose message has `part` in it.
void ExpectRefused(const std::vector<TensorToWrite>& tensors, const std::string& part) {
  const auto result = ParseRgl(EncodeTensorFile(tensors), "bad.bsdf");
  ASSERT_FALSE(result) << part;
  EXPECT_EQ(result.error().code, ErrorCode::kCorruptData);
  EXPECT_EQ(result.error().message.rfind("bad.bsdf: ", 0), 0u);
  EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
}

TEST(TensorFile, GivesBackWhatWasWritten) {
  const double f64[2] = {1.5, -2};
  const int16_t i16[3] = {-1, 300, 0};
  std::vector<TensorToWrite> tensors = {
      FloatTensor("a", {2, 1}, std::vector<float>{0.5f, -7}),
      {"b", TensorType::kF64, {2}, std::vector<uint8_t>(16)},
      {"c", TensorType::kI16, {3}, std::vector<uint8_t>(6)},
      {"h", TensorType::kF16, {2}, {0x00, 0x3C, 0x00, 0xC0}},
      {"u", TensorType::kU64, {1}, {1, 0, 0, 0, 1, 0, 0, 0}},
      {"i", TensorType::kI8, {1}, {0xFE}},
  };
  std::memcpy(tensors[1].data.data(), f64, 16);
  std::memcpy(tensors[2].data.data(), i16, 6);
  const std::vector<uint8_t> bytes = EncodeTensorFile(tensors);
  EXPECT_EQ(std::memcmp(bytes.data(), "tensor_file\0\1\0\6\0\0\0\1\0a\2\0\12", 24), 0);
  const auto file = ParseTensorFile(bytes, "own");
  ASSERT_OK(file);
  ASSERT_EQ(file->tensors.size(), 6u);
  EXPECT_EQ(file->Find("a")->shape, (std::vector<uint64_t>{2, 1}));
  EXPECT_EQ(file->Find("a")->At(1), -7);
  EXPECT_EQ(file->Find("b")->At(1), -2);
  EXPECT_EQ(file->Find("c")->At(0), -1);
  EXPECT_EQ(file->Find("c")->At(1), 300);
  EXPECT_EQ(file->Find("h")->At(0), 1);
  EXPECT_EQ(file->Find("h")->At(1), -2);
  EXPECT_EQ(file->Find("u")->At(0), 4294967297.0);
  EXPECT_EQ(file->Find("i")->At(0), -2);
  EXPECT_EQ(file->Find("d"), nullptr);
}

TEST(RglParse, NoticesEveryTruncation) {
  const std::vector<uint8_t> bytes = SmallFile();
  ASSERT_OK(ParseRgl(bytes, "whole"));
  for (size_t size = 0; size < bytes.size(); ++size) {
    const auto result = ParseRgl(test::Prefix(bytes, size), "short");
    ASSERT_FALSE(result) << size;
    ASSERT_EQ(result.error().code, ErrorCode::kCorruptData) << size;
    ASSERT_EQ(result.error().message.rfind("short: truncated", 0), 0u)
        << size << ": " << result.error().message;
  }
}

TEST(RglParse, NoticesTrailingBytesBadMagicAndLaterVersions) {
  std::vector<uint8_t> bytes = SmallFile();
  bytes.push_back(0);
  EXPECT_EQ(MessageOf(ParseRgl(bytes, "x")).rfind("x: trailing bytes", 0), 0u);
  bytes.pop_back();
  bytes[3] ^= 1;
  EXPECT_EQ(MessageOf(ParseRgl(bytes, "x")).rfind("x: bad magic", 0), 0u);
  bytes[3] ^= 1;
  bytes[12] = 2;
  const auto later = ParseRgl(bytes, "x");
  ASSERT_FALSE(later);
  EXPECT_EQ(later.error().code, ErrorCode::kUnsupported);
  bytes[12] = 1;
  bytes[13] = 7;
  EXPECT_TRUE(ParseRgl(bytes, "a minor version"));
}

TEST(RglParse, SurvivesEveryByteOfTheHeaderChanged) {
  const std::vector<uint8_t> whole = SmallFile();
  // The data of the first tensor, "version", begins behind the header.
  const size_t header = ParseTensorFile(whole, "own")->tensors[0].offset;
  Random random(21);
  int refused = 0;
  for (size_t at = 0; at < header; ++at) {
    for (const uint8_t change : {uint8_t{0x01}, uint8_t{0x80}, uint8_t{0xFF}}) {
      std::vector<uint8_t> bytes = whole;
      bytes[at] ^= change;
      const auto result = ParseRgl(bytes, "odd");
      refused += result ? 0 : 1;
      if (!result) continue;
      float rgb[3];
      for (int i = 0; i < 20; ++i)
        result->table->Evaluate(RandomDirection(random, 90), RandomDirection(random, 90), rgb);
    }
  }
  EXPECT_GT(refused, static_cast<int>(header));
}

// Where the entry of a field has its rank, type, offset and shape.
size_t EntryOf(const std::vector<uint8_t>& bytes, const std::string& name) {
  for (size_t at = 18; at + name.size() + 2 < bytes.size(); ++at) {
    if (bytes[at] == name.size() && bytes[at + 1] == 0 &&
        std::memcmp(&bytes[at + 2], name.data(), name.size()) == 0)
      return at + 2 + name.size();
  }
  return 0;
}

TEST(RglParse, RefusesBadEntries) {
  const std::vector<uint8_t> whole = SmallFile();
  const size_t ndf = EntryOf(whole, "ndf");
  ASSERT_GT(ndf, 0u);
  const auto refused = [&](auto&& change, const std::string& part) {
    std::vector<uint8_t> bytes = whole;
    change(bytes);
    const auto result = ParseRgl(bytes, "bad");
    ASSERT_FALSE(result) << part;
    EXPECT_EQ(result.error().code, ErrorCode::kCorruptData);
    EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
  };
  using Bytes = std::vector<uint8_t>;
  for (const uint32_t count : {0u, 65u, 0xFFFFFFFFu})
    refused([&](Bytes& b) { StoreLittle32(&b[14], count); }, "field count at byte 14");
  refused([&](Bytes& b) { b[ndf] = 0; }, "rank 0");
  refused([&](Bytes& b) { b[ndf] = 9; }, "rank 9");
  refused([&](Bytes& b) { b[ndf + 1] = 0xFF; }, "rank 65282");
  refused([&](Bytes& b) { b[ndf + 2] = 0; }, "type 0");
  refused([&](Bytes& b) { b[ndf + 2] = 12; }, "type 12");
  for (const uint64_t offset : {uint64_t{whole.size()}, uint64_t{whole.size() - 143}, ~uint64_t{0},
                                ~uint64_t{0} - 100, uint64_t{1} << 63}) {
    refused([&](Bytes& b) { StoreLittle64(&b[ndf + 3], offset); }, "reach beyond the end");
  }
  refused([&](Bytes& b) { StoreLittle64(&b[ndf + 3], 20); }, "is within the header");
  refused([&](Bytes& b) { StoreLittle64(&b[ndf + 11], 0); }, "a side of zero");
  refused([&](Bytes& b) { StoreLittle64(&b[ndf + 19], 0); }, "a side of zero");
  const uint64_t huge[][2] = {{uint64_t{1} << 32, uint64_t{1} << 32},
                              {uint64_t{1} << 63, 2},
                              {~uint64_t{0}, ~uint64_t{0}},
                              {(uint64_t{1} << 62) + 9, 4},
                              {1, whole.size()}};
  for (const auto& shape : huge) {
    refused(
        [&](Bytes& b) {
          StoreLittle64(&b[ndf + 11], shape[0]);
          StoreLittle64(&b[ndf + 19], shape[1]);
        },
        "is larger than the file");
  }
}

TEST(RglParse, RefusesMissingAndMisshapenFields) {
  for (const std::string name : {"theta_i", "phi_i", "sigma", "ndf", "vndf", "rgb"}) {
    std::vector<TensorToWrite> tensors = SmallTensors();
    std::erase_if(tensors, [&](const TensorToWrite& t) { return t.name == name; });
    ExpectRefused(tensors, "field \"" + name + "\" is missing");
    tensors = SmallTensors();
    Named(tensors, name).shape.push_back(1);
    ExpectRefused(tensors, "field \"" + name + "\" has rank");
  }
  std::vector<TensorToWrite> tensors = SmallTensors();
  tensors.push_back(tensors.back());
  ExpectRefused(tensors, "is there twice");
  tensors = SmallTensors();
  Named(tensors, "vndf").shape = {2, 3, 6, 6};
  ExpectRefused(tensors, "2 x 3 light directions");
  tensors = SmallTensors();
  Named(tensors, "rgb").shape = {2, 3, 3, 3, 3};
  ExpectRefused(tensors, "2 x 3 light directions");
  tensors = SmallTensors();
  Named(tensors, "rgb").shape = {3, 2, 9, 1, 3};
  ExpectRefused(tensors, "planes of 1 x 3");
  tensors = SmallTensors();
  Named(tensors, "ndf").shape = {36, 1};
  ExpectRefused(tensors, "planes of 36 x 1");
  tensors = SmallTensors();
  TensorToWrite& rgb = Named(tensors, "rgb");
  rgb.shape = {3, 2, 4, 3, 3};
  rgb.data.resize(3 * 2 * 4 * 9 * 4);
  ExpectRefused(tensors, "has 4 channels, not 3");
  tensors = SmallTensors();
  Named(tensors, "rgb").name = "spectra";
  ExpectRefused(tensors, "\"wavelengths\" is missing");
  tensors.push_back(FloatTensor("wavelengths", {2}, std::vector<float>{400, 700}));
  ExpectRefused(tensors, "has 3 channels, not 2");
  tensors.back() = FloatTensor("wavelengths", {3}, std::vector<float>{400, 700, 700});
  ExpectRefused(tensors, "element 2 is not larger");
}

TEST(RglParse, RefusesBadValuesOfTheParameterisation) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  for (const std::string name : {"theta_i", "phi_i", "sigma", "ndf", "vndf"}) {
    for (const float value : {nan, inf, -inf, -20.0f}) {
      std::vector<TensorToWrite> tensors = SmallTensors();
      SetFloat(Named(tensors, name), 1, value);
      ExpectRefused(tensors, "field \"" + name + "\" at byte ");
    }
  }
  std::vector<TensorToWrite> tensors = SmallTensors();
  SetFloat(Named(tensors, "theta_i"), 1, 0);
  ExpectRefused(tensors, "element 1 is not larger");
  tensors = SmallTensors();
  for (size_t i = 0; i < 36; ++i) SetFloat(Named(tensors, "vndf"), 36 * 3 + i, 0);
  ExpectRefused(tensors, "phi_i 1, theta_i 1 is zero everywhere");
  tensors = SmallTensors();
  Named(tensors, "reduction").data[0] = 3;
  ExpectRefused(tensors, "\"reduction\"");
  Named(tensors, "reduction").shape = {2};
  Named(tensors, "reduction").data = {1, 1};
  ExpectRefused(tensors, "2 elements, not one");
  tensors = SmallTensors();
  std::erase_if(tensors, [](const TensorToWrite& t) { return t.name == "reduction"; });
  for (size_t i = 0; i < 3; ++i) SetFloat(Named(tensors, "phi_i"), i, static_cast<float>(i));
  ExpectRefused(tensors, "neither a circle");
  tensors = SmallTensors();
  Named(tensors, "jacobian").shape = {2};
  Named(tensors, "jacobian").data = {1, 1};
  ExpectRefused(tensors, "\"jacobian\" has 2 elements");
}

TEST(RglParse, LeavesInvalidColoursOutAndSaysSo) {
  RglLayout layout;
  layout.warp_side = 16;
  layout.colour_side = 8;
  layout.theta_count = 3;
  const std::vector<uint8_t> bytes = EncodeRgl(SmoothBrdf, layout, "");
  std::vector<TensorToWrite> tensors;
  const auto file = ParseTensorFile(bytes, "own");
  for (const Tensor& t : file->tensors)
    tensors.push_back({t.name, t.type, t.shape, {t.bytes.begin(), t.bytes.end()}});
  TensorToWrite& rgb = Named(tensors, "rgb");
  const size_t plane = 64;
  for (size_t i = 0; i < 3 * 3 * plane; ++i) SetFloat(rgb, i, 0.5f);
  Named(tensors, "jacobian").data[0] = 0;
  const auto at = [&](size_t theta, size_t channel, size_t cell) {
    return (theta * 3 + channel) * plane + cell;
  };
  SetFloat(rgb, at(1, 0, 13), std::numeric_limits<float>::quiet_NaN());
  SetFloat(rgb, at(2, 2, 14), std::numeric_limits<float>::infinity());
  for (size_t c = 0; c < 3; ++c) SetFloat(rgb, at(0, c, 20), -1);
  const auto source = ParseRgl(EncodeTensorFile(tensors), "holes");
  ASSERT_OK(source);
  EXPECT_EQ(source->invalid_cells, 3u);
  ASSERT_EQ(source->warnings.size(), 2u);
  EXPECT_NE(source->warnings[0].find(
                "1 cell that is negative left out, the first at field \"rgb\" (phi_i 0, "
                "theta_i 0, row 2, column 4)"),
            std::string::npos)
      << source->warnings[0];
  EXPECT_NE(source->warnings[1].find("2 cells"), std::string::npos) << source->warnings[1];
  EXPECT_NE(source->warnings[1].find("theta_i 1, row 1, column 5"), std::string::npos)
      << source->warnings[1];
  Random random(22);
  for (int i = 0; i < 5000; ++i) {
    const Direction wo = RandomDirection(random, 89);
    float value[3];
    ASSERT_TRUE(source->table->Evaluate(RandomDirection(random, 89), wo, value));
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(value[c] * wo.z, 0.5f, 1e-6);
  }
  // A negative channel of a positive colour is data.
  SetFloat(rgb, at(1, 2, 40), -0.01f);
  EXPECT_EQ(ParseRgl(EncodeTensorFile(tensors), "gamut")->invalid_cells, 3u);
  for (size_t i = 0; i < 3 * 3 * plane; ++i) SetFloat(rgb, i, -1);
  ExpectRefused(tensors, "no valid colour");
}

}  // namespace
}  // namespace patina::brdf
