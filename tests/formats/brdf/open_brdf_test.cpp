#include <gtest/gtest.h>

#include <filesystem>

#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"
#include "formats/brdf/merl.h"
#include "formats/brdf/rgl.h"
#include "formats/brdf/sparse.h"
#include "formats/brdf/utia.h"
#include "tests/formats/brdf/brdf_samples.h"

namespace patina::brdf {
namespace {

using Bytes = std::span<const uint8_t>;

TEST(OpenBrdf, KnowsItsExtensions) {
  for (const char* path : {"a.binary", "b/c.bsdf", "/d.bin", "e.CSV", "f.x.json"})
    EXPECT_TRUE(HasBrdfExtension(path)) << path;
  for (const char* path :
       {"", "binary", ".bin", "a.bin/", "a.bin/b", "a/.csv", "a.png", "a.csv2", "a."})
    EXPECT_FALSE(HasBrdfExtension(path)) << path;
}

TEST(OpenBrdf, TellsTheFormatsApart) {
  const test::TemporaryDirectory folder;
  std::vector<uint8_t> merl(kMerlFileBytes, 0);
  StoreLittle32(merl.data(), 90);
  StoreLittle32(merl.data() + 4, 90);
  StoreLittle32(merl.data() + 8, 180);
  const std::vector<std::pair<Direction, Direction>> pairs = {{{0, 0, 1}, {0, 0, 1}}};
  RglLayout layout;
  layout.warp_side = 4;
  layout.colour_side = 2;
  const std::string csv = EncodeSparseCsv(SmoothBrdf, pairs, true);
  const std::string json = EncodeSparseJson(SmoothBrdf, pairs, true);
  ASSERT_OK(WriteFileDurably(folder / "a.binary", Bytes(merl)));
  ASSERT_OK(WriteFileDurably(folder / "b.bin", Bytes(merl)));
  ASSERT_OK(WriteFileDurably(folder / "c.bin", Bytes(EncodeUtia(SmoothBrdf))));
  ASSERT_OK(WriteFileDurably(folder / "d.bsdf", Bytes(EncodeRgl(SmoothBrdf, layout, ""))));
  ASSERT_OK(WriteFileDurably(folder / "e.csv", std::string_view(csv)));
  ASSERT_OK(WriteFileDurably(folder / "f.JSON", std::string_view(json)));
  const std::pair<const char*, const char*> expected[] = {
      {"a.binary", "merl"}, {"b.bin", "merl"},   {"c.bin", "utia"},
      {"d.bsdf", "rgl"},    {"e.csv", "sparse"}, {"f.JSON", "sparse"}};
  for (const auto& [name, format] : expected) {
    const auto source = OpenBrdf(folder / name);
    ASSERT_OK(source);
    EXPECT_EQ(source->format, format) << name;
    EXPECT_EQ(source->table == nullptr, source->format == "sparse");
  }
}

TEST(OpenBrdf, NamesTheFileInErrors) {
  const test::TemporaryDirectory folder;
  for (const char* name : {"x.binary", "x.bsdf", "x.bin", "x.csv", "x.json"}) {
    const auto missing = OpenBrdf(folder / name);
    ASSERT_FALSE(missing);
    EXPECT_EQ(missing.error().code, ErrorCode::kNotFound) << name;
    ASSERT_OK(WriteFileDurably(folder / name, std::string_view()));
    const auto empty = OpenBrdf(folder / name);
    ASSERT_FALSE(empty);
    EXPECT_EQ(empty.error().code, ErrorCode::kCorruptData) << name;
    EXPECT_NE(empty.error().message.find(folder / name), std::string::npos)
        << empty.error().message;
    // Beyond any limit: a hole of 2 GiB, which takes no room.
    std::filesystem::resize_file(folder / name, uint64_t{2} << 30);
    const auto large = OpenBrdf(folder / name);
    ASSERT_FALSE(large);
    EXPECT_EQ(large.error().code, ErrorCode::kOutOfRange) << name;
  }
  const auto other = OpenBrdf(folder / "x.exr");
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::kUnsupported);
}

}  // namespace
}  // namespace patina::brdf
