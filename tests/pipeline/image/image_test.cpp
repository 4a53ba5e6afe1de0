#include "pipeline/image/image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "formats/half.h"
#include "pipeline/image/resize.h"

namespace patina {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
const float kNan = std::numeric_limits<float>::quiet_NaN();

Image Make(int width, int height, int channels, SampleType type, const std::vector<float>& values) {
  Image image;
  image.info.width = width;
  image.info.height = height;
  image.info.channels = image.info.loaded_channels = channels;
  image.info.type = type;
  image.Allocate();
  for (size_t i = 0; i < values.size(); ++i) {
    switch (type) {
      case SampleType::kUint8:
        image.bytes[i] = static_cast<uint8_t>(values[i] * 255);
        break;
      case SampleType::kUint16: {
        const auto code = static_cast<uint16_t>(values[i] * 65535);
        std::memcpy(&image.bytes[i * 2], &code, 2);
        break;
      }
      case SampleType::kHalf: {
        const uint16_t half = FloatToHalf(values[i]);
        std::memcpy(&image.bytes[i * 2], &half, 2);
        break;
      }
      case SampleType::kFloat:
        std::memcpy(&image.bytes[i * 4], &values[i], 4);
        break;
    }
  }
  return image;
}

std::vector<float> Row(const Image& image, int y, int channel) {
  std::vector<float> row(image.width());
  LoadRow(image, y, channel, row.data());
  return row;
}

TEST(LoadRow, GivesEveryTypeAsFloat) {
  for (const SampleType type :
       {SampleType::kUint8, SampleType::kUint16, SampleType::kHalf, SampleType::kFloat}) {
    const Image image = Make(2, 2, 2, type, {0, 1, 1, 0, 1, 1, 0, 0});
    EXPECT_EQ(Row(image, 0, 0), (std::vector<float>{0, 1})) << SampleTypeName(type);
    EXPECT_EQ(Row(image, 0, 1), (std::vector<float>{1, 0}));
    EXPECT_EQ(Row(image, 1, 1), (std::vector<float>{1, 0}));
  }
}

TEST(LoadRow, DividesIntegersExactly) {
  Image image = Make(256, 1, 1, SampleType::kUint8, {});
  for (int i = 0; i < 256; ++i) image.bytes[i] = static_cast<uint8_t>(i);
  const std::vector<float> row = Row(image, 0, 0);
  for (int i = 0; i < 256; ++i) EXPECT_EQ(row[i], static_cast<float>(i) / 255.0f);
}

TEST(FindNonFinite, CountsAndNamesTheFirstPlace) {
  for (const SampleType type : {SampleType::kHalf, SampleType::kFloat}) {
    const Image image = Make(2, 2, 3, type, {1, 2, 3, 4, 5, kNan, kInf, 8, -kInf, 1, 1, 65504});
    const NonFinite found = FindNonFinite(image);
    EXPECT_EQ(found.count, 3u);
    EXPECT_EQ(found.first_x, 1);
    EXPECT_EQ(found.first_y, 0);
    EXPECT_EQ(found.first_channel, 2);
  }
  EXPECT_EQ(FindNonFinite(Make(1, 1, 1, SampleType::kUint16, {1})).count, 0u);
  EXPECT_EQ(FindNonFinite(Make(1, 1, 1, SampleType::kHalf, {65504})).count, 0u);
}

TEST(RepairNonFinite, TakesTheMeanOfFiniteNeighbours) {
  Image image = Make(3, 2, 1, SampleType::kFloat, {1, kNan, 3, 5, kInf, 7});
  RepairNonFinite(&image);
  EXPECT_EQ(FindNonFinite(image).count, 0u);
  // Both see the four finite ones, not each other's repair.
  EXPECT_EQ(Row(image, 0, 0), (std::vector<float>{1, 4, 3}));
  EXPECT_EQ(Row(image, 1, 0), (std::vector<float>{5, 4, 7}));
}

TEST(RepairNonFinite, GivesZeroWhereNothingIsFinite) {
  for (const SampleType type : {SampleType::kHalf, SampleType::kFloat}) {
    Image image = Make(2, 1, 1, type, {kNan, kInf});
    RepairNonFinite(&image);
    EXPECT_EQ(Row(image, 0, 0), (std::vector<float>{0, 0}));
  }
}

TEST(RepairNonFinite, KeepsChannelsApart) {
  Image image = Make(2, 1, 2, SampleType::kFloat, {kNan, 10, 2, 20});
  RepairNonFinite(&image);
  EXPECT_EQ(Row(image, 0, 0), (std::vector<float>{2, 2}));
  EXPECT_EQ(Row(image, 0, 1), (std::vector<float>{10, 20}));
}

TEST(ScanImage, FindsExactRangesForAnyThreadCount) {
  std::vector<float> values;
  for (int i = 0; i < 100 * 70; ++i) {
    values.push_back(static_cast<float>(i % 7) - 3);
    values.push_back(0.25f);
    values.push_back(static_cast<float>(i));
  }
  const Image image = Make(100, 70, 3, SampleType::kFloat, values);
  for (const int threads : {1, 2, 3}) {
    ThreadPool pool(threads);
    const ImageStats stats = ScanImage(image, pool);
    EXPECT_EQ(stats.min[0], -3);
    EXPECT_EQ(stats.max[0], 3);
    EXPECT_TRUE(stats.constant(1));
    EXPECT_EQ(stats.min[1], 0.25f);
    EXPECT_EQ(stats.max[2], 6999);
    EXPECT_GE(stats.grey_difference, 6990);
  }
}

TEST(ScanImage, CallsGreyGrey) {
  ThreadPool pool(1);
  EXPECT_EQ(ScanImage(Make(2, 1, 3, SampleType::kUint8, {0.5f, 0.5f, 0.5f, 1, 1, 1}), pool)
                .grey_difference,
            0);
  EXPECT_EQ(ScanImage(Make(1, 1, 1, SampleType::kUint8, {0.5f}), pool).grey_difference, 0);
}

TEST(CatmullRomWeights, SumToOneAndInterpolate) {
  for (const double t : {0.0, 0.1, 0.25, 0.5, 0.9, 0.999}) {
    double w[4];
    CatmullRomWeights(t, w);
    EXPECT_NEAR(w[0] + w[1] + w[2] + w[3], 1, 1e-15);
    // Quadratics are met exactly (Keys 1981).
    EXPECT_NEAR(w[0] * 1 + w[1] * 0 + w[2] * 1 + w[3] * 4, t * t, 1e-14);
  }
  double w[4];
  CatmullRomWeights(0.0, w);
  EXPECT_EQ(w[1], 1);
}

TEST(ResizeBicubic, KeepsConstantsExactly) {
  ThreadPool pool(2);
  const Image image = Make(3, 5, 3, SampleType::kUint8, std::vector<float>(45, 0.3f));
  const Image large = ResizeBicubic(image, ScanImage(image, pool), 64, 17, true, pool);
  EXPECT_EQ(large.width(), 64);
  EXPECT_EQ(large.height(), 17);
  const ImageStats stats = ScanImage(large, pool);
  EXPECT_EQ(stats.min[0], stats.max[0]);
  EXPECT_EQ(stats.min[0], Row(image, 0, 0)[0]);
}

TEST(ResizeBicubic, FollowsARampWithoutOvershoot) {
  ThreadPool pool(2);
  std::vector<float> values;
  for (int i = 0; i < 16; ++i) values.push_back(static_cast<float>(i) / 16);
  const Image image = Make(16, 1, 1, SampleType::kFloat, values);
  const Image large = ResizeBicubic(image, ScanImage(image, pool), 64, 2, false, pool);
  const std::vector<float> row = Row(large, 1, 0);
  for (int x = 12; x < 52; ++x) EXPECT_NEAR(row[x], ((x + 0.5) / 4 - 0.5) / 16, 1e-6);
  EXPECT_GE(row.front(), 0.0f);
  EXPECT_LE(row.back(), 15.0f / 16);
  const Image step = Make(4, 1, 1, SampleType::kFloat, {0, 0, 1, 1});
  const Image enlarged = ResizeBicubic(step, ScanImage(step, pool), 32, 1, true, pool);
  const ImageStats stats = ScanImage(enlarged, pool);
  EXPECT_GE(stats.min[0], 0);
  EXPECT_LE(stats.max[0], 1);
}

TEST(ResizeBicubic, WrapsOrClampsAtTheEdge) {
  ThreadPool pool(1);
  const Image image = Make(4, 1, 1, SampleType::kFloat, {1, 0, 0, 0});
  const ImageStats stats = ScanImage(image, pool);
  EXPECT_GT(Row(ResizeBicubic(image, stats, 8, 1, true, pool), 0, 0)[7], 0.1f);
  EXPECT_LT(Row(ResizeBicubic(image, stats, 8, 1, false, pool), 0, 0)[7], 0.001f);
}

}  // namespace
}  // namespace patina
