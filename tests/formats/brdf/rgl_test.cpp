#include "formats/brdf/rgl.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "formats/base/file_io.h"
#include "formats/brdf/angles.h"
#include "formats/brdf/rgl_warp.h"
#include "formats/brdf/spectrum.h"
#include "formats/brdf/tensor_file.h"
#include "tests/formats/brdf/brdf_samples.h"
#include "tests/formats/brdf/tensors.h"

namespace patina::brdf {
namespace {

using test::Random;

// Directional albedo by a fixed quadrature over the view directions (even in the solid angle).
void Albedo(const Table& table, const Direction& wi, double albedo[3]) {
  constexpr int kZ = 100, kPhi = 100;
  albedo[0] = albedo[1] = albedo[2] = 0;
  for (int i = 0; i < kZ; ++i) {
    // z = 1 - u^2 puts more of the points about the normal.
    const double u = (i + 0.5) / kZ;
    const double z = 1 - u * u;
    for (int j = 0; j < kPhi; ++j) {
      float rgb[3];
      table.Evaluate(wi, FromDegrees(std::acos(z) / kDegree, (j + 0.5) * 360 / kPhi), rgb);
      const double weight = z * 2 * u / kZ * 2 * std::numbers::pi / kPhi;
      for (int c = 0; c < 3; ++c) albedo[c] += static_cast<double>(rgb[c]) * weight;
    }
  }
}

TEST(UnitWarp, IsTheIntegralOfItsDensity) {
  Random random(11);
  constexpr int kHeight = 5, kWidth = 4;
  std::vector<float> density;
  for (int i = 0; i < 2 * kHeight * kWidth; ++i)
    density.push_back(static_cast<float>(random.Unit() + 0.1));
  const UnitWarp warp(density, 2, kHeight, kWidth);
  const UnitGrid grids[2] = {
      UnitGrid({density.begin(), density.begin() + kHeight * kWidth}, kHeight, kWidth),
      UnitGrid({density.begin() + kHeight * kWidth, density.end()}, kHeight, kWidth)};
  for (int slice = 0; slice < 2; ++slice) {
    const float one = 1;
    for (int k = 0; k < 10; ++k) {
      const double x = random.Unit();
      const double y = random.Unit();
      // The midpoint rule, with an error of 1e-6 for 1000 points.
      const auto row = [&](double end, double at) {
        double sum = 0;
        for (int i = 0; i < 1000; ++i) {
          const UnitPoint p{static_cast<float>(end * (i + 0.5) / 1000), static_cast<float>(at)};
          sum += static_cast<double>(grids[slice].At(p)) * end / 1000;
        }
        return sum;
      };
      double below = 0, total = 0;
      for (int j = 0; j < 100; ++j) {
        below += row(1, y * (j + 0.5) / 100) * y / 100;
        total += row(1, (j + 0.5) / 100) / 100;
      }
      const UnitPoint u =
          warp.Invert({static_cast<float>(x), static_cast<float>(y)}, &slice, &one, 1);
      EXPECT_NEAR(u.x, row(x, y) / row(1, y), 1e-4);
      EXPECT_NEAR(u.y, below / total, 1e-4);
    }
  }
}

TEST(UnitWarp, SampleIsTheInverse) {
  Random random(12);
  std::vector<float> density;
  for (int i = 0; i < 16 * 16; ++i)
    density.push_back(static_cast<float>(std::pow(10.0, -4 * random.Unit())));
  const UnitWarp warp(density, 1, 16, 16);
  const int slice = 0;
  const float one = 1;
  for (int i = 0; i < 2000; ++i) {
    const UnitPoint uniform{static_cast<float>(random.Unit()), static_cast<float>(random.Unit())};
    const UnitPoint back = warp.Invert(warp.Sample(uniform, 0), &slice, &one, 1);
    // Rounding of the place, 1e-7, times the largest density, about 20.
    EXPECT_NEAR(back.x, uniform.x, 1e-5);
    EXPECT_NEAR(back.y, uniform.y, 1e-5);
  }
  for (const float u : {0.0f, 1.0f}) {
    const UnitPoint p = warp.Sample({u, u}, 0);
    EXPECT_NEAR(p.x, u, 1e-6);
    EXPECT_NEAR(p.y, u, 1e-6);
    const UnitPoint back = warp.Invert({u, u}, &slice, &one, 1);
    EXPECT_NEAR(back.x, u, 1e-6);
    EXPECT_NEAR(back.y, u, 1e-6);
  }
}

// f cos(theta_o) of a file against the function; returns the mean error relative to the mean.
struct Closeness {
  double mean = 0, worst = 0;
};
template <class Brdf>
Closeness Compare(const Source& source, Brdf&& brdf, double max_theta) {
  Random random(13);
  double error = 0, sum = 0;
  Closeness result;
  for (int i = 0; i < 10000; ++i) {
    const Direction wi = RandomDirection(random, max_theta);
    const Direction wo = RandomDirection(random, max_theta);
    float read[3], exact[3];
    EXPECT_TRUE(source.table->Evaluate(wi, wo, read));
    brdf(wi, wo, exact);
    for (int c = 0; c < 3; ++c) {
      const double difference =
          std::abs(static_cast<double>(read[c] - exact[c])) * static_cast<double>(wo.z);
      error += difference;
      sum += static_cast<double>(exact[c] * wo.z);
      result.worst = std::max(result.worst, difference);
    }
  }
  result.mean = error / sum;
  return result;
}

TEST(RglEvaluate, IsCloseToAnIsotropicBrdf) {
  RglLayout layout;
  layout.alpha_x = 0.3;
  layout.theta_count = 16;
  layout.warp_side = 64;
  const auto source = ParseRgl(EncodeRgl(SmoothBrdf, layout, "test"), "iso");
  ASSERT_OK(source);
  EXPECT_EQ(source->format, "rgl");
  EXPECT_TRUE(source->isotropic);
  EXPECT_NEAR(source->max_theta_rad, kHalfPi, 1e-6);
  EXPECT_EQ(source->cells, 16u * 32 * 32);
  EXPECT_EQ(source->invalid_cells, 0u);
  // Interpolation between 32 x 32 places of a diffuse colour that the highlight's parameterisation
  // spreads unevenly.
  const Closeness close = Compare(*source, SmoothBrdf, 80);
  EXPECT_LT(close.mean, 0.01);
  EXPECT_LT(close.worst, 0.12);
}

TEST(RglEvaluate, IsIsotropicWhereTheFileIs) {
  RglLayout layout;
  layout.warp_side = 32;
  layout.colour_side = 16;
  const auto source = ParseRgl(EncodeRgl(SmoothBrdf, layout, ""), "iso");
  ASSERT_OK(source);
  Random random(14);
  for (int i = 0; i < 5000; ++i) {
    const Direction wi = RandomDirection(random, 85);
    const Direction wo = RandomDirection(random, 85);
    const double turn = 360 * random.Unit();
    float a[3], b[3];
    source->table->Evaluate(wi, wo, a);
    source->table->Evaluate(Turned(wi, turn), Turned(wo, turn), b);
    // A change of 1e-6 in the azimuth, between nodes where f may change by 10 % of its size /
    // cos(85).
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], 2e-4 * (1 + a[c]));
  }
}

