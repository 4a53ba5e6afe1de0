#include "pipeline/brdf/sampler_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "formats/brdf_sampler.h"
#include "tests/formats/sampler_chi_square.h"

namespace patina::brdf {
namespace {

// GGX with Smith's shadowing, no Fresnel term, over a diffuse base.
Luminance Ggx(double ax, double ay, double diffuse) {
  return [=](const float wi[3], const float wo[3]) {
    double h[3];
    double length = 0;
    for (int d = 0; d < 3; ++d) {
      h[d] = static_cast<double>(wi[d]) + static_cast<double>(wo[d]);
      length += h[d] * h[d];
    }
    for (double& value : h) value /= std::sqrt(length);
    const double e = h[0] * h[0] / (ax * ax) + h[1] * h[1] / (ay * ay) + h[2] * h[2];
    const double density = 1 / (M_PI * ax * ay * e * e);
    const auto lambda = [&](const float w[3]) {
      const double x = static_cast<double>(w[0]) * ax;
      const double y = static_cast<double>(w[1]) * ay;
      const double z = static_cast<double>(w[2]);
      return (std::sqrt(1 + (x * x + y * y) / (z * z)) - 1) / 2;
    };
    const double shadow = 1 / (1 + lambda(wi) + lambda(wo));
    return diffuse / M_PI +
           density * shadow / (4 * static_cast<double>(wi[2]) * static_cast<double>(wo[2]));
  };
}

struct Case {
  const char* name;
  SamplerShape shape;
  Luminance luminance;
  double gain;  // least ratio of the variances, cosine to fitted
};

std::vector<Case> Cases() {
  return {{"diffuse", {}, [](const float*, const float*) { return 0.3; }, 0},
          {"rough", {}, Ggx(0.5, 0.5, 0), 2},
          {"glossy on diffuse", {}, Ggx(0.1, 0.1, 0.5), 5},
          {"near mirror", {}, Ggx(0.002, 0.002, 0), 1000},
          {"near mirror on diffuse", {}, Ggx(0.002, 0.002, 0.5), 1000},
          {"anisotropic", DefaultSamplerShape(false), Ggx(0.2, 0.02, 0), 20}};
}

// Odds of a false alarm: z above 4.5 once in 300,000 directions.
TEST(SamplerFit, SamplesMatchThePdf) {
  for (const Case& material : Cases()) {
    const BrdfSampler sampler(FitSampler(material.shape, material.luminance));
    for (const double theta : {0.0, 0.5, 1.1, 1.4}) {
      const float wi[3] = {static_cast<float>(std::sin(theta) * std::cos(0.7)),
                           static_cast<float>(std::sin(theta) * std::sin(0.7)),
                           static_cast<float>(std::cos(theta))};
      const auto check = test::CheckSampler(sampler, wi, 100000, 9);
      EXPECT_LT(check.probability_z, 4.5)
          << material.name << " " << theta << ": " << check.chi_square << " of " << check.degrees;
      EXPECT_LE(check.integral, 1.001) << material.name;
      EXPECT_NEAR(check.integral, check.kept, 0.007) << material.name << " " << theta;
    }
  }
}

TEST(SamplerFit, LessVarianceThanCosineSampling) {
  for (const Case& material : Cases()) {
    const BrdfSamplerTables tables = FitSampler(material.shape, material.luminance);
    const double fitted = RelativeVariance(BrdfSampler(tables), material.luminance, 16, 20000);
    const double cosine = RelativeVariance(BrdfSampler(), material.luminance, 16, 20000);
    std::printf("%-24s variance %10.4f, with cosine sampling %10.4f, %zu bytes\n", material.name,
                fitted, cosine, EncodeBrdfSampler(tables)->size());
    EXPECT_GE(cosine, material.gain * fitted) << material.name;
  }
}

TEST(SamplerFit, EstimatesTheSameAlbedoAsQuadrature) {
  const Luminance luminance = Ggx(0.3, 0.3, 0.2);
  const BrdfSampler sampler(FitSampler({}, luminance));
  for (const double theta : {0.0, 0.8, 1.3}) {
    const float wi[3] = {static_cast<float>(std::sin(theta)), 0,
                         static_cast<float>(std::cos(theta))};
    double exact = 0;
    const int rows = 500;
    for (int i = 0; i < rows; ++i) {
      const double z = (i + 0.5) / rows;
      for (int j = 0; j < rows; ++j) {
        const double phi = 2 * M_PI * (j + 0.5) / rows;
        const auto sine = std::sqrt(1 - z * z);
        const float wo[3] = {static_cast<float>(sine * std::cos(phi)),
                             static_cast<float>(sine * std::sin(phi)), static_cast<float>(z)};
        exact += luminance(wi, wo) * z * 2 * M_PI / (rows * rows);
      }
    }
    test::Random random(3);
    double sum = 0;
    double squares = 0;
    const int samples = 200000;
    for (int s = 0; s < samples; ++s) {
      float u[3], wo[3], pdf;
      for (float& value : u) value = static_cast<float>(random.Next() >> 40) * 0x1p-24f;
      if (!sampler.Sample(wi, u, wo, &pdf)) continue;
      const double value =
          luminance(wi, wo) * static_cast<double>(wo[2]) / static_cast<double>(pdf);
      sum += value;
      squares += value * value;
    }
    const double mean = sum / samples;
    const double deviation = std::sqrt((squares / samples - mean * mean) / samples);
    EXPECT_NEAR(mean, exact, 4.5 * deviation + 1e-3 * exact) << theta;  // once in 150,000
  }
}

TEST(SamplerFit, BlackAndBrokenMaterialsSampleTheCosine) {
  for (const double value : {0.0, -1.0, static_cast<double>(NAN), static_cast<double>(INFINITY)}) {
    const BrdfSamplerTables tables =
        FitSampler({}, [&](const float*, const float*) { return value; });
    EXPECT_TRUE(EncodeBrdfSampler(tables));
    for (const uint8_t code : tables.mixture) EXPECT_EQ(code, 0);
  }
}

TEST(SamplerFit, IsRepeatable) {
  const SamplerShape shape = DefaultSamplerShape(false);
  const auto a = EncodeBrdfSampler(FitSampler(shape, Ggx(0.2, 0.05, 0.1)));
  const auto b = EncodeBrdfSampler(FitSampler(shape, Ggx(0.2, 0.05, 0.1)));
  EXPECT_EQ(*a, *b);
  EXPECT_EQ(a->size(), 32u + 16 * (1 + 64 * 16));
}

}  // namespace
}  // namespace patina::brdf
