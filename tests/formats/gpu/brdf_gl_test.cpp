// The GLSL decoder of BRDFs on llvmpipe against the C++ decoder.
#include <gtest/gtest.h>

#include "tests/formats/gpu/brdf_samples.h"
#include "tests/formats/gpu/gl_runner.h"
#include "tests/formats/sample_container.h"

namespace patina::gpu_test {
namespace {

class BrdfOnGl : public testing::TestWithParam<GlApi> {
 protected:
  void SetUp() override {
    std::string why;
    gl_ = GlContext::Create(GetParam(), GlCompiler::kQuick, &why);
    PATINA_NEED_MESA(gl_ != nullptr, "libgl1-mesa-dri", why);
  }
  void Check(const test::BrdfSampleOptions& options, uint64_t seed, size_t count = 3000) {
    CheckBrdf(options, seed, count,
              GetParam() == GlApi::kEs30 ? ShaderLanguage::kEssl : ShaderLanguage::kGlsl,
              [&](const GpuProgram& program, const std::vector<float>& pairs) {
                return RunOnGl(*gl_, program, pairs);
              });
  }
  std::unique_ptr<GlContext> gl_;
};

// Compiling takes the time, and ES has the same text: what is in BrdfOnGl45 is not repeated there.
class BrdfOnGl45 : public BrdfOnGl {};

TEST_P(BrdfOnGl, AgreesForEveryRecipe) {
  // Bits: isotropic, canonical order, angle inputs.
  const bool es = GetParam() == GlApi::kEs30;
  for (const int bits : es ? std::vector<int>{7} : std::vector<int>{1, 6, 7}) {
    test::BrdfSampleOptions options;
    options.pack.isotropic = (bits & 1) != 0;
    options.pack.canonical_order = (bits & 2) != 0;
    options.pack.angle_inputs = (bits & 4) != 0;
    options.pack.half_vector_inputs = (bits & 4) != 0 && (bits & 1) == 0;
    Check(options, static_cast<uint64_t>(100 + bits));
  }
}

TEST_P(BrdfOnGl45, AgreesForEveryInterpolation) {
  for (const auto interpolation : {Interpolation::kInverseDistance, Interpolation::kUniform}) {
    test::BrdfSampleOptions options;
    options.pack.interpolation = interpolation;
    Check(options, 110 + static_cast<uint64_t>(interpolation));
  }
}

TEST_P(BrdfOnGl45, AgreesForAnyNsideAndPrimitive) {
  const int shapes[][2] = {{1, 1}, {7, 9}, {64, 3}};
  for (const auto& [nside, primitive] : shapes) {
    test::BrdfSampleOptions options;
    options.pack.nside = nside;
    options.pack.primitive_size = primitive;
    options.shared_codebook = nside == 7;
    Check(options, static_cast<uint64_t>(120 + nside), 1500);
  }
}

TEST_P(BrdfOnGl, AgreesForSpatiallyVaryingOnes) {
  test::BrdfSampleOptions options;
  options.pack.isotropic = options.pack.canonical_order = false;
  options.pack.half_vector_inputs = true;
  options.textures = 4;
  Check(options, 170);
  options.halves = true;
  Check(options, 172);
  if (GetParam() == GlApi::kEs30) return;
  options.pack.angle_inputs = options.pack.half_vector_inputs = false;
  options.pack.primitive_size = 3;
  options.textures = 1;
  Check(options, 171);
}

TEST_P(BrdfOnGl, AgreesForAnyNetwork) {
  // In ES the last one is too large for a constant buffer.
  const std::vector<std::vector<int>> networks =
      GetParam() == GlApi::kEs30 ? std::vector<std::vector<int>>{{64, 64}}
                                 : std::vector<std::vector<int>>{{}, {8, 3, 8, 1, 8}};
  for (size_t i = 0; i < networks.size(); ++i) {
    test::BrdfSampleOptions options;
    options.hidden = networks[i];
    options.pack.primitive_size = 3;
    Check(options, 140 + i, 1000);
  }
}

TEST_P(BrdfOnGl45, FitsInOneShaderWithAMaterial) {
  const test::TemporaryDirectory folder;
  auto staging = test::StageBrdfSample(folder.path(), "brdf", 160);
  ASSERT_OK(staging);
  const auto published = staging->Publish();
  ASSERT_OK(published);
  const auto brdf_container = OpenContainer(published->directory);
  ASSERT_OK(brdf_container);
  auto material_staging = test::StageSample(folder.path(), "material", 161);
  ASSERT_OK(material_staging);
  const auto material_published = material_staging->Publish();
  ASSERT_OK(material_published);
  const auto material_container = OpenContainer(material_published->directory);
  ASSERT_OK(material_container);

  const auto pairs = RandomPairs(162, 200);
  GpuProgram brdf = LoadProgram(*brdf_container, {ShaderLanguage::kGlsl, 8});
  SetBrdfBody(&brdf);
  const std::vector<float> alone = RunOnGl(*gl_, brdf, pairs);
  const GpuProgram material = LoadProgram(*material_container, {});
  brdf.shader = material.shader + brdf.shader;
  brdf.textures.insert(brdf.textures.end(), material.textures.begin(), material.textures.end());
  EXPECT_EQ(RunOnGl(*gl_, brdf, pairs), alone);
}

INSTANTIATE_TEST_SUITE_P(Apis, BrdfOnGl, testing::Values(GlApi::kGl45, GlApi::kEs30),
                         [](const auto& api) {
                           return api.param == GlApi::kGl45 ? "Gl45" : "Es30";
                         });

INSTANTIATE_TEST_SUITE_P(Apis, BrdfOnGl45, testing::Values(GlApi::kGl45));

}  // namespace
}  // namespace patina::gpu_test
