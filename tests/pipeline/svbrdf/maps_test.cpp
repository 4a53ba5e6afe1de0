// Models whose numbers are maps: footprints, the metallic-roughness model, stacks, and what samples
// of them are.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "formats/layered/varying_stack.h"
#include "pipeline/image/image_io.h"
#include "pipeline/layered/simulator.h"
#include "pipeline/svbrdf/modelled_source.h"
#include "pipeline/svbrdf/pbr_model.h"
#include "pipeline/svbrdf/stack_model.h"
#include "pipeline/svbrdf/tilted_frame.h"
#include "tests/pipeline/svbrdf/set_files.h"

namespace patina::svbrdf {
namespace {

using testing_support::Towards;

void WriteMap(const std::string& path, int width, int height, const std::vector<float>& values) {
  const int channels =
      static_cast<int>(values.size() / (static_cast<size_t>(width) * static_cast<size_t>(height)));
  const Status written =
      WriteImage(path, WriteFormat::kExrFloat, width, height, channels, values.data());
  ASSERT_TRUE(written) << written.error().message;
}

// ---- footprints

TEST(Footprint, CoversWhatMipsAverage) {
  for (const auto& [width, height] : {std::pair{8, 4}, {7, 5}, {1, 3}}) {
    PlaneLevel image;
    image.Allocate(width, height, 1);
    Rng values(5);
    for (float& value : image.data) value = values.Uniform();
    const std::vector<float> texels = image.data;
    const auto mips = MipsOf(std::move(image), 3);
    const FootprintFinder finder(width, height, 3, AddressMode::kWrap);
    for (int l = 0; l < 3; ++l) {
      const PlaneLevel& level = mips[static_cast<size_t>(l)];
      for (int y = 0; y < level.height; ++y) {
        for (int x = 0; x < level.width; ++x) {
          const auto u = (static_cast<float>(x) + 0.5f) / static_cast<float>(level.width);
          const auto v = (static_cast<float>(y) + 0.5f) / static_cast<float>(level.height);
          const Footprint footprint = finder.At(u, v, static_cast<float>(l));
          ASSERT_EQ(footprint.count, 1);
          double sum = 0, weights = 0;
          finder.ForEach(footprint, [&](size_t texel, double weight) {
            sum += weight * static_cast<double>(texels[texel]);
            weights += weight;
          });
          EXPECT_NEAR(weights, 1, 1e-6);
          // Single precision on the way of the mips.
          EXPECT_NEAR(sum, static_cast<double>(level.Row(0, y)[x]), 1e-6);
        }
      }
    }
  }
}

TEST(Footprint, DrawsTexelsByTheirWeight) {
  const FootprintFinder finder(7, 5, 3, AddressMode::kClamp);
  const Footprint footprint = finder.At(0.4f, 0.7f, 1.3f);
  std::vector<double> weights(35), drawn(35);
  finder.ForEach(footprint, [&](size_t texel, double weight) { weights[texel] += weight; });
  constexpr int kDraws = 40000;
  Rng rng(3);
  for (int i = 0; i < kDraws; ++i) drawn[finder.Draw(footprint, &rng)] += 1.0 / kDraws;
  for (size_t t = 0; t < weights.size(); ++t) {
    // Six standard errors: 35 comparisons fail together with odds below 1e-7.
    const double error = std::sqrt(weights[t] * (1 - weights[t]) / kDraws);
    EXPECT_NEAR(drawn[t], weights[t], 6 * error + 1e-6) << t;
  }
}

// ---- the metallic-roughness model

TEST(EvaluatePbr, IsTheClosedFormOfGltf) {
  Rng rng(11);
  for (int i = 0; i < 500; ++i) {
    PbrSurface surface;
    for (float& base : surface.base) base = rng.Uniform();
    surface.roughness = 0.2f + 0.8f * rng.Uniform();
    surface.metalness = i % 3 == 0 ? 0 : i % 3 == 1 ? 1 : rng.Uniform();
    const brdf::Direction wi = Towards(85 * rng.Uniform(), 360 * rng.Uniform()),
                          wo = Towards(85 * rng.Uniform(), 360 * rng.Uniform());
    float f[3], swapped[3];
    EvaluatePbr(surface, wi, wo, f);
    EvaluatePbr(surface, wo, wi, swapped);
    // Appendix B as it is written there, in double precision.
    const double l = wi.z, v = wo.z;
    double hx = wi.x + wo.x, hy = wi.y + wo.y, hz = wi.z + wo.z;
    const double length = std::sqrt(hx * hx + hy * hy + hz * hz);
    hx /= length, hy /= length, hz /= length;
    const double vh = wo.x * hx + wo.y * hy + wo.z * hz;
    const double a2 = std::pow(surface.roughness, 4);
    const double d = a2 / (std::numbers::pi * std::pow(hz * hz * (a2 - 1) + 1, 2));
    const double vis =
        1 / (l + std::sqrt(a2 + (1 - a2) * l * l)) / (v + std::sqrt(a2 + (1 - a2) * v * v));
    for (int c = 0; c < 3; ++c) {
      const double base = surface.base[c], m = surface.metalness;
      const double f0 = 0.04 * (1 - m) + base * m;
      const double fresnel = f0 + (1 - f0) * std::pow(1 - vh, 5);
      const double wanted = (1 - fresnel) * base * (1 - m) / std::numbers::pi + fresnel * d * vis;
      // Of a peak of 1 / (pi 0.2^4) as single precision has it.
      EXPECT_NEAR(f[c], wanted, 1e-3 * wanted + 1e-5) << i;
      EXPECT_NEAR(f[c], swapped[c], 1e-4 * wanted + 1e-5) << i;
    }
  }
}

TEST(EvaluatePbr, StaysFiniteWhereItIsNarrowest) {
  PbrSurface mirror;
  mirror.roughness = 0;
  mirror.metalness = 1;
  for (const double theta : {0.0, 45.0, 89.99}) {
    float f[3];
    EvaluatePbr(mirror, Towards(theta, 0), Towards(theta, 180), f);
    EXPECT_TRUE(std::isfinite(f[0]) && f[0] > 0) << theta;
  }
}

TEST(TiltedFrame, IsBoundedAtBothHorizons) {
  const brdf::Direction up = {0, 0, 1}, tilted = Towards(60, 0);
  const TiltedFrame flat = TiltTo(up, Towards(30, 20), Towards(50, 200));
  EXPECT_NEAR(flat.factor, 1, 1e-6f);
  EXPECT_NEAR(flat.wi.x, Towards(30, 20).x, 1e-6f);
  EXPECT_NEAR(flat.wo.y, Towards(50, 200).y, 1e-6f);
  // Lit from behind: black. Seen from behind: at the horizon.
  EXPECT_EQ(TiltTo(tilted, Towards(60, 180), up).factor, 0);
  const TiltedFrame behind = TiltTo(tilted, up, Towards(60, 180));
  EXPECT_NEAR(behind.wo.z, kLeastCosine, 1e-6f);
  EXPECT_NEAR(DotOf(behind.wo, behind.wo), 1, 1e-5f);
  // f times the plane's cosine is what the facet gets.
  const TiltedFrame lit = TiltTo(tilted, Towards(40, 0), up);
  EXPECT_NEAR(lit.factor * Towards(40, 0).z, std::cos(20 * M_PI / 180), 1e-5);
  for (const double theta : {89.0, 89.9, 90.0}) {
    const TiltedFrame grazing = TiltTo(tilted, Towards(theta, 0), up);
    EXPECT_LE(grazing.factor, 1 / kLeastCosine) << theta;
    EXPECT_GT(grazing.factor, 0) << theta;
  }
  const TiltedFrame along = TiltTo({1, 0, 0}, Towards(45, 0), up);
  EXPECT_TRUE(std::isfinite(along.wi.x) && std::isfinite(along.factor));
}

std::shared_ptr<const PbrModel> PbrOf(const std::string& folder, ThreadPool& pool,
                                      const PbrSettings& settings = {}) {
  const auto sets = FindMaps(folder);
  EXPECT_TRUE(sets) << sets.error().message;
  const auto maps = LoadSourceMaps((*sets)[0], {}, pool, NoProgress());
  EXPECT_TRUE(maps) << maps.error().message;
  const auto model = PbrModel::Make(*maps, "wall", AddressMode::kWrap, pool, settings);
  EXPECT_TRUE(model) << model.error().message;
  return model ? *model : nullptr;
}

TEST(PbrModel, TakesTheNumbersOfAScene) {
  test::TemporaryDirectory folder;
  std::vector<float> albedo, normal;
  for (int i = 0; i < 16; ++i) {
    albedo.insert(albedo.end(), {0.5f, 0.25f, i == 0 ? 0.75f : 0.125f});
    normal.insert(normal.end(), {0.5f + 0.5f * 0.6f, 0.5f, i == 0 ? 1.0f : 0.5f + 0.5f * 0.8f});
  }
  WriteMap(folder / "wall_basecolor.exr", 4, 4, albedo);
  WriteMap(folder / "wall_normal.exr", 4, 4, normal);
  WriteMap(folder / "wall_roughness.exr", 4, 4,
           {0.75f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f, 0.25f,
            0.25f, 0.25f, 0.25f, 0.25f});
  PbrSettings settings;
  settings.constants = {{"metalness", {0.25f}}, {"specular", {0.5f}}};
  settings.factors = {{"albedo", {0.5, 1, 2}}, {"roughness", {2}}};
  settings.normal_scale = 0.5f;
  settings.dielectric_f0 = 0.08f;
  settings.left_out = {"ao"};
  ThreadPool pool(2);
  const auto model = PbrOf(folder.path(), pool, settings);
  ASSERT_NE(model, nullptr);
  EXPECT_EQ(model->used(),
            (std::vector<std::string>{"albedo", "normal", "roughness", "metalness", "specular"}));
  EXPECT_EQ(model->left_out(), std::vector<std::string>{"ao"});
  // Of the first texel blue and roughness are beyond 1.
  EXPECT_THAT(model->warnings(), testing::Contains(testing::HasSubstr("basecolor.exr: 1 samples")));
  EXPECT_THAT(model->warnings(), testing::Contains(testing::HasSubstr("roughness.exr: 1 samples")));
  const PbrSurface surface{{0.25f, 0.25f, 0.25f}, 0.5f, 0.25f, 0.5f};
  const float length = std::sqrt(0.3f * 0.3f + 0.8f * 0.8f);
  const auto wi = Towards(40, 30), wo = Towards(20, 200);
  const TiltedFrame frame = TiltTo({0.3f / length, 0, 0.8f / length}, wi, wo);
  float f[3];
  EvaluatePbr(surface, frame.wi, frame.wo, f, 0.08f);
  double sum[3] = {}, squares[3] = {};
  model->AddDraws(5, wi, wo, 1, nullptr, sum, squares);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], frame.factor * f[c], 1e-4 * f[c]);
  // Ours is the strength of highlights that no metal has, and nothing else.
  float glossier[3], same[3];
  EvaluatePbr({{0, 0, 0}, 0.5f, 0, 1}, Towards(0, 0), Towards(0, 0), same);
  EvaluatePbr({{0, 0, 0}, 0.5f, 0, 1}, Towards(0, 0), Towards(0, 0), glossier, 0.08f);
  EXPECT_NEAR(glossier[0], 2 * same[0], 1e-5f);
}

