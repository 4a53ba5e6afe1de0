#include "formats/brdf/merl.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "formats/base/little_endian.h"
#include "formats/brdf/angles.h"
#include "tests/formats/brdf/brdf_samples.h"

namespace patina::brdf {
namespace {

using test::MessageOf;
using test::Random;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

void SetCell(std::vector<uint8_t>& bytes, int cell, int channel, double value) {
  std::memcpy(&bytes[kMerlHeaderBytes +
                     8 * (static_cast<size_t>(channel) * kMerlCells + static_cast<size_t>(cell))],
              &value, 8);
}

int CellIndex(int h, int d, int p) { return (h * kMerlThetaD + d) * kMerlPhiD + p; }

// The same value in every cell; one buffer that each test gives back as it was.
std::vector<uint8_t> ConstantFile(double r, double g, double b) {
  std::vector<uint8_t> bytes(kMerlFileBytes);
  StoreLittle32(bytes.data(), 90);
  StoreLittle32(bytes.data() + 4, 90);
  StoreLittle32(bytes.data() + 8, 180);
  const double values[3] = {r, g, b};
  for (int c = 0; c < 3; ++c) {
    for (int cell = 0; cell < kMerlCells; ++cell) SetCell(bytes, cell, c, values[c]);
  }
  return bytes;
}

const Source& SmoothSource() {
  static const Source source = *ParseMerl(EncodeMerl(SmoothBrdf), "smooth");
  return source;
}

TEST(HalfDifference, MatchesItsInverseEverywhere) {
  Random random(1);
  for (int i = 0; i < 20000; ++i) {
    // Down to 1e-6 rad of the poles.
    const double theta_h = 1.5 * std::pow(10.0, -6 * random.Unit());
    const double theta_d = 1.5 * std::pow(10.0, -6 * random.Unit());
    const double phi_d = (2 * random.Unit() - 1) * 3.14;
    Direction wi, wo;
    FromHalfDifference(theta_h, theta_d, phi_d, &wi, &wo);
    const HalfDifference angles = ToHalfDifference(wi, wo);
    // Directions in single precision are 1e-7 wide; an azimuth is worth theta times that.
    EXPECT_NEAR(static_cast<double>(angles.theta_h), theta_h, 1e-6);
    EXPECT_NEAR(static_cast<double>(angles.theta_d), theta_d, 1e-6);
    const double azimuth =
        std::remainder(static_cast<double>(angles.phi_d) - phi_d, 2 * std::numbers::pi);
    EXPECT_NEAR(azimuth * std::sin(theta_d) * std::min(1.0, theta_h * 1e3), 0, 1e-3)
        << theta_h << " " << theta_d;
  }
}

TEST(Atan2, IsWithinItsBound) {
  for (int i = -4000; i <= 4000; ++i) {
    const double angle = std::numbers::pi * i / 4000;
    for (const double radius : {1e-20, 1e-3, 1.0, 1e15}) {
      const float y = static_cast<float>(radius * std::sin(angle));
      const float x = static_cast<float>(radius * std::cos(angle));
      EXPECT_NEAR(static_cast<double>(Atan2(y, x)),
                  std::atan2(static_cast<double>(y), static_cast<double>(x)), 3e-7);
    }
  }
  EXPECT_EQ(Atan2(0, 0), 0);
}

TEST(MerlParse, PutsCellsAtTheirMiddle) {
  std::vector<uint8_t> bytes = ConstantFile(-1, -1, -1);
  const int places[][3] = {{0, 0, 0}, {0, 89, 90}, {10, 0, 179}, {37, 41, 12}, {50, 20, 90}};
  int tested = 0;
  for (const auto& place : places) {
    const int cell = CellIndex(place[0], place[1], place[2]);
    for (int c = 0; c < 3; ++c) SetCell(bytes, cell, c, 300.0 * (c + 1));
    const auto source = ParseMerl(bytes, "one cell");
    ASSERT_OK(source);
    const MerlNode node = MerlNodeAt(place[0], place[1], place[2]);
    Direction wi, wo;
    FromHalfDifference(node.theta_h, node.theta_d, node.phi_d, &wi, &wo);
    float rgb[3];
    ASSERT_TRUE(source->table->Evaluate(wi, wo, rgb));
    EXPECT_FLOAT_EQ(rgb[0], 0.2f);
    EXPECT_FLOAT_EQ(rgb[1], 0.46f);
    EXPECT_FLOAT_EQ(rgb[2], 0.996f);
    // Three cells away there is nothing.
    const MerlNode far = MerlNodeAt(place[0], place[1], (place[2] + 3) % kMerlPhiD);
    FromHalfDifference(far.theta_h, far.theta_d, far.phi_d, &wi, &wo);
    if (wi.z > 0 && wo.z > 0 && place[0] > 0 && place[1] > 0) {
      EXPECT_FALSE(source->table->Evaluate(wi, wo, rgb));
      EXPECT_EQ(rgb[0], 0);
      ++tested;
    }
    for (int c = 0; c < 3; ++c) SetCell(bytes, cell, c, -1);
  }
  EXPECT_GE(tested, 2);
}

TEST(MerlEvaluate, IsCloseToWhatWasWritten) {
  const Source& source = SmoothSource();
  EXPECT_TRUE(source.isotropic);
  EXPECT_EQ(source.format, "merl");
  EXPECT_EQ(source.cells, 1458000u);
  EXPECT_EQ(source.invalid_cells, 0u);
  EXPECT_TRUE(source.warnings.empty());
  Random random(2);
  const auto check = [&](const Direction& wi, const Direction& wo, double bound) {
    float read[3], exact[3];
    ASSERT_TRUE(source.table->Evaluate(wi, wo, read)) << wi.z << " " << wo.z;
    SmoothBrdf(wi, wo, exact);
    for (int c = 0; c < 3; ++c)
      ASSERT_NEAR(static_cast<double>(read[c]), static_cast<double>(exact[c]), bound)
          << wi.x << " " << wi.y << " " << wi.z << "; " << wo.x << " " << wo.y << " " << wo.z;
  };
  // Second differences of the function over cells of 1 degree (2 in theta_h at the horizon) are
  // below 1e-3.
  for (int i = 0; i < 100000; ++i)
    check(RandomDirection(random, 85), RandomDirection(random, 85), 2e-3);
  // About the normal, about retro-reflection and the mirror direction: half a cell of held values
  // at the ends.
  for (int i = 0; i < 2000; ++i) {
    const double phi = 360 * random.Unit();
    const double tiny = std::pow(10.0, -6 * random.Unit());
    check({0, 0, 1}, FromDegrees(tiny, phi), 2e-3);
    const Direction wi = RandomDirection(random, 80);
    check(wi, wi, 2e-3);
    check(wi, {-wi.x, -wi.y, wi.z}, 2e-3);
    check(wi, Turned(wi, 1e-4), 2e-3);
  }
  // Grazing: the horizon cuts through the cells, and what is left of them extrapolates by up to a
  // cell.
  for (int i = 0; i < 20000; ++i)
    check(FromDegrees(89.9, 360 * random.Unit()), RandomDirection(random, 80), 0.02);
}

TEST(MerlEvaluate, IsFiniteAndWithinTheDataAtGrazingAngles) {
  const Source& source = SmoothSource();
  Random random(3);
  int missing = 0;
  for (int i = 0; i < 50000; ++i) {
    const Direction wi = FromDegrees(85 + 4.999 * random.Unit(), 360 * random.Unit());
    const Direction wo = FromDegrees(85 + 4.999 * random.Unit(), 360 * random.Unit());
    float rgb[3];
    missing += source.table->Evaluate(wi, wo, rgb) ? 0 : 1;
    for (const float value : rgb) {
      ASSERT_GE(value, 0);
      ASSERT_LE(value, 1.0f);
    }
  }
  // No cell with its middle above the horizon is near: a corner of the table at theta_h = theta_d =
  // 90 degrees.
  EXPECT_LT(missing, 500);
}

TEST(MerlEvaluate, IsReciprocalAndIsotropic) {
  const Source& source = SmoothSource();
  Random random(4);
  for (int i = 0; i < 20000; ++i) {
    const Direction wi = RandomDirection(random, 85);
    const Direction wo = RandomDirection(random, 85);
    float a[3], b[3], c[3];
    const double turn = 360 * random.Unit();
    source.table->Evaluate(wi, wo, a);
    source.table->Evaluate(wo, wi, b);
    source.table->Evaluate(Turned(wi, turn), Turned(wo, turn), c);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(a[k], b[k], 1e-5);
      EXPECT_NEAR(a[k], c[k], 1e-5);
    }
  }
}

TEST(MerlEvaluate, IsContinuousWherePhiWraps) {
  const Source& source = SmoothSource();
  Random random(5);
  for (int i = 0; i < 5000; ++i) {
    const double theta_h = 0.1 + 0.5 * random.Unit();
    const double theta_d = 0.1 + 0.5 * random.Unit();
    for (const double phi : {0.0, std::numbers::pi, -std::numbers::pi}) {
      Direction wi, wo;
      float a[3], b[3];
      FromHalfDifference(theta_h, theta_d, phi - 1e-5, &wi, &wo);
      source.table->Evaluate(wi, wo, a);
      FromHalfDifference(theta_h, theta_d, phi + 1e-5, &wi, &wo);
      source.table->Evaluate(wi, wo, b);
      EXPECT_NEAR(a[0], b[0], 1e-4);
    }
  }
}

TEST(MerlEvaluate, RefusesDirectionsBelowTheHorizonAndNan) {
  const Source& source = SmoothSource();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  float rgb[3] = {1, 2, 3};
  EXPECT_FALSE(source.table->Evaluate({0, 1, 0}, {0, 0, 1}, rgb));
  EXPECT_EQ(rgb[2], 0);
  EXPECT_FALSE(source.table->Evaluate({0, 0, 1}, {0, 0, -1}, rgb));
  EXPECT_FALSE(source.table->Evaluate({0, 0, nan}, {0, 0, 1}, rgb));
  // No crash and no NaN.
  for (const float x : {nan, inf, -inf}) {
    source.table->Evaluate({x, 0, 1}, {0, x, 1}, rgb);
    EXPECT_EQ(rgb[0], rgb[0]);
  }
}

TEST(MerlParse, LeavesInvalidCellsOutAndSaysSo) {
  std::vector<uint8_t> bytes = ConstantFile(750, 750, 750);
  Random random(6);
  uint64_t expected = 0;
  for (int cell = 0; cell < kMerlCells; ++cell) {
    if (random.Below(10) != 0) continue;
    const double bad[] = {-1, kNan, kInf, -kInf, 1e300, -1e-3};
    SetCell(bytes, cell, random.Below(3), bad[random.Below(6)]);
    const MerlNode node = MerlNodeAt(cell / 16200, cell / 180 % 90, cell % 180);
    Direction wi, wo;
    FromHalfDifference(node.theta_h, node.theta_d, node.phi_d, &wi, &wo);
    if (std::min(wi.z, wo.z) > 0) ++expected;
  }
  const auto source = ParseMerl(bytes, "holes");
  ASSERT_OK(source);
  EXPECT_NEAR(static_cast<double>(source->invalid_cells), static_cast<double>(expected), 5);
  ASSERT_EQ(source->warnings.size(), 2u);
  EXPECT_NE(source->warnings[0].find("negative left out, the first at cell (theta_h "),
            std::string::npos)
      << source->warnings[0];
  EXPECT_NE(source->warnings[1].find("not finite"), std::string::npos) << source->warnings[1];
  // A constant stays that constant: nothing is blended with 0.
  for (int i = 0; i < 50000; ++i) {
    float rgb[3];
    ASSERT_TRUE(
        source->table->Evaluate(RandomDirection(random, 85), RandomDirection(random, 85), rgb));
    ASSERT_NEAR(rgb[0], 0.5f, 1e-6);
    ASSERT_NEAR(rgb[1], 0.575f, 1e-6);
  }
}

TEST(MerlParse, NamesTheFirstBadCell) {
  std::vector<uint8_t> bytes = ConstantFile(1, 1, 1);
  SetCell(bytes, CellIndex(3, 2, 7), 2, -1);
  SetCell(bytes, CellIndex(3, 2, 8), 0, -1);
  const auto source = ParseMerl(bytes, "two");
  ASSERT_OK(source);
  ASSERT_EQ(source->warnings.size(), 1u);
  EXPECT_EQ(
      source->warnings[0],
      "2 cells that are negative left out, the first at cell (theta_h 3, theta_d 2, phi_d 7), "
      "byte " +
          std::to_string(12 + 8 * CellIndex(3, 2, 7)));
}

TEST(MerlParse, RefusesATableWithoutAValidCell) {
  const auto source = ParseMerl(ConstantFile(1, kNan, -1), "bad.binary");
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().code, ErrorCode::kCorruptData);
  EXPECT_EQ(source.error().message.rfind("bad.binary: no valid cell", 0), 0u);
}

