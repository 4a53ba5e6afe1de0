#include "pipeline/image/file_tags.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "pipeline/image/image_io.h"
#include "tests/pipeline/image/image_files.h"

namespace patina {
namespace {

using Bytes = std::vector<uint8_t>;
using test::TempFolder;

void Put32(Bytes* bytes, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes->push_back(static_cast<uint8_t>(value >> shift));
}
void PutText(Bytes* bytes, const std::string& text) {
  bytes->insert(bytes->end(), text.begin(), text.end());
}
void PutFixed(Bytes* bytes, double value) {
  Put32(bytes, static_cast<uint32_t>(static_cast<int32_t>(std::lround(value * 65536))));
}

uint32_t Crc(const Bytes& bytes) {
  uint32_t crc = 0xFFFFFFFFu;
  for (const uint8_t byte : bytes) {
    crc ^= byte;
    for (int i = 0; i < 8; ++i) crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1)));
  }
  return ~crc;
}

void PutChunk(Bytes* bytes, const std::string& type, const Bytes& data) {
  Put32(bytes, static_cast<uint32_t>(data.size()));
  Bytes body;
  PutText(&body, type);
  body.insert(body.end(), data.begin(), data.end());
  bytes->insert(bytes->end(), body.begin(), body.end());
  Put32(bytes, Crc(body));
}

Bytes Gamma(uint32_t value) {
  Bytes data;
  Put32(&data, value);
  return data;
}
Bytes Primaries8(std::initializer_list<uint32_t> values) {
  Bytes data;
  for (const uint32_t value : values) Put32(&data, value);
  return data;
}
const Bytes& SrgbPrimaries() {
  static const Bytes data = Primaries8({31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000});
  return data;
}
const Bytes& P3Primaries() {
  static const Bytes data = Primaries8({31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000});
  return data;
}

using Chunks = std::vector<std::pair<std::string, Bytes>>;

class PngTags : public testing::Test {
 protected:
  // A PNG of the image library with chunks put in behind its header.
  std::string File(const Chunks& chunks) {
    const std::string path = folder_ / "a.png";
    test::WriteWithLibrary(path, test::Flat(2, 2, {0.5f, 0.25f, 1.0f}));
    Bytes bytes = test::ReadBytes(path);
    Bytes out(bytes.begin(), bytes.begin() + 8);
    size_t at = 8;
    while (at + 12 <= bytes.size()) {
      const uint32_t size = static_cast<uint32_t>(bytes[at] << 24 | bytes[at + 1] << 16 |
                                                  bytes[at + 2] << 8 | bytes[at + 3]);
      const std::string type(bytes.begin() + at + 4, bytes.begin() + at + 8);
      const size_t end = at + 12 + size;
      // What the library says by itself is not wanted here.
      if (type != "gAMA" && type != "cHRM" && type != "sRGB" && type != "iCCP")
        out.insert(out.end(), bytes.begin() + at, bytes.begin() + end);
      if (type == "IHDR") {
        for (const auto& [name, data] : chunks) PutChunk(&out, name, data);
      }
      at = end;
    }
    test::WriteBytes(path, out);
    return path;
  }
  TempFolder folder_;
};

TEST_F(PngTags, SayNothingWhereThereAreNone) {
  EXPECT_TRUE(TagFromPngChunks(File({})).empty());
  EXPECT_TRUE(TagFromPngChunks(folder_ / "absent.png").empty());
  // The library calls such a file sRGB all the same; that must not pass for a tag.
  auto info = ReadImageInfo(folder_ / "a.png");
  ASSERT_TRUE(info);
  EXPECT_TRUE(info->color_tag.empty());
}

TEST_F(PngTags, SrgbGoesBeforeGamma) {
  const ColorTag tag =
      TagFromPngChunks(File({{"gAMA", Gamma(100000)}, {"sRGB", {0}}, {"cHRM", P3Primaries()}}));
  EXPECT_EQ(tag.origin, "sRGB chunk");
  EXPECT_EQ(tag.curve, SrgbCurve());
  EXPECT_EQ(tag.primaries, kRec709Primaries);
}