TEST(PbrModel, OfConstantsIsTheClosedForm) {
  test::TemporaryDirectory folder;
  std::vector<float> albedo;
  for (int i = 0; i < 16; ++i) albedo.insert(albedo.end(), {0.5f, 0.25f, 0.125f});
  WriteMap(folder / "wall_basecolor.exr", 4, 4, albedo);
  WriteMap(folder / "wall_roughness.exr", 4, 4, std::vector<float>(16, 0.5f));
  WriteMap(folder / "wall_metallic.exr", 4, 4, std::vector<float>(16, 0.25f));
  WriteMap(folder / "wall_ao.exr", 4, 4, std::vector<float>(16, 0.5f));
  ThreadPool pool(2);
  const auto model = PbrOf(folder.path(), pool);
  ASSERT_NE(model, nullptr);
  EXPECT_TRUE(model->isotropic());
  EXPECT_EQ(model->left_out(), std::vector<std::string>{"ao"});
  const ModelledSource source(model, {});
  PbrSurface surface{{0.5f, 0.25f, 0.125f}, 0.5f, 0.25f, 1};
  const FootprintFinder finder = source.Finder(3);
  Rng rng(1);
  for (const DirectionPair& pair : source.pairs()) {
    float f[3];
    EvaluatePbr(surface, pair.light, pair.view, f);
    for (const float level : {0.0f, 0.6f, 2.0f}) {
      const auto estimate = source.Estimate(finder, source.FootprintAt(finder, 0.3f, 0.9f, level),
                                            pair.light, pair.view, {}, &rng);
      EXPECT_EQ(estimate.spent, 0);  // exact
      for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(estimate.f[c], f[c], 1e-5 * (1 + f[c]));
    }
  }
}