TEST(RglEvaluate, UnderstandsEverySymmetryOfAnisotropicFiles) {
  RglLayout layout;
  layout.isotropic = false;
  layout.alpha_x = 0.35;
  layout.alpha_y = 0.25;
  layout.theta_count = 12;
  layout.warp_side = 48;
  layout.colour_side = 24;
  struct Case {
    int reduction, phis;
    void (*brdf)(const Direction&, const Direction&, float*);
  };
  for (const Case& c : {Case{1, 25, SkewBrdf}, Case{2, 13, TurnedBrdf}}) {
    layout.reduction = c.reduction;
    layout.phi_count = c.phis;
    const std::vector<uint8_t> bytes = EncodeRgl(c.brdf, layout, "test");
    const auto source = ParseRgl(bytes, "aniso");
    ASSERT_OK(source);
    EXPECT_FALSE(source->isotropic);
    const Closeness close = Compare(*source, c.brdf, 80);
    EXPECT_LT(close.mean, 0.03) << c.reduction;
    // A file without the field is understood by the range of its azimuths.
    std::vector<TensorToWrite> tensors = TensorsOf(bytes);
    std::erase_if(tensors, [](const TensorToWrite& t) { return t.name == "reduction"; });
    const auto untold = ParseRgl(EncodeTensorFile(tensors), "aniso");
    ASSERT_OK(untold);
    EXPECT_EQ(Compare(*untold, c.brdf, 80).mean, close.mean);
  }
  const auto mirrored = [](const Direction& wi, const Direction& wo, float rgb[3]) {
    MirroredBrdf(wi, wo, rgb);
  };
  layout.reduction = 4;
  layout.phi_count = 7;
  const auto source = ParseRgl(EncodeRgl(mirrored, layout, "test"), "aniso");
  ASSERT_OK(source);
  EXPECT_LT(Compare(*source, mirrored, 80).mean, 0.03);
}