TEST_F(PngTags, GammaOfSrgbMeansSrgb) {
  for (const Chunks& chunks : {Chunks{{"gAMA", Gamma(45455)}},
                               Chunks{{"gAMA", Gamma(45455)}, {"cHRM", SrgbPrimaries()}}}) {
    const ColorTag tag = TagFromPngChunks(File(chunks));
    EXPECT_FALSE(tag.empty());
    EXPECT_EQ(tag.curve, SrgbCurve());
    EXPECT_EQ(tag.primaries, kRec709Primaries);
  }
}

TEST_F(PngTags, OtherGammasAndPrimariesAreTakenAtTheirWord) {
  ColorTag tag = TagFromPngChunks(File({{"gAMA", Gamma(100000)}}));
  EXPECT_EQ(tag.curve, TransferCurve());
  tag = TagFromPngChunks(File({{"gAMA", Gamma(55556)}}));
  EXPECT_NEAR(tag.curve.gamma, 1.8, 1e-4);
  tag = TagFromPngChunks(File({{"cHRM", P3Primaries()}, {"gAMA", Gamma(45455)}}));
  EXPECT_NEAR(tag.curve.gamma, 2.2, 1e-3);
  EXPECT_NEAR(tag.primaries.green.x, 0.265, 1e-9);
  // Primaries alone do not say what the codes are.
  EXPECT_TRUE(TagFromPngChunks(File({{"cHRM", P3Primaries()}})).empty());
}

TEST_F(PngTags, NonsenseIsNamedAndNotFollowed) {
  for (const uint32_t gamma : {0u, 1u, 4000000000u}) {
    const ColorTag tag = TagFromPngChunks(File({{"gAMA", Gamma(gamma)}}));
    EXPECT_TRUE(tag.empty());
    EXPECT_NE(tag.problem.find("gAMA"), std::string::npos);
  }
  const ColorTag line = TagFromPngChunks(
      File({{"gAMA", Gamma(45455)},
            {"cHRM", Primaries8({31270, 32900, 10000, 10000, 20000, 20000, 30000, 30000})}}));
  EXPECT_TRUE(line.empty());
  EXPECT_NE(line.problem.find("cHRM"), std::string::npos);
  // Chunks of another length than theirs, and one that claims the rest of the disk.
  EXPECT_TRUE(TagFromPngChunks(File({{"gAMA", {0, 0}}, {"cHRM", {1, 2, 3}}})).empty());
  Bytes bytes = test::ReadBytes(File({}));
  bytes[33] = bytes[34] = bytes[35] = bytes[36] = 0xFF;
  test::WriteBytes(folder_ / "a.png", bytes);
  EXPECT_TRUE(TagFromPngChunks(folder_ / "a.png").empty());
}

TEST_F(PngTags, AnyTruncationIsHarmless) {
  const Bytes whole = test::ReadBytes(File({{"cHRM", P3Primaries()}, {"gAMA", Gamma(55556)}}));
  for (size_t size = 0; size < whole.size(); ++size) {
    test::WriteBytes(folder_ / "cut.png", Bytes(whole.begin(), whole.begin() + size));
    const ColorTag tag = TagFromPngChunks(folder_ / "cut.png");
    EXPECT_TRUE(tag.empty() || std::fabs(tag.curve.gamma - 1.8) < 1e-3) << size;
  }
}