TEST(PbrModel, MipsAreMeansOfReflectanceNotOfNumbers) {
  test::TemporaryDirectory folder;
  WriteMap(folder / "wall_basecolor.exr", 2, 1, std::vector<float>(6, 0.5f));
  WriteMap(folder / "wall_roughness.exr", 2, 1, {0.2f, 0.9f});
  ThreadPool pool(1);
  const auto model = PbrOf(folder.path(), pool);
  ASSERT_NE(model, nullptr);
  const ModelledSource source(model, {});
  const FootprintFinder finder = source.Finder(2);
  const brdf::Direction wi = Towards(20, 0), wo = Towards(25, 180);
  float sharp[3], dull[3], between[3];
  PbrSurface surface{{0.5f, 0.5f, 0.5f}, 0.2f, 0, 1};
  EvaluatePbr(surface, wi, wo, sharp);
  surface.roughness = 0.9f;
  EvaluatePbr(surface, wi, wo, dull);
  surface.roughness = 0.55f;
  EvaluatePbr(surface, wi, wo, between);
  Rng rng(1);
  const auto estimate =
      source.Estimate(finder, source.FootprintAt(finder, 0.5f, 0.5f, 1), wi, wo, {}, &rng);
  EXPECT_NEAR(estimate.f[0], 0.5 * (sharp[0] + dull[0]), 1e-5);
  EXPECT_GT(std::abs(estimate.f[0] - static_cast<double>(between[0])), 0.05);
}

