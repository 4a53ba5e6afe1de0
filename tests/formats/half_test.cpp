#include "formats/half.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "tests/formats/test_support.h"

namespace patina {
namespace {

float FromBits(uint32_t bits) {
  float value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

// The definition, with no bit tricks.
double ValueOf(uint16_t half) {
  const int exponent = (half >> 10) & 31;
  const int mantissa = half & 0x3FF;
  const double magnitude =
      exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25);
  return (half & 0x8000) != 0 ? -magnitude : magnitude;
}

TEST(Half, EveryFiniteValueIsExactAndComesBack) {
  for (int bits = 0; bits < 65536; ++bits) {
    const auto half = static_cast<uint16_t>(bits);
    if (!HalfIsFinite(half)) continue;
    const float value = HalfToFloat(half);
    ASSERT_EQ(static_cast<double>(value), ValueOf(half)) << bits;
    ASSERT_EQ(FloatToHalf(value), half) << bits;
  }
  EXPECT_TRUE(std::signbit(HalfToFloat(0x8000)));
}

TEST(Half, KeepsInfinityAndNan) {
  EXPECT_EQ(HalfToFloat(0x7C00), INFINITY);
  EXPECT_EQ(HalfToFloat(0xFC00), -INFINITY);
  EXPECT_EQ(FloatToHalf(INFINITY), 0x7C00);
  EXPECT_EQ(FloatToHalf(-INFINITY), 0xFC00);
  for (int bits = 0x7C01; bits < 0x8000; ++bits) {
    ASSERT_TRUE(std::isnan(HalfToFloat(static_cast<uint16_t>(bits))));
    ASSERT_FALSE(HalfIsFinite(static_cast<uint16_t>(bits)));
  }
  // A signalling NaN becomes quiet, one whose payload lies in the low bits does not become
  // infinity.
  EXPECT_EQ(FloatToHalf(FromBits(0x7F800001)), 0x7E00);
  EXPECT_EQ(FloatToHalf(FromBits(0xFFC02000)), 0xFE01);
}

TEST(Half, RoundsToNearestWithTiesToEven) {
  // Around every midpoint of neighbours, denormals and the step to infinity included.
  for (int bits = 0; bits < 0x7BFF; ++bits) {
    const auto low = static_cast<uint16_t>(bits);
    const auto high = static_cast<uint16_t>(bits + 1);
    const auto middle = static_cast<float>((ValueOf(low) + ValueOf(high)) / 2);
    ASSERT_EQ(FloatToHalf(middle), (bits & 1) == 0 ? low : high) << bits;
    ASSERT_EQ(FloatToHalf(std::nextafter(middle, 0.0f)), low) << bits;
    ASSERT_EQ(FloatToHalf(std::nextafter(middle, 1e9f)), high) << bits;
    ASSERT_EQ(FloatToHalf(-middle), 0x8000 | ((bits & 1) == 0 ? low : high)) << bits;
  }
  EXPECT_EQ(FloatToHalf(65519.996f), 0x7BFF);
  EXPECT_EQ(FloatToHalf(65520.0f), 0x7C00);
  EXPECT_EQ(FloatToHalf(1e30f), 0x7C00);
  EXPECT_EQ(FloatToHalf(0x1p-25f), 0);
  EXPECT_EQ(FloatToHalf(std::nextafter(0x1p-25f, 1.0f)), 1);
  EXPECT_EQ(FloatToHalf(std::numeric_limits<float>::denorm_min()), 0);
}

}  // namespace
}  // namespace patina