// A profile with matrix and one curve for all, colorants adapted to D50 as ICC wants them.
Bytes Profile(const std::string& space, const Primaries& primaries, const Bytes& curve,
              const Bytes& other_curve = {}) {
  // For the white of the profile connection space.
  const Primaries d50{{0.7347, 0.2653}, {0.1596, 0.8404}, {0.0366, 0.0001}, {0.34570, 0.35854}};
  const Matrix3 to_d50 = *ConversionMatrix(primaries, d50);
  const Matrix3 xyz = Multiply(*RgbToXyz(d50), to_d50);
  std::vector<std::pair<std::string, Bytes>> tags;
  Bytes name;
  PutText(&name, std::string("desc\0\0\0\0", 8));
  Put32(&name, 5);
  PutText(&name, std::string("test\0", 5));
  tags.emplace_back("desc", name);
  const char* signatures[3] = {"rXYZ", "gXYZ", "bXYZ"};
  for (int c = 0; c < 3; ++c) {
    Bytes data;
    PutText(&data, std::string("XYZ \0\0\0\0", 8));
    for (int i = 0; i < 3; ++i) PutFixed(&data, xyz[3 * i + c]);
    tags.emplace_back(signatures[c], data);
  }
  tags.emplace_back("rTRC", curve);
  tags.emplace_back("gTRC", other_curve.empty() ? curve : other_curve);
  tags.emplace_back("bTRC", curve);
  tags.emplace_back("kTRC", curve);
  Bytes out(128, 0);
  std::memcpy(out.data() + 16, space.data(), 4);
  std::memcpy(out.data() + 20, "XYZ ", 4);
  std::memcpy(out.data() + 36, "acsp", 4);
  Put32(&out, static_cast<uint32_t>(tags.size()));
  size_t offset = 132 + 12 * tags.size();
  for (const auto& [signature, data] : tags) {
    PutText(&out, signature);
    Put32(&out, static_cast<uint32_t>(offset));
    Put32(&out, static_cast<uint32_t>(data.size()));
    offset += data.size();
  }
  for (const auto& [signature, data] : tags) out.insert(out.end(), data.begin(), data.end());
  return out;
}

Bytes GammaCurve(uint8_t whole, uint8_t fraction) {
  Bytes data;
  PutText(&data, std::string("curv\0\0\0\0", 8));
  Put32(&data, 1);
  data.push_back(whole);
  data.push_back(fraction);
  return data;
}

Bytes Parametric(uint16_t kind, std::initializer_list<double> numbers) {
  Bytes data;
  PutText(&data, std::string("para\0\0\0\0", 8));
  data.push_back(static_cast<uint8_t>(kind >> 8));
  data.push_back(static_cast<uint8_t>(kind));
  data.push_back(0);
  data.push_back(0);
  for (const double number : numbers) PutFixed(&data, number);
  return data;
}

const Bytes& SrgbParametric() {
  static const Bytes data = Parametric(3, {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045});
  return data;
}

TEST(IccTags, FindsSrgbThroughItsAdaptedColorants) {
  const ColorTag tag = TagFromIccProfile(Profile("RGB ", kRec709Primaries, SrgbParametric()));
  EXPECT_EQ(tag.origin, "ICC profile \"test\"");
  EXPECT_TRUE(AreSameSpace(tag.primaries, kRec709Primaries, 1e-3));
  EXPECT_TRUE(AreClose(tag.curve, SrgbCurve(), 1e-4));
}

TEST(IccTags, ReadsGammasTablesAndAllParametricKinds) {
  const Primaries adobe{{0.64, 0.33}, {0.21, 0.71}, {0.15, 0.06}, {0.3127, 0.3290}};
  const ColorTag gamma = TagFromIccProfile(Profile("RGB ", adobe, GammaCurve(2, 51)));
  EXPECT_TRUE(AreSameSpace(gamma.primaries, adobe, 1e-3));
  EXPECT_NEAR(gamma.curve.gamma, 2.19921875, 1e-9);
  Bytes table;
  PutText(&table, std::string("curv\0\0\0\0", 8));
  Put32(&table, 1024);
  for (int i = 0; i < 1024; ++i) {
    const auto code = static_cast<uint16_t>(std::lround(65535 * SrgbCurve().Decode(i / 1023.0)));
    table.push_back(static_cast<uint8_t>(code >> 8));
    table.push_back(static_cast<uint8_t>(code));
  }
  EXPECT_TRUE(AreClose(TagFromIccProfile(Profile("RGB ", adobe, table)).curve, SrgbCurve(), 1e-4));
  const auto at_half = [&](const Bytes& curve) {
    const ColorTag tag = TagFromIccProfile(Profile("RGB ", adobe, curve));
    EXPECT_FALSE(tag.empty()) << tag.problem;
    return tag.curve.Decode(0.5);
  };
  // Y for X = 1/2, as ICC.1:2010 table 65 has the formulas.
  EXPECT_NEAR(at_half(Parametric(0, {2})), 0.25, 1e-4);
  EXPECT_NEAR(at_half(Parametric(1, {2, 1, 0.25})), 0.5625, 1e-4);
  EXPECT_NEAR(at_half(Parametric(2, {2, 1, 0.25, 0.125})), 0.6875, 1e-4);
  EXPECT_NEAR(at_half(Parametric(4, {2, 1, 0, 0.5, 0.75, 0.1, 0.2})), 0.45, 1e-4);
  EXPECT_NEAR(at_half(Parametric(4, {2, 1, 0, 0.5, 0.25, 0.1, 0.2})), 0.35, 1e-4);
}