// Bumps too fine for a mip become roughness: the lobe of the mean is wider than that of a facet.
TEST(PbrModel, FilteredNormalsBecomeRoughness) {
  test::TemporaryDirectory folder;
  WriteMap(folder / "wall_basecolor.exr", 2, 2, std::vector<float>(12, 0.8f));
  WriteMap(folder / "wall_roughness.exr", 2, 2, std::vector<float>(4, 0.25f));
  WriteMap(folder / "wall_metallic.exr", 2, 2, std::vector<float>(4, 1));
  std::vector<float> normals;
  for (int i = 0; i < 4; ++i) {
    const brdf::Direction n = Towards(25, 90.0 * i);
    normals.insert(normals.end(), {0.5f + 0.5f * n.x, 0.5f + 0.5f * n.y, 0.5f + 0.5f * n.z});
  }
  WriteMap(folder / "wall_normal_gl.exr", 2, 2, normals);
  ThreadPool pool(1);
  const auto model = PbrOf(folder.path(), pool);
  ASSERT_NE(model, nullptr);
  EXPECT_FALSE(model->isotropic());
  const ModelledSource source(model, {});
  const FootprintFinder finder = source.Finder(2);
  const brdf::Direction up = {0, 0, 1}, aside = Towards(50, 0);
  Rng rng(1);
  const Footprint all = source.FootprintAt(finder, 0.5f, 0.5f, 1);
  const double straight = source.Estimate(finder, all, up, up, {}, &rng).f[0];
  const double wide = source.Estimate(finder, all, aside, up, {}, &rng).f[0];
  float flat[3], flat_wide[3];
  const PbrSurface surface{{0.8f, 0.8f, 0.8f}, 0.25f, 1, 1};
  EvaluatePbr(surface, up, up, flat);
  EvaluatePbr(surface, aside, up, flat_wide);
  EXPECT_LT(straight, 0.1 * static_cast<double>(flat[0]));
  EXPECT_GT(wide, 10 * static_cast<double>(flat_wide[0]));
}

