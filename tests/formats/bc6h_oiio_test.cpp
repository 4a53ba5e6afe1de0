// Our BC6H decoder against OpenImageIO's, through DDS files that we write.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "formats/base/file_io.h"
#include "formats/dds.h"
#include "tests/formats/test_support.h"

namespace patina {
namespace {

using test::Random;
using test::TemporaryDirectory;

// Writes the levels, reads them with OpenImageIO and counts the halves that differ from ours.
void CompareWithOpenImageIo(const TemporaryDirectory& directory, bc6h::Format format, int width,
                            int height, const std::vector<std::vector<bc6h::Block>>& levels) {
  const std::string path = directory / "random.dds";
  ASSERT_OK(WriteDds(path, format, width, height, levels));
  const auto ours = ReadDds(path);
  ASSERT_OK(ours);
  auto input = OIIO::ImageInput::open(path);
  ASSERT_NE(input, nullptr) << OIIO::geterror();
  for (int level = 0; level < static_cast<int>(levels.size()); ++level) {
    ASSERT_TRUE(input->seek_subimage(0, level)) << input->geterror();
    const OIIO::ImageSpec spec = input->spec(0, level);
    ASSERT_EQ(spec.width, DdsLevelSide(width, level));
    ASSERT_EQ(spec.height, DdsLevelSide(height, level));
    ASSERT_EQ(spec.format, OIIO::TypeDesc::HALF);
    ASSERT_GE(spec.nchannels, 3);
    std::vector<uint16_t> theirs(static_cast<size_t>(spec.width) * spec.height * 3);
    ASSERT_TRUE(input->read_image(0, level, 0, 3, OIIO::TypeDesc::HALF, theirs.data()))
        << input->geterror();
    ASSERT_FALSE(input->has_error()) << input->geterror();
    const std::vector<uint16_t> decoded = DecodeDdsLevel(*ours, level);
    ASSERT_EQ(decoded.size(), theirs.size());
    const auto difference = std::mismatch(decoded.begin(), decoded.end(), theirs.begin());
    ASSERT_EQ(difference.first, decoded.end())
        << width << "x" << height << " level " << level << ": half "
        << difference.first - decoded.begin() << " is " << *difference.first
        << ", OpenImageIO says " << *difference.second;
  }
  // A reader that finds one more level than was written would go unnoticed above.
  EXPECT_FALSE(input->seek_subimage(0, static_cast<int>(levels.size())));
}

TEST(Bc6hAgainstOpenImageIo, DecodesEveryModeAndReservedBlocksTheSame) {
  const TemporaryDirectory directory;
  Random random(11);
  for (const auto format : {bc6h::Format::kUf16, bc6h::Format::kSf16}) {
    for (int mode = 0; mode < 18; ++mode) {
      std::vector<std::vector<bc6h::Block>> levels(1);
      for (int i = 0; i < 64 * 64; ++i) levels[0].push_back(test::RandomBlock(random, mode));
      SCOPED_TRACE("mode " + std::to_string(mode));
      CompareWithOpenImageIo(directory, format, 256, 256, levels);
      if (HasFatalFailure()) return;
    }
  }
}

TEST(Bc6hAgainstOpenImageIo, DecodesEverySizeAndAllMipsTheSame) {
  const TemporaryDirectory directory;
  Random random(12);
  const int sizes[][2] = {{1, 1},   {1, 2},     {2, 1},     {3, 3},     {4, 4},     {5, 4},
                          {5, 7},   {1, 64},    {64, 1},    {6, 9},     {17, 5},    {31, 33},
                          {100, 3}, {255, 257}, {640, 127}, {512, 512}, {1023, 300}};
  for (const auto format : {bc6h::Format::kUf16, bc6h::Format::kSf16}) {
    for (const auto& size : sizes) {
      const int levels = DdsFullChainLevels(size[0], size[1]);
      CompareWithOpenImageIo(directory, format, size[0], size[1],
                             test::RandomLevels(random, size[0], size[1], levels));
      if (HasFatalFailure()) return;
    }
  }
}

TEST(Bc6hAgainstOpenImageIo, DecodesTheLargestTextureTheSame) {
  const TemporaryDirectory directory;
  Random random(13);
  CompareWithOpenImageIo(directory, bc6h::Format::kUf16, 4096, 4095,
                         test::RandomLevels(random, 4096, 4095, DdsFullChainLevels(4096, 4095)));
}

TEST(Bc6hAgainstOpenImageIo, ReadsAChainThatStopsEarly) {
  const TemporaryDirectory directory;
  Random random(14);
  CompareWithOpenImageIo(directory, bc6h::Format::kUf16, 64, 32,
                         test::RandomLevels(random, 64, 32, 3));
}

}  // namespace
}  // namespace patina
