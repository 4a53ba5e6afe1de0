// Files of others that are damaged, odd or hostile: an error or an image, never a crash, never a
// hang (the test's time-out).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/image/image_io.h"
#include "tests/pipeline/image/image_files.h"

namespace patina {
namespace {

std::vector<std::string> FilesBelow(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

TEST(DamagedFiles, GiveAnErrorOrAnImage) {
  const std::string folder = test::SharedData("exr");
  if (folder.empty()) GTEST_SKIP() << "the shared image files are not here";
  int images = 0, errors = 0;
  for (const std::string& file : FilesBelow(folder)) {
    const auto image = ReadImage(file);
    if (image) {
      ++images;
      ASSERT_EQ(image->bytes.size(), image->row_bytes() * image->height()) << file;
    } else {
      ++errors;
      EXPECT_THAT(image.error().message, testing::HasSubstr(file));
      EXPECT_NE(image.error().code, ErrorCode::kInternal);
    }
  }
  RecordProperty("images", images);
  RecordProperty("errors", errors);
  EXPECT_GT(images, 20);
  EXPECT_GT(errors, 50);
}

TEST(OddFiles, AreRead) {
  const std::string folder = test::SharedData("exr");
  if (folder.empty()) GTEST_SKIP() << "the shared image files are not here";
  struct Case {
    const char* file;
    int width, height, channels;
    SampleType type;
  };
  for (const Case& c :
       {Case{"odd-inputs/ldr.dds", 8, 8, 4, SampleType::kUint8},
        Case{"odd-inputs/ldr.tga", 8, 8, 4, SampleType::kUint8},
        Case{"odd-inputs/hdr.hdr", 8, 8, 3, SampleType::kFloat},
        Case{"odd-inputs/HDR-A-1x1.exr", 1, 1, 3, SampleType::kHalf},
        Case{"odd-inputs/jpeg_cmyk_8-bit.jpg", 256, 256, 3, SampleType::kUint8},
        Case{"odd-inputs/png_grayscale_16-bit.png", 256, 256, 2, SampleType::kUint16},
        Case{"openexr-tests/comp_bad_pos_bounds_piz.exr", 13569, 1, 4, SampleType::kHalf},
        Case{"openexr-tests/v1.7.test.1.exr", 178, 155, 4, SampleType::kFloat},
        Case{"openexr-images/t08.exr", 400, 300, 3, SampleType::kHalf}}) {
    const auto image = ReadImage(folder + "/" + c.file);
    ASSERT_TRUE(image) << image.error().message;
    EXPECT_EQ(image->width(), c.width) << c.file;
    EXPECT_EQ(image->height(), c.height);
    EXPECT_EQ(image->channels(), c.channels);
    EXPECT_EQ(image->info.type, c.type);
  }
}

TEST(OddFiles, ThatHaveNoOneValuePerPixelAreRefused) {
  const std::string folder = test::SharedData("exr");
  if (folder.empty()) GTEST_SKIP() << "the shared image files are not here";
  const auto deep = ReadImage(folder + "/openexr-tests/11.deep.exr");
  ASSERT_FALSE(deep);
  EXPECT_EQ(deep.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(deep.error().message, testing::HasSubstr("deep"));
}

TEST(OddFiles, HaveTheirNonFiniteSamplesCounted) {
  const std::string folder = test::SharedData("exr");
  if (folder.empty()) GTEST_SKIP() << "the shared image files are not here";
  auto image = ReadImage(folder + "/openexr-images/AllHalfValues.exr");
  ASSERT_TRUE(image) << image.error().message;
  // 2046 NaN and 2 infinities in each of three channels.
  EXPECT_EQ(FindNonFinite(*image).count, 3u * 2048u);
  RepairNonFinite(&*image);
  EXPECT_EQ(FindNonFinite(*image).count, 0u);
}

}  // namespace
}  // namespace patina