// ---- stacks

constexpr const char* kLacquer = R"({"version": 1,
  "layers": [{"ior": 1.5, "roughness": 0.3, "absorption": [0.1, 0.4, 0.8],
              "thickness": {"map": "t.exr", "scale": 2}}],
  "base": {"kind": "diffuse", "albedo": {"map": "a.exr"}}})";

class StackModelTest : public ::testing::Test {
 protected:
  StackModelTest() {
    WriteMap(folder_ / "t.exr", 2, 1, {0.0f, 0.5f});
    WriteMap(folder_ / "a.exr", 2, 1, {0.6f, 0.4f, 0.2f, 0.3f, 0.5f, 0.7f});
  }
  Result<std::shared_ptr<const StackModel>> Load(const std::string& text) {
    PATINA_ASSIGN(const auto stack, layered::ParseVaryingStack(text, "x.layers.json"));
    return StackModel::Load(stack, folder_ / "x.layers.json", {}, pool_);
  }
  std::string Problem(const std::string& text) {
    const auto model = Load(text);
    return model ? "" : model.error().message;
  }

  test::TemporaryDirectory folder_;
  ThreadPool pool_{2};
};

TEST_F(StackModelTest, IsThePlainStackAtEachTexel) {
  const auto model = Load(kLacquer);
  ASSERT_TRUE(model) << model.error().message;
  EXPECT_TRUE((*model)->isotropic());
  EXPECT_FALSE((*model)->exact());
  EXPECT_EQ((*model)->StackAt(1).layers[0].thickness, 1);
  EXPECT_EQ((*model)->StackAt(0).layers[0].thickness, 0);
  EXPECT_NEAR((*model)->mean().parts[0].albedo[1], 0.45, 1e-6);
  const layered::Effects& effects = (*model)->effects();
  EXPECT_TRUE(effects.rough && effects.absorption && effects.colour);
  EXPECT_FALSE(effects.deep || effects.scattering || effects.anisotropic);
  // The same kernel and the same random numbers as of the plain stack give the same paths.
  const layered::Simulator plain((*model)->StackAt(1));
  const brdf::Direction wi = Towards(30, 0), wo = Towards(50, 120);
  double of_map[3] = {}, of_plain[3] = {}, squares[3] = {}, plain_squares[3] = {};
  Rng one(9), other(9);
  (*model)->AddDraws(1, wi, wo, 500, &one, of_map, squares);
  plain.AddPaths(wi, wo, 500, &other, of_plain, plain_squares);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(of_map[c], of_plain[c], 1e-9 * of_plain[c]);
    EXPECT_NEAR(squares[c], plain_squares[c], 1e-9 * plain_squares[c]);
  }
}

TEST_F(StackModelTest, CoarserLevelsAreMeansOverTexels) {
  const auto model = Load(kLacquer);
  ASSERT_TRUE(model) << model.error().message;
  const ModelledSource source(*model, {});
  const FootprintFinder finder = source.Finder(2);
  const brdf::Direction wi = Towards(30, 0), wo = Towards(50, 120);
  const layered::Accuracy many = {1e-9, 64, 20000, 20000};
  Rng rng(4);
  const auto mean =
      source.Estimate(finder, source.FootprintAt(finder, 0.5f, 0.5f, 1), wi, wo, many, &rng);
  layered::Estimate texels[2];
  for (size_t t = 0; t < 2; ++t)
    texels[t] = layered::Simulator((*model)->StackAt(t)).Average(wi, wo, 20000, 17 + t);
  for (size_t c = 0; c < 3; ++c) {
    const double error =
        std::sqrt(mean.variance[c] + 0.25 * texels[0].variance[c] + 0.25 * texels[1].variance[c]);
    // Five standard errors in three channels: odds below 1e-5.
    EXPECT_NEAR(mean.f[c], 0.5 * (texels[0].f[c] + texels[1].f[c]), 5 * error) << c;
  }
}

