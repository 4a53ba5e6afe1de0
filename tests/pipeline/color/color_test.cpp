#include "pipeline/color/color.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace patina {
namespace {

TEST(SrgbCurve, HitsTheAnchorsOfTheStandard) {
  EXPECT_EQ(SrgbToLinear(0), 0);
  EXPECT_EQ(SrgbToLinear(1), 1);
  EXPECT_NEAR(LinearToSrgb(1), 1, 1e-15);
  EXPECT_NEAR(SrgbToLinear(0.5), 0.21404114048223255, 1e-15);
  EXPECT_NEAR(LinearToSrgb(0.18), 0.46135612950044164, 1e-15);
  EXPECT_NEAR(LinearToSrgb(0.002), 0.02584, 1e-15);
}

TEST(SrgbCurve, GoesThereAndBack) {
  // The published constants do not meet exactly at the knee: 1e-7 there, rounding elsewhere.
  for (int i = 0; i <= 100000; ++i) {
    const double coded = i / 100000.0;
    const double bound = std::fabs(coded - 0.04045) < 1e-4 ? 1e-6 : 1e-14;
    EXPECT_NEAR(LinearToSrgb(SrgbToLinear(coded)), coded, bound);
  }
}

TEST(SrgbCurve, IsOddAndGoesOnBeyondOne) {
  EXPECT_EQ(SrgbToLinear(-0.5), -SrgbToLinear(0.5));
  EXPECT_EQ(LinearToSrgb(-0.5), -LinearToSrgb(0.5));
  EXPECT_GT(SrgbToLinear(2.0), 1.0);
  EXPECT_NEAR(LinearToSrgb(SrgbToLinear(2.0)), 2.0, 1e-14);
}

TEST(Srgb8ToLinear, IsTheExactCurveRounded) {
  for (int code = 0; code < 256; ++code) {
    EXPECT_EQ(Srgb8ToLinear(static_cast<uint8_t>(code)),
              static_cast<float>(SrgbToLinear(code / 255.0)));
  }
}

// Bounded comparisons: the stated errors of the tables, on a grid that is no multiple of their
// cells.
TEST(SrgbRows, StayWithinTheirStatedError) {
  std::vector<float> in, decoded, encoded;
  for (int i = 0; i <= 999983; ++i) in.push_back(static_cast<float>(i / 999983.0));
  decoded.resize(in.size());
  encoded.resize(in.size());
  SrgbToLinearRow(in.data(), in.size(), decoded.data());
  LinearToSrgbRow(in.data(), in.size(), encoded.data());
  double decode_error = 0, encode_error = 0;
  for (size_t i = 0; i < in.size(); ++i) {
    decode_error = std::max(decode_error, std::fabs(decoded[i] - SrgbToLinear(in[i])));
    encode_error = std::max(encode_error, std::fabs(encoded[i] - LinearToSrgb(in[i])));
  }
  EXPECT_LT(decode_error, 1e-7);
  EXPECT_LT(encode_error, 1e-6);
  EXPECT_EQ(decoded.front(), 0.0f);
  EXPECT_EQ(decoded.back(), 1.0f);
  EXPECT_EQ(encoded.front(), 0.0f);
  EXPECT_EQ(encoded.back(), 1.0f);
}

TEST(SrgbRows, NeverDecrease) {
  std::vector<float> row;
  for (int i = 0; i <= 300000; ++i) row.push_back(static_cast<float>(i / 300000.0));
  std::vector<float> out(row.size());
  SrgbToLinearRow(row.data(), row.size(), out.data());
  EXPECT_TRUE(std::is_sorted(out.begin(), out.end()));
  LinearToSrgbRow(row.data(), row.size(), out.data());
  // Down by the step between the two branches at the knee at most.
  for (size_t i = 1; i < out.size(); ++i) EXPECT_GE(out[i], out[i - 1] - 2e-8f);
}

TEST(SrgbRows, TakeSpecialValuesInPlace) {
  const float inf = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> row = {-0.0f, -0.5f, 2.0f, inf, nan, 1e-40f, 65504.0f};
  const std::vector<float> before = row;
  LinearToSrgbRow(row.data(), row.size(), row.data());
  EXPECT_TRUE(std::signbit(row[0]));
  EXPECT_NEAR(row[1], LinearToSrgb(-0.5), 1e-6);
  EXPECT_FLOAT_EQ(row[2], static_cast<float>(LinearToSrgb(2.0)));
  EXPECT_EQ(row[3], inf);
  EXPECT_TRUE(std::isnan(row[4]));
  EXPECT_GE(row[5], 0.0f);
  EXPECT_FLOAT_EQ(row[6], static_cast<float>(LinearToSrgb(65504.0)));
  row = before;
  SrgbToLinearRow(row.data(), row.size(), row.data());
  EXPECT_FLOAT_EQ(row[2], static_cast<float>(SrgbToLinear(2.0)));
  EXPECT_EQ(row[3], inf);
  EXPECT_TRUE(std::isnan(row[4]));
}

}  // namespace
}  // namespace patina
