#include "pipeline/jobs/sample_brdf.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>

#include "formats/brdf/merl.h"
#include "formats/brdf/rgl.h"
#include "formats/brdf/sparse.h"
#include "formats/brdf/utia.h"
#include "tests/formats/brdf/brdf_samples.h"

namespace patina {
namespace {

using brdf::Direction;
using brdf::FromDegrees;
using brdf::RandomDirection;
using test::Random;

constexpr AnalyticBrdf kAll[] = {AnalyticBrdf::kPlastic, AnalyticBrdf::kMetal,
                                 AnalyticBrdf::kMirror, AnalyticBrdf::kBrushed,
                                 AnalyticBrdf::kRings};

TEST(EvaluateAnalytic, IsReciprocalFiniteAndNotNegative) {
  Random random(41);
  for (const AnalyticBrdf material : kAll) {
    for (int i = 0; i < 20000; ++i) {
      const Direction wi = RandomDirection(random, 90);
      const Direction wo = random.Below(2) == 0 ? RandomDirection(random, 90)
                                                : FromDegrees(89.9, 360 * random.Unit());
      float a[3], b[3];
      EvaluateAnalytic(material, wi, wo, a);
      EvaluateAnalytic(material, wo, wi, b);
      for (int c = 0; c < 3; ++c) {
        ASSERT_TRUE(std::isfinite(a[c]));
        ASSERT_GE(a[c], 0);
        // The 0.1 degree lobe turns rounding of the half vector, 1e-16 / alpha^2, into 1e-9.
        ASSERT_NEAR(a[c], b[c], 1e-6f * (1 + std::abs(a[c])));
      }
    }
    float below[3] = {1, 1, 1};
    EvaluateAnalytic(material, {0, 0, 1}, {1, 0, 0}, below);
    EXPECT_EQ(below[0], 0);
  }
}

TEST(EvaluateAnalytic, IsIsotropicButForBrushed) {
  Random random(42);
  double brushed = 0;
  for (const AnalyticBrdf material : kAll) {
    if (material == AnalyticBrdf::kMirror)
      continue;  // as rounding of the turned directions shows in its lobe
    for (int i = 0; i < 5000; ++i) {
      const Direction wi = RandomDirection(random, 80);
      const Direction wo = RandomDirection(random, 80);
      const double turn = 360 * random.Unit();
      float a[3], b[3];
      EvaluateAnalytic(material, wi, wo, a);
      EvaluateAnalytic(material, brdf::Turned(wi, turn), brdf::Turned(wo, turn), b);
      if (material == AnalyticBrdf::kBrushed) {
        brushed = std::max(brushed, static_cast<double>(std::abs(a[0] - b[0])));
      } else {
        for (int c = 0; c < 3; ++c) ASSERT_NEAR(a[c], b[c], 1e-4f * (1 + a[c]));
      }
    }
  }
  EXPECT_GT(brushed, 1);
}

TEST(EvaluateAnalytic, KeepsEnergy) {
  for (const AnalyticBrdf material :
       {AnalyticBrdf::kPlastic, AnalyticBrdf::kMetal, AnalyticBrdf::kRings}) {
    for (const double theta : {0.0, 30.0, 60.0, 80.0}) {
      double albedo[3] = {0, 0, 0};
      constexpr int kN = 120;
      for (int i = 0; i < kN; ++i) {
        const double u = (i + 0.5) / kN;
        const double z = 1 - u * u;
        for (int j = 0; j < kN; ++j) {
          float rgb[3];
          EvaluateAnalytic(material, FromDegrees(theta, 0),
                           FromDegrees(std::acos(z) / brdf::kDegree, (j + 0.5) * 360 / kN), rgb);
          for (int c = 0; c < 3; ++c)
            albedo[c] += static_cast<double>(rgb[c]) * z * 2 * u / kN * 2 * std::numbers::pi / kN;
        }
      }
      for (const double value : albedo) {
        EXPECT_GT(value, 0.02);
        EXPECT_LT(value, 1) << static_cast<int>(material) << " at " << theta;
      }
    }
  }
}

TEST(EvaluateAnalytic, RingsHaveASide) {
  // Mirrored in the plane of incidence the rings change: no function of |phi|.
  float left[3], right[3];
  EvaluateAnalytic(AnalyticBrdf::kRings, FromDegrees(10, 0), FromDegrees(34, 80), left);
  EvaluateAnalytic(AnalyticBrdf::kRings, FromDegrees(10, 0), FromDegrees(34, -80), right);
  EXPECT_GT(left[1] + right[1], 0.2);
  EXPECT_GT(std::abs(left[1] - right[1]), 0.05);
}

TEST(MeasuredBrdf, HasTheNoiseThatWasAskedFor) {
  const auto measure = MeasuredBrdf(AnalyticBrdf::kPlastic, {0.05, 0.01, 0.1, 7});
  const auto again = MeasuredBrdf(AnalyticBrdf::kPlastic, {0.05, 0.01, 0.1, 7});
  const Direction wi = FromDegrees(40, 0), wo = FromDegrees(20, 180);
  float exact[3];
  EvaluateAnalytic(AnalyticBrdf::kPlastic, wi, wo, exact);
  double sum = 0, squares = 0;
  int invalid = 0, valid = 0;
  for (int i = 0; i < 20000; ++i) {
    float rgb[3], same[3];
    measure(wi, wo, rgb);
    again(wi, wo, same);
    ASSERT_EQ(rgb[1], same[1]);
    if (rgb[0] < 0) {
      ++invalid;
      continue;
    }
    ++valid;
    const double error = static_cast<double>(rgb[0] - exact[0]);
    sum += error;
    squares += error * error;
  }
  // Six standard deviations of a binomial count, of a mean and of a variance: odds of 1e-8.
  EXPECT_NEAR(invalid, 2000, 6 * 43);
  const double e = static_cast<double>(exact[0]);
  const double variance = 0.05 * 0.05 * e * e + 0.01 * 0.01;
  EXPECT_NEAR(sum / valid, 0, 6 * std::sqrt(variance / valid));
  EXPECT_NEAR(squares / valid / variance, 1, 6 * std::sqrt(2.0 / valid));
}

// What OpenBrdf would make of the bytes, by the file's extension.
Result<brdf::Source> Parse(const std::string& name, std::span<const uint8_t> bytes) {
  if (name.ends_with(".binary")) return brdf::ParseMerl(bytes, name);
  if (name.ends_with(".bsdf")) return brdf::ParseRgl(bytes, name);
  if (name.ends_with(".bin")) return brdf::ParseUtia(bytes, name);
  return brdf::ParseSparseCsv({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, name);
}

TEST(EncodeSampleBrdf, MakesFilesThatTheReadersTake) {
  struct Expected {
    const char* name;
    const char* format;
    AnalyticBrdf material;
    double bound;  // mean error of f cos relative to the mean
  };
  // The bounds leave twice what the grids give; the UTIA grid of 15 degrees cannot hold a lobe of 1
  // degree, and is only read.
  const Expected files[] = {{"plastic.binary", "merl", AnalyticBrdf::kPlastic, 0.01},
                            {"metal.binary", "merl", AnalyticBrdf::kMetal, 0.005},
                            {"mirror.binary", "merl", AnalyticBrdf::kMirror, 0.5},
                            {"rings.binary", "merl", AnalyticBrdf::kRings, 0.015},
                            {"rings_noisy.binary", "merl", AnalyticBrdf::kRings, 0.05},
                            {"brushed.bsdf", "rgl", AnalyticBrdf::kBrushed, 0.02},
                            {"brushed.bin", "utia", AnalyticBrdf::kBrushed, 1e9}};
  for (const Expected& file : files) {
    const std::vector<uint8_t> bytes = EncodeSampleBrdf(file.name, SampleBrdfOptions().noise);
    EXPECT_LE(bytes.size(), 35000000u) << file.name;
    const auto source = Parse(file.name, bytes);
    ASSERT_OK(source);
    EXPECT_EQ(source->format, file.format);
    EXPECT_EQ(source->isotropic, file.material != AnalyticBrdf::kBrushed);
    const bool noisy = std::string(file.name) == "rings_noisy.binary";
    EXPECT_EQ(source->warnings.size(), noisy ? 1u : 0u);
    if (noisy) {
      EXPECT_GT(source->invalid_cells, 90000u);
      EXPECT_LT(source->invalid_cells, 145800u);
    }
    Random random(43);
    double error = 0, sum = 0;
    for (int i = 0; i < 20000; ++i) {
      const Direction wi = RandomDirection(random, 85);
      const Direction wo = RandomDirection(random, 85);
      float read[3], exact[3];
      ASSERT_TRUE(source->table->Evaluate(wi, wo, read));
      EvaluateAnalytic(file.material, wi, wo, exact);
      error += static_cast<double>(std::abs(read[1] - exact[1]) * wo.z);
      sum += static_cast<double>(exact[1] * wo.z);
    }
    EXPECT_LT(error / sum, file.bound) << file.name;
  }
  const auto sparse = Parse("sparse.csv", EncodeSampleBrdf("sparse.csv", {}));
  ASSERT_OK(sparse);
  EXPECT_EQ(sparse->samples.size(), 448u);
  EXPECT_TRUE(sparse->isotropic);
  EXPECT_TRUE(sparse->warnings.empty());
}

TEST(WriteSampleBrdfs, WritesTheFilesAskedFor) {
  const test::TemporaryDirectory folder;
  ASSERT_OK(WriteSampleBrdfs(folder / "new/samples", {{}, {"brushed.bin", "sparse.csv"}}));
  EXPECT_EQ(brdf::OpenBrdf(folder / "new/samples/brushed.bin")->format, "utia");
  EXPECT_EQ(brdf::OpenBrdf(folder / "new/samples/sparse.csv")->samples.size(), 448u);
  EXPECT_FALSE(std::filesystem::exists(folder / "new/samples/plastic.binary"));
  const auto unknown = WriteSampleBrdfs(folder / "x", {{}, {"gold.binary"}});
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::kInvalidArgument);
}

TEST(WriteSampleBrdfs, RefusesImpossibleNoise) {
  const test::TemporaryDirectory folder;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const MeasurementNoise& noise :
       {MeasurementNoise{-1, 0, 0, 1}, MeasurementNoise{0, nan, 0, 1},
        MeasurementNoise{0, 0, 1.5, 1}, MeasurementNoise{0, 1e9, 0, 1}}) {
    const auto status = WriteSampleBrdfs(folder / "x", {noise, {}});
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "x"));
}

}  // namespace
}  // namespace patina