TEST_F(StackModelTest, ScatteringWhereThereIsNoLayerIsFinite) {
  const auto model = Load(R"({"version": 1,
    "layers": [{"ior": {"map": "t.exr", "scale": 1, "offset": 1}, "roughness": 0.2,
                "scattering": 2, "thickness": {"map": "t.exr"}}],
    "base": {"kind": "conductor", "metal": "gold", "roughness": {"map": "t.exr"}}})");
  ASSERT_TRUE(model) << model.error().message;
  EXPECT_EQ((*model)->StackAt(0).parts[0].roughness.x,
            static_cast<double>(static_cast<float>(kLeastMapRoughness)));
  EXPECT_GT((*model)->StackAt(0).layers[0].ior, 1);
  double sum[3] = {}, squares[3] = {};
  Rng rng(2);
  for (size_t t = 0; t < 2; ++t)
    (*model)->AddDraws(t, Towards(30, 0), Towards(31, 179), 2000, &rng, sum, squares);
  for (const double value : sum) EXPECT_TRUE(std::isfinite(value) && value > 0);
}

TEST_F(StackModelTest, RefusesWhatNoStackCanHave) {
  WriteMap(folder_ / "three.exr", 3, 1, {0.1f, 0.2f, 0.3f});
  WriteMap(folder_ / "nan.exr", 2, 1, {0.1f, std::nanf("")});
  WriteMap(folder_ / "one.exr", 2, 1, {0.1f, 0.7f});
  std::ofstream(folder_ / "text.exr") << "no image";
  const auto layer = [](const std::string& members) {
    return R"({"version": 1, "layers": [{)" + members +
           R"(}], "base": {"kind": "diffuse", "albedo": 0.5}})";
  };
  const struct {
    std::string text;
    std::vector<const char*> says;
  } cases[] = {
      {layer(R"("ior": 1.5, "thickness": {"map": "none.exr"})"),
       {"/layers/0/thickness/map", "none.exr", "beside"}},
      {layer(R"("ior": 1.5, "thickness": {"map": "text.exr"})"), {"/layers/0/thickness/map"}},
      {layer(R"("ior": 1.5, "thickness": {"map": "t.exr", "offset": -0.25})"),
       {"/layers/0/thickness: -0.25", "x 0, y 0 of t.exr", "\"offset\""}},
      {layer(R"("ior": {"map": "t.exr"})"), {"/layers/0/ior: 0", "below 1"}},
      {layer(R"("ior": 1.5, "roughness": {"map": "t.exr", "scale": 4})"),
       {"/layers/0/roughness: 2", "x 1, y 0"}},
      {layer(R"("ior": 1.5, "roughness": [{"map": "t.exr", "offset": -1}, 0.2])"),
       {"/layers/0/roughness: -1"}},
      {layer(R"("ior": 1.5, "thickness": 1, "absorption": {"map": "t.exr", "scale": -1})"),
       {"/layers/0/absorption: -0.5"}},
      {layer(
           R"("ior": 1.5, "thickness": 1, "scattering": 1, "asymmetry": {"map": "t.exr", "scale": 3})"),
       {"/layers/0/asymmetry: 1.5"}},
      {layer(R"("ior": 1.5, "thickness": {"map": "t.exr"}, "roughness": {"map": "three.exr"})"),
       {"t.exr has 2 x 1", "three.exr 3 x 1", "one size"}},
      {layer(R"("ior": 1.5, "thickness": {"map": "nan.exr"})"), {"NaN", "x 1, y 0"}},
      {layer(R"("ior": 1.5, "thickness": {"map": "t.exr", "channel": "b"})"),
       {"/layers/0/thickness/channel", "no b"}},
      {R"({"version": 1, "base": {"kind": "diffuse", "albedo": {"map": "a.exr", "scale": 2}}})",
       {"/base/albedo: 1.", "above 1"}},
      {R"({"version": 1, "base": {"kind": "mixture", "parts": [
          {"kind": "diffuse", "weight": {"map": "one.exr"}, "albedo": 0.5},
          {"kind": "diffuse", "weight": {"map": "t.exr"}, "albedo": 0.1}]}})",
       {"/base/parts", "sum to 1.2", "x 1, y 0"}},
      {R"({"version": 1, "base": {"kind": "diffuse", "albedo": 0.5}, "normal": {"map": "t.exr"}})",
       {"/normal"}},
  };
  for (const auto& hostile : cases) {
    const std::string problem = Problem(hostile.text);
    EXPECT_NE(problem.find("x.layers.json"), std::string::npos) << hostile.text;
    for (const char* word : hostile.says)
      EXPECT_NE(problem.find(word), std::string::npos) << word << " in: " << problem;
  }
}

