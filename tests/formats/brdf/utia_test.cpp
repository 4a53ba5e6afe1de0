#include "formats/brdf/utia.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "tests/formats/brdf/brdf_samples.h"

namespace patina::brdf {
namespace {

using test::MessageOf;
using test::Random;

std::vector<uint8_t> ConstantFile(double value) {
  std::vector<uint8_t> bytes(kUtiaFileBytes);
  for (size_t i = 0; i < bytes.size(); i += 8) std::memcpy(&bytes[i], &value, 8);
  return bytes;
}

void SetCell(std::vector<uint8_t>& bytes, int row, int column, int channel, double value) {
  std::memcpy(&bytes[static_cast<size_t>(8 * ((channel * 288 + row) * 288 + column))], &value, 8);
}

const Source& SkewSource() {
  static const Source source = *ParseUtia(EncodeUtia(SkewBrdf), "skew");
  return source;
}

TEST(UtiaParse, PutsLightInRowsAndViewInColumns) {
  std::vector<uint8_t> bytes = ConstantFile(0);
  SetCell(bytes, 48 * 2 + 5, 48 * 4 + 47, 0, 1);
  SetCell(bytes, 48 * 2 + 5, 48 * 4 + 47, 1, 2);
  SetCell(bytes, 48 * 2 + 5, 48 * 4 + 47, 2, 3);
  const auto source = ParseUtia(bytes, "one");
  ASSERT_OK(source);
  EXPECT_EQ(source->format, "utia");
  EXPECT_FALSE(source->isotropic);
  EXPECT_NEAR(source->max_theta_rad, 75 * kDegree, 1e-6);
  EXPECT_EQ(source->cells, 82944u);
  float rgb[3];
  ASSERT_TRUE(source->table->Evaluate(FromDegrees(30, 37.5), FromDegrees(60, 352.5), rgb));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(rgb[c], c + 1, 1e-4);
  ASSERT_TRUE(source->table->Evaluate(FromDegrees(60, 352.5), FromDegrees(30, 37.5), rgb));
  EXPECT_EQ(rgb[0], 0);
  // Half a step towards azimuth 0, across the wrap, and beyond it.
  ASSERT_TRUE(source->table->Evaluate(FromDegrees(30, 37.5), FromDegrees(60, 356.25), rgb));
  EXPECT_NEAR(rgb[0], 0.5, 1e-4);
  ASSERT_TRUE(source->table->Evaluate(FromDegrees(30, 37.5), FromDegrees(60, 0.01), rgb));
  EXPECT_EQ(rgb[0], 0);
}

TEST(UtiaEvaluate, GivesBackItsNodesAndIsCloseBetweenThem) {
  const Source& source = SkewSource();
  EXPECT_TRUE(source.warnings.empty());
  float read[3], exact[3];
  for (int i = 0; i < 288; i += 7) {
    for (int v = 0; v < 288; ++v) {
      const Direction wi = FromDegrees(15 * (i / 48), 7.5 * (i % 48));
      const Direction wo = FromDegrees(15 * (v / 48), 7.5 * (v % 48));
      ASSERT_TRUE(source.table->Evaluate(wi, wo, read));
      SkewBrdf(wi, wo, exact);
      // Rounding of the angles: 1e-6 of a step, with slopes of some units a step.
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(read[c], exact[c], 2e-5) << i << " " << v;
    }
  }
  Random random(7);
  for (int i = 0; i < 50000; ++i) {
    const Direction wi = RandomDirection(random, 75);
    const Direction wo = RandomDirection(random, 75);
    ASSERT_TRUE(source.table->Evaluate(wi, wo, read));
    SkewBrdf(wi, wo, exact);
    // The highlight (half width 17 degrees in h, 0.2 high) between nodes of 15 degrees.
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(read[c], exact[c], 0.08);
  }
}

TEST(UtiaEvaluate, HoldsTheLastRingBeyondIt) {
  const Source& source = SkewSource();
  Random random(8);
  for (int i = 0; i < 2000; ++i) {
    const double phi = 360 * random.Unit();
    const Direction wo = RandomDirection(random, 70);
    float last[3], beyond[3];
    ASSERT_TRUE(source.table->Evaluate(FromDegrees(75, phi), wo, last));
    ASSERT_TRUE(source.table->Evaluate(FromDegrees(89.9, phi), wo, beyond));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(last[c], beyond[c], 1e-5);
  }
}

TEST(UtiaEvaluate, RefusesDirectionsBelowTheHorizonAndNan) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  float rgb[3];
  EXPECT_FALSE(SkewSource().table->Evaluate({1, 0, 0}, {0, 0, 1}, rgb));
  EXPECT_FALSE(SkewSource().table->Evaluate({0, 0, 1}, {1, 0, -0.1f}, rgb));
  EXPECT_FALSE(SkewSource().table->Evaluate({0, 0, 1}, {0, 0, nan}, rgb));
  SkewSource().table->Evaluate({nan, 0, 1}, {0, nan, 1}, rgb);
  EXPECT_EQ(rgb[0], rgb[0]);
}

TEST(UtiaParse, LeavesInvalidCellsOutAndSaysSo) {
  std::vector<uint8_t> bytes = ConstantFile(0.25);
  Random random(9);
  const double bad[] = {-1, std::numeric_limits<double>::quiet_NaN(), 1e31,
                        -std::numeric_limits<double>::infinity()};
  SetCell(bytes, 3, 4, 1, -1);
  uint64_t count = 1;
  for (int row = 10; row < 288; row += 3) {
    for (int column = 0; column < 288; column += 4) {
      SetCell(bytes, row, column, random.Below(3), bad[random.Below(4)]);
      ++count;
    }
  }
  const auto source = ParseUtia(bytes, "holes");
  ASSERT_OK(source);
  EXPECT_EQ(source->invalid_cells, count);
  ASSERT_EQ(source->warnings.size(), 2u);
  EXPECT_NE(source->warnings[0].find("the first at row 3, column 4, byte 6944"), std::string::npos)
      << source->warnings[0];
  for (int i = 0; i < 20000; ++i) {
    float rgb[3];
    ASSERT_TRUE(
        source->table->Evaluate(RandomDirection(random, 89), RandomDirection(random, 89), rgb));
    for (const float value : rgb) ASSERT_NEAR(value, 0.25f, 1e-6);
  }
  EXPECT_EQ(MessageOf(ParseUtia(ConstantFile(-1), "x")).rfind("x: no valid cell", 0), 0u);
}

TEST(UtiaParse, NoticesTruncationAndTrailingBytes) {
  std::vector<uint8_t> bytes = ConstantFile(1);
  const auto truncated = [&](std::span<const uint8_t> part) {
    const auto result = ParseUtia(part, "short");
    ASSERT_FALSE(result);
    ASSERT_EQ(result.error().code, ErrorCode::kCorruptData);
    ASSERT_EQ(result.error().message.rfind("short: truncated", 0), 0u) << result.error().message;
  };
  for (size_t size = 0; size < 200; ++size) truncated(test::Prefix(bytes, size));
  for (size_t size = 200; size < bytes.size(); size += 997) truncated(std::span(bytes).first(size));
  truncated(std::span(bytes).first(bytes.size() - 1));
  bytes.push_back(0);
  EXPECT_EQ(MessageOf(ParseUtia(bytes, "long")).rfind("long: trailing bytes", 0), 0u);
}

}  // namespace
}  // namespace patina::brdf