TEST(MerlParse, NoticesTruncationAndTrailingBytes) {
  std::vector<uint8_t> bytes = ConstantFile(1, 1, 1);
  const auto truncated = [&](std::span<const uint8_t> part) {
    const auto result = ParseMerl(part, "short");
    ASSERT_FALSE(result);
    ASSERT_EQ(result.error().code, ErrorCode::kCorruptData);
    ASSERT_EQ(result.error().message.rfind("short: truncated", 0), 0u) << result.error().message;
  };
  for (size_t size = 0; size < 200; ++size) truncated(test::Prefix(bytes, size));
  for (size_t size = 200; size < bytes.size(); size += 9973)
    truncated(std::span(bytes).first(size));
  truncated(std::span(bytes).first(bytes.size() - 1));
  bytes.push_back(0);
  EXPECT_EQ(MessageOf(ParseMerl(bytes, "long")).rfind("long: trailing bytes", 0), 0u);
}

TEST(MerlParse, RefusesOtherDimensions) {
  std::vector<uint8_t> bytes(kMerlFileBytes);
  const int32_t dimensions[][3] = {
      {180, 90, 90},        {90, 90, 360}, {0, 0, 0},
      {-90, 90, 180},       {90, -1, 180}, {0x7FFFFFFF, 0x7FFFFFFF, 0x7FFFFFFF},
      {1 << 16, 1 << 16, 1}};
  for (const auto& sides : dimensions) {
    for (int i = 0; i < 3; ++i)
      StoreLittle32(bytes.data() + 4 * i, static_cast<uint32_t>(sides[i]));
    const auto result = ParseMerl(bytes, "odd");
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::kCorruptData);
    EXPECT_NE(
        result.error().message.find(std::to_string(sides[0]) + " x " + std::to_string(sides[1])),
        std::string::npos)
        << result.error().message;
  }
}

}  // namespace
}  // namespace patina::brdf