TEST(IccTags, FollowsGreyAndNamesWhatItCannotFollow) {
  const ColorTag grey = TagFromIccProfile(Profile("GRAY", kRec709Primaries, GammaCurve(2, 0)));
  EXPECT_EQ(grey.curve, PowerCurve(2));
  EXPECT_EQ(grey.primaries, kRec709Primaries);
  for (const Bytes& profile :
       {Profile("CMYK", kRec709Primaries, GammaCurve(2, 0)),
        Profile("RGB ", kRec709Primaries, GammaCurve(2, 0), GammaCurve(1, 0)),
        Profile("RGB ", kRec709Primaries, GammaCurve(0, 0)),
        Profile("RGB ", kRec709Primaries, Parametric(9, {1})),
        Profile("RGB ", kRec709Primaries, Parametric(3, {2.4}))}) {
    const ColorTag tag = TagFromIccProfile(profile);
    EXPECT_TRUE(tag.empty());
    EXPECT_NE(tag.problem.find("ICC profile"), std::string::npos);
  }
}

TEST(IccTags, AnyTruncationAndAnyByteIsHarmless) {
  const Bytes whole = Profile("RGB ", kRec709Primaries, SrgbParametric());
  for (size_t size = 0; size < whole.size(); ++size) {
    const ColorTag tag = TagFromIccProfile(std::span<const uint8_t>(whole.data(), size));
    EXPECT_FALSE(tag.problem.empty() && size < 300) << size;
  }
  for (size_t at = 0; at < whole.size(); ++at) {
    for (const uint8_t byte : {uint8_t{0}, uint8_t{0x7F}, uint8_t{0xFF}}) {
      Bytes changed = whole;
      changed[at] = byte;
      const ColorTag tag = TagFromIccProfile(changed);
      EXPECT_TRUE(tag.empty() || RgbToXyz(tag.primaries)) << at;
    }
  }
}

TEST(ExrTags, ReadChromaticities) {
  const TempFolder folder;
  const float grey[3] = {0.5f, 0.5f, 0.5f};
  ASSERT_TRUE(WriteImage(folder / "a.exr", WriteFormat::kExrFloat, 1, 1, 3, grey, &kAp1Primaries));
  auto info = ReadImageInfo(folder / "a.exr");
  ASSERT_TRUE(info);
  EXPECT_EQ(info->color_tag.origin, "chromaticities");
  EXPECT_TRUE(AreSameSpace(info->color_tag.primaries, kAp1Primaries, 1e-5));
  EXPECT_EQ(info->color_tag.curve, TransferCurve());
  ASSERT_TRUE(WriteImage(folder / "b.exr", WriteFormat::kExrFloat, 1, 1, 3, grey));
  EXPECT_TRUE(ReadImageInfo(folder / "b.exr")->color_tag.empty());
  const float bad[8] = {0, 0, 0, 0, 0, 0, NAN, 0};
  const ColorTag tag = TagFromChromaticities(bad);
  EXPECT_TRUE(tag.empty());
  EXPECT_NE(tag.problem.find("chromaticities"), std::string::npos);
}

}  // namespace
}  // namespace patina