TEST(RglEvaluate, ShiftsAzimuthsOfAnyRange) {
  // The same material with the azimuths of the light counted from 0 instead of -pi.
  RglLayout layout;
  layout.isotropic = false;
  layout.reduction = 2;
  layout.phi_count = 9;
  layout.warp_side = 24;
  layout.colour_side = 12;
  layout.alpha_x = 0.35;
  std::vector<uint8_t> bytes = EncodeRgl(TurnedBrdf, layout, "");
  const auto low = ParseRgl(bytes, "low");
  ASSERT_OK(low);
  std::vector<TensorToWrite> tensors = TensorsOf(bytes);
  std::vector<float> phi;
  for (int i = 0; i < 9; ++i) phi.push_back(kTwoPi - kPi + static_cast<float>(i) * kPi / 8);
  Named(tensors, "phi_i") = FloatTensor("phi_i", {9}, phi);
  const auto high = ParseRgl(EncodeTensorFile(tensors), "high");
  ASSERT_OK(high);
  Random random(15);
  for (int i = 0; i < 3000; ++i) {
    const Direction wi = RandomDirection(random, 80);
    const Direction wo = RandomDirection(random, 80);
    float a[3], b[3];
    low->table->Evaluate(wi, wo, a);
    high->table->Evaluate(wi, wo, b);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], 1e-3);
  }
}

TEST(RglEvaluate, DividesByTheCosineAndKnowsTheJacobianFlag) {
  RglLayout layout;
  layout.warp_side = 16;
  layout.colour_side = 4;
  layout.theta_count = 3;
  layout.alpha_x = 0.5;
  std::vector<TensorToWrite> tensors = TensorsOf(EncodeRgl(SmoothBrdf, layout, ""));
  const std::vector<float> constant(3 * 3 * 4 * 4, 0.25f);
  Named(tensors, "rgb") = FloatTensor("rgb", {1, 3, 3, 4, 4}, constant);
  const auto with = ParseRgl(EncodeTensorFile(tensors), "with");
  Named(tensors, "jacobian").data[0] = 0;
  const auto without = ParseRgl(EncodeTensorFile(tensors), "without");
  std::erase_if(tensors, [](const TensorToWrite& t) { return t.name == "jacobian"; });
  const auto untold = ParseRgl(EncodeTensorFile(tensors), "untold");
  ASSERT_OK(with);
  ASSERT_OK(without);
  ASSERT_OK(untold);
  Random random(16);
  for (int i = 0; i < 5000; ++i) {
    const Direction wi = RandomDirection(random, 85);
    const Direction wo = RandomDirection(random, 85);
    float rgb[3];
    ASSERT_TRUE(without->table->Evaluate(wi, wo, rgb));
    EXPECT_NEAR(rgb[1] * wo.z, 0.25, 1e-6);
    // ndf / (4 sigma) of GGX with alpha 0.5, between nodes of 6 degrees.
    ASSERT_TRUE(with->table->Evaluate(wi, wo, rgb));
    const double hx = static_cast<double>(wi.x + wo.x), hy = static_cast<double>(wi.y + wo.y),
                 hz = static_cast<double>(wi.z + wo.z);
    const double cos2 = hz * hz / (hx * hx + hy * hy + hz * hz);
    const double d = cos2 * (0.25 - 1) + 1;
    const double z = static_cast<double>(wi.z);
    const double sigma = 0.5 * (z + std::sqrt(0.25 * (1 - z * z) + z * z));
    const double exact = 0.25 * 0.25 / (std::numbers::pi * d * d) / (4 * sigma);
    EXPECT_NEAR(static_cast<double>(rgb[0] * wo.z) / exact, 1, 0.03);
    float again[3];
    ASSERT_TRUE(untold->table->Evaluate(wi, wo, again));
    EXPECT_EQ(again[0], rgb[0]);
  }
}

TEST(RglEvaluate, IsFiniteUpToTheHorizon) {
  RglLayout layout;
  layout.warp_side = 64;
  const auto source = ParseRgl(EncodeRgl(SmoothBrdf, layout, ""), "iso");
  ASSERT_OK(source);
  Random random(17);
  for (int i = 0; i < 20000; ++i) {
    const Direction wi =
        FromDegrees(random.Below(2) == 0 ? 89.9 : 90 * random.Unit(), 360 * random.Unit());
    const Direction wo =
        FromDegrees(random.Below(2) == 0 ? 89.9 : 90 * random.Unit(), 360 * random.Unit());
    if (std::min(wi.z, wo.z) <= 0) continue;
    float rgb[3];
    ASSERT_TRUE(source->table->Evaluate(wi, wo, rgb));
    for (const float value : rgb) {
      ASSERT_GE(value, 0);
      ASSERT_LT(value, 100);  // f cos below 1, by the cosine's floor of 0.01
    }
  }
  float rgb[3];
  EXPECT_TRUE(source->table->Evaluate({0, 0, 1}, {0, 0, 1}, rgb));
  EXPECT_FALSE(source->table->Evaluate({1, 0, 0}, {0, 0, 1}, rgb));
  EXPECT_FALSE(source->table->Evaluate({0, 0, 1}, {0, 0, -1}, rgb));
}

