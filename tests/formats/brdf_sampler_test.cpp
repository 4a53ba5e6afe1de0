#include "formats/brdf_sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "formats/base/little_endian.h"
#include "formats/weights.h"
#include "tests/formats/sample_brdf.h"
#include "tests/formats/sampler_chi_square.h"

namespace patina {
namespace {

using test::CheckSampler;
using test::MessageOf;
using test::Random;
using test::RandomTables;

bool StartsWith(const std::string& text, const char* start) { return text.rfind(start, 0) == 0; }

BrdfSamplerTables SmallTables() {
  Random random(3);
  return RandomTables(random, 3, 5, 2, false);
}

std::vector<uint8_t> Resealed(std::vector<uint8_t> bytes) {
  StoreLittle32(&bytes[12], 0);
  StoreLittle32(&bytes[12], Crc32(bytes));
  return bytes;
}

TEST(BrdfSampler, RoundTripsAndRefusesDamage) {
  const BrdfSamplerTables tables = SmallTables();
  const std::vector<uint8_t> good = *EncodeBrdfSampler(tables);
  ASSERT_EQ(good.size(), 32u + 3 * (1 + 10));
  EXPECT_EQ(std::memcmp(good.data(), "PATINASM\1\0\0\0", 12), 0);
  const uint8_t sizes[] = {3, 0, 5, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(std::memcmp(good.data() + 16, sizes, sizeof sizes), 0);
  EXPECT_EQ(Resealed(good), good);
  const auto read = ParseBrdfSampler(good);
  ASSERT_OK(read);
  EXPECT_EQ(read->theta_i_bins, 3);
  EXPECT_EQ(read->theta_h_cells, 5);
  EXPECT_EQ(read->phi_cells, 2);
  EXPECT_FALSE(read->relative_phi);
  EXPECT_EQ(read->mixture, tables.mixture);
  EXPECT_EQ(read->mass, tables.mass);

  for (size_t size = 0; size < good.size(); ++size)
    EXPECT_TRUE(StartsWith(MessageOf(ParseBrdfSampler(test::Prefix(good, size))), "truncated"));
  std::vector<uint8_t> bytes = good;
  bytes.push_back(0);
  EXPECT_TRUE(StartsWith(MessageOf(ParseBrdfSampler(bytes)), "trailing bytes"));
  for (size_t bit = 0; bit < good.size() * 8; ++bit) {
    bytes = good;
    bytes[bit / 8] = static_cast<uint8_t>(bytes[bit / 8] ^ 1 << (bit % 8));
    ASSERT_FALSE(ParseBrdfSampler(bytes)) << bit;
  }
  bytes = good;
  bytes[0] = 'p';
  EXPECT_TRUE(StartsWith(MessageOf(ParseBrdfSampler(bytes)), "bad magic"));
  bytes = good;
  bytes[8] = 2;
  EXPECT_EQ(ParseBrdfSampler(bytes).error().code, ErrorCode::kUnsupported);
  bytes[8] = 0;
  EXPECT_TRUE(StartsWith(MessageOf(ParseBrdfSampler(bytes)), "bad header"));
  for (const auto& [at, value] :
       std::initializer_list<std::pair<size_t, uint32_t>>{{16, 0},
                                                          {16, 65 | 5u << 16},
                                                          {16, 3},
                                                          {16, 3 | 257u << 16},
                                                          {16, 0xFFFFFFFF},
                                                          {20, 0},
                                                          {20, 65},
                                                          {20, 2 | 2u << 16},
                                                          {20, 2 | 1u << 24},
                                                          {24, 1},
                                                          {28, 0x80000000}}) {
    bytes = good;
    StoreLittle32(&bytes[at], value);
    EXPECT_TRUE(StartsWith(MessageOf(ParseBrdfSampler(Resealed(bytes))), "bad header")) << at;
  }
  bytes = good;
  std::fill(bytes.begin() + 32 + 3 + 10, bytes.begin() + 32 + 3 + 20, uint8_t{0});
  EXPECT_TRUE(StartsWith(MessageOf(ParseBrdfSampler(Resealed(bytes))), "bad table: bin 1"));
}

TEST(BrdfSampler, WriterRefusesBrokenRules) {
  for (int rule = 0; rule < 5; ++rule) {
    BrdfSamplerTables tables = SmallTables();
    if (rule == 0) tables.theta_i_bins = 65;
    if (rule == 1) tables.phi_cells = 0;
    if (rule == 2) tables.mixture.pop_back();
    if (rule == 3) tables.mass.push_back(0);
    if (rule == 4) std::fill(tables.mass.begin(), tables.mass.end(), uint8_t{0});
    EXPECT_EQ(EncodeBrdfSampler(tables).error().code, ErrorCode::kInvalidArgument) << rule;
  }
}

TEST(BrdfSampler, FilesRoundTrip) {
  const test::TemporaryDirectory directory;
  ASSERT_OK(WriteBrdfSampler(directory / "sampler.bin", SmallTables()));
  const auto read = ReadBrdfSamplerFile(directory / "sampler.bin");
  ASSERT_OK(read);
  EXPECT_EQ(read->mass, SmallTables().mass);
  EXPECT_EQ(ReadBrdfSamplerFile(directory / "absent").error().code, ErrorCode::kNotFound);
}

TEST(BrdfSampler, MassIsAPowerOfTheCode) {
  EXPECT_EQ(brdf_sampler_detail::MassOf(0), 0);
  for (int code = 1; code < 256; ++code) {
    EXPECT_NEAR(
        brdf_sampler_detail::MassOf(static_cast<uint8_t>(code)) / std::pow(2.0, (code - 255) / 8.0),
        1, 1e-15);
  }
}

// Odds of a false alarm: z above 4 once in 30,000 tables and directions.
TEST(BrdfSampler, DrawsWhatItsPdfSays) {
  Random random(4);
  for (int i = 0; i < 12; ++i) {
    const BrdfSampler sampler(i == 0 ? BrdfSampler()
                                     : BrdfSampler(RandomTables(random, 1 + random.Below(8), 16,
                                                                1 << random.Below(4), i % 2 == 0)));
    for (const double theta : {0.0, 0.3, 1.0, 1.5}) {
      const double phi = 2 * M_PI * random.Unit();
      const float wi[3] = {static_cast<float>(std::sin(theta) * std::cos(phi)),
                           static_cast<float>(std::sin(theta) * std::sin(phi)),
                           static_cast<float>(std::cos(theta))};
      const auto check = CheckSampler(sampler, wi, 100000, 7 + static_cast<uint64_t>(i));
      EXPECT_LT(check.probability_z, 4)
          << i << " theta " << theta << ": " << check.chi_square << " of " << check.degrees;
      // Four standard deviations of the share, and the quadrature at the horizon.
      EXPECT_NEAR(check.integral, check.kept, 0.007) << i << " theta " << theta;
      EXPECT_LE(check.integral, 1.001);
    }
  }
}

TEST(BrdfSampler, GivesNothingBelowTheHorizon) {
  Random random(5);
  const BrdfSampler sampler(RandomTables(random, 4, 16, 4, true));
  const float up[3] = {0, 0, 1};
  const float down[3] = {0, 0.6f, -0.8f};
  const float flat[3] = {1, 0, 0};
  const float u[3] = {0.5f, 0.5f, 0.5f};
  float wo[3];
  float pdf;
  for (const float* wi : {down, flat}) {
    EXPECT_FALSE(sampler.Sample(wi, u, wo, &pdf));
    EXPECT_EQ(pdf, 0);
    EXPECT_EQ(sampler.Pdf(wi, up), 0);
    EXPECT_EQ(sampler.Pdf(up, wi), 0);
  }
  const float nan[3] = {NAN, NAN, NAN};
  EXPECT_FALSE(sampler.Sample(nan, u, wo, &pdf));
  EXPECT_EQ(sampler.Pdf(up, nan), 0);
}

}  // namespace
}  // namespace patina