// ---- samples

TEST(ModelledSource, DrawsTheSameForAnyNumberOfThreads) {
  test::TemporaryDirectory folder;
  WriteMap(folder / "t.exr", 4, 2, {0.0f, 0.1f, 0.2f, 0.3f, 0.4f, 0.5f, 0.6f, 0.7f});
  std::vector<float> albedo;
  for (int i = 0; i < 24; ++i) albedo.push_back(0.03f * static_cast<float>(i));
  WriteMap(folder / "a.exr", 4, 2, albedo);
  const auto stack = layered::ParseVaryingStack(kLacquer, "x.layers.json");
  ASSERT_TRUE(stack);
  const auto draw = [&](int threads) {
    ThreadPool pool(threads);
    const auto model = StackModel::Load(*stack, folder / "x.layers.json", {}, pool);
    EXPECT_TRUE(model);
    ModelledOptions options;
    options.learned = {0.1, 8, 8, 32};
    TexelPoolOptions drawing;
    drawing.count = 600;
    drawing.levels = 3;
    drawing.features = 12;
    drawing.grid.nside = 4;
    auto pool_of_samples = ModelledSource(*model, options).Draw(drawing, pool);
    EXPECT_TRUE(pool_of_samples);
    return std::move(*pool_of_samples);
  };
  const TexelPool one = draw(1), three = draw(3);
  ASSERT_EQ(one.samples.size(), 600u);
  EXPECT_EQ(std::memcmp(one.samples.data(), three.samples.data(), 600 * sizeof(TexelSample)), 0);
  EXPECT_EQ(one.start, three.start);
  EXPECT_EQ(one.cost.paths, three.cost.paths);
  EXPECT_EQ(one.cost.standard_error, three.cost.standard_error);
  EXPECT_EQ(one.cost.pairs, 600u);
  ASSERT_EQ(one.start.size(), (8u + 2 + 1) * kRowFloats);
  // Each number that varies has mean 0 over the texels; of the one texel of the last level it is 0.
  double sum = 0;
  for (size_t t = 0; t < 8; ++t) sum += static_cast<double>(one.start[t * kRowFloats]);
  EXPECT_NEAR(sum, 0, 1e-5);
  EXPECT_NEAR(one.start[10 * kRowFloats], 0, 1e-5f);
  EXPECT_NE(one.start[0], 0);
  for (const TexelSample& sample : one.samples) {
    EXPECT_TRUE(sample.importance > 0 && sample.importance <= 1);
    EXPECT_TRUE(sample.s >= 0 && sample.s <= 2);
  }
}

TEST(ModelledSource, LargeMapsAreLearnedFromAMip) {
  test::TemporaryDirectory folder;
  std::vector<float> stripes(2 * kMaxModelledSide);
  for (size_t x = 0; x < stripes.size(); ++x) stripes[x] = x % 2 == 0 ? 0.2f : 0.6f;
  WriteMap(folder / "a.exr", 2 * kMaxModelledSide, 1, stripes);
  const auto stack = layered::ParseVaryingStack(
      R"({"version": 1, "base": {"kind": "diffuse", "albedo": {"map": "a.exr"}}})", "x");
  ASSERT_TRUE(stack);
  ThreadPool pool(2);
  const auto model = StackModel::Load(*stack, folder / "x.layers.json", {}, pool);
  ASSERT_TRUE(model) << model.error().message;
  EXPECT_TRUE((*model)->exact());
  const ModelledSource source(*model, {});
  EXPECT_EQ(source.width(), kMaxModelledSide);
  EXPECT_EQ(source.height(), 1);
  const TexelPlace places[] = {{0, 0}, {777, 0}};
  const auto values = source.Values(0, places, pool);
  ASSERT_TRUE(values);
  for (const float value : *values) EXPECT_NEAR(value, 0.4 / M_PI, 1e-6);
}

}  // namespace
}  // namespace patina::svbrdf