TEST(RglParse, TurnsSpectraIntoRec709) {
  RglLayout layout;
  layout.warp_side = 16;
  layout.colour_side = 6;
  layout.theta_count = 3;
  const auto grey = [](const Direction& wi, const Direction& wo, float rgb[3]) {
    SmoothBrdf(wi, wo, rgb);
    rgb[0] = rgb[2] = rgb[1];
  };
  std::vector<TensorToWrite> tensors = TensorsOf(EncodeRgl(grey, layout, ""));
  const auto rgb_source = ParseRgl(EncodeTensorFile(tensors), "rgb");
  // The same grey at five wavelengths, as double, half and float in turn.
  const TensorToWrite rgb = Named(tensors, "rgb");
  std::erase_if(tensors, [](const TensorToWrite& t) { return t.name == "rgb"; });
  const size_t plane = 36 * 4;
  TensorToWrite spectra{"spectra", TensorType::kF32, {1, 3, 5, 6, 6}, {}};
  for (size_t slice = 0; slice < 3; ++slice) {
    for (int w = 0; w < 5; ++w) {
      const auto first = rgb.data.begin() + static_cast<std::ptrdiff_t>(slice * 3 * plane);
      spectra.data.insert(spectra.data.end(), first, first + static_cast<std::ptrdiff_t>(plane));
    }
  }
  tensors.push_back(spectra);
  tensors.push_back(FloatTensor("wavelengths", {5}, std::vector<float>{360, 450, 550, 640, 1000}));
  const auto source = ParseRgl(EncodeTensorFile(tensors), "spectral");
  ASSERT_OK(rgb_source);
  ASSERT_OK(source);
  Random random(18);
  for (int i = 0; i < 2000; ++i) {
    const Direction wi = RandomDirection(random, 85);
    const Direction wo = RandomDirection(random, 85);
    float a[3], b[3];
    rgb_source->table->Evaluate(wi, wo, a);
    source->table->Evaluate(wi, wo, b);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], 1e-5 * (1 + a[c]));
  }
}

TEST(SpectrumToRec709, KeepsWhiteAndKnowsColours) {
  std::vector<double> nm;
  for (int i = 0; i <= 100; ++i) nm.push_back(360 + 5 * i);
  const auto weights = SpectrumToRec709(nm);
  const auto rgb_of = [&](auto&& reflectance) {
    std::array<double, 3> rgb = {0, 0, 0};
    for (size_t i = 0; i < nm.size(); ++i) {
      for (int c = 0; c < 3; ++c) rgb[c] += weights[i][c] * reflectance(nm[i]);
    }
    return rgb;
  };
  for (const double value : rgb_of([](double) { return 1.0; })) EXPECT_NEAR(value, 1, 1e-12);
  const auto red = rgb_of([](double w) { return w > 600 ? 1.0 : 0.0; });
  EXPECT_GT(red[0], 0.7);
  EXPECT_LT(std::abs(red[1]), 0.2);
  const auto blue = rgb_of([](double w) { return w < 490 ? 1.0 : 0.0; });
  EXPECT_GT(blue[2], 0.7);
  EXPECT_LT(std::abs(blue[0]), 0.2);
  const auto green = rgb_of([](double w) { return w >= 490 && w <= 600 ? 1.0 : 0.0; });
  EXPECT_GT(green[1], 0.7);
  // One wavelength alone stands for all.
  const auto alone = SpectrumToRec709(std::vector<double>{550});
  for (const double weight : alone[0]) EXPECT_NEAR(weight, 1, 1e-12);
}

TEST(RglParse, ReadsARealMeasurement) {
  const std::string path =
      std::string(PATINA_SOURCE_DIR) + "/../shared/data/brdf/acrylic_felt_green_rgb.bsdf";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  const auto source = ReadRgl(path);
  ASSERT_OK(source);
  EXPECT_TRUE(source->isotropic);
  EXPECT_EQ(source->cells, 8u * 32 * 32);
  EXPECT_TRUE(source->warnings.empty());
  double albedo[3];
  Albedo(*source->table, {0, 0, 1}, albedo);
  EXPECT_NEAR(albedo[0], 0.105, 0.001);
  EXPECT_NEAR(albedo[1], 0.218, 0.001);
  EXPECT_NEAR(albedo[2], 0.030, 0.001);
  // Every truncation, at a stride, and a byte too many.
  std::vector<uint8_t> bytes = *ReadFile(path, kMaxRglBytes);
  for (size_t size = 0; size < bytes.size(); size += 9973)
    EXPECT_FALSE(ParseRgl(std::span(bytes).first(size), "short")) << size;
  EXPECT_FALSE(ParseRgl(std::span(bytes).first(bytes.size() - 1), "short"));
  bytes.push_back(0);
  EXPECT_FALSE(ParseRgl(bytes, "long"));
}

}  // namespace
}  // namespace patina::brdf
