// The HLSL and GLSL decoders as SPIR-V on lavapipe, with the files as they are, against the C++
// decoders.
#include <gtest/gtest.h>

#include "tests/formats/gpu/brdf_samples.h"
#include "tests/formats/gpu/material_samples.h"
#include "tests/formats/gpu/vulkan_runner.h"
#include "tests/formats/test_support.h"

namespace patina::gpu_test {
namespace {

class OnVulkan : public testing::TestWithParam<ShaderLanguage> {
 protected:
  void SetUp() override {
    std::string why;
    device_ = VulkanDevice::Create(&why);
    PATINA_NEED_MESA(device_ != nullptr, "mesa-vulkan-drivers", why);
    ASSERT_NE(device_->name().find("llvmpipe"), std::string::npos) << device_->name();
    PATINA_NEED_MESA(std::system("glslangValidator --version > /dev/null 2>&1") == 0,
                     "glslang-tools", "it does not run");
  }

  std::vector<float> Run(const GpuProgram& program, const std::vector<float>& inputs) {
    const std::vector<uint32_t> spirv = CompileForVulkan(program);
    return spirv.empty() ? std::vector<float>() : device_->Run(program, spirv, inputs);
  }

  void CheckMaterialShape(const MaterialShape& shape, uint64_t seed, int first_binding = 0) {
    const test::TemporaryDirectory folder;
    CheckMaterial(MakeMaterial(folder.path(), shape, seed), seed, 2000, {GetParam(), first_binding},
                  [&](const GpuProgram& program, const std::vector<float>& lookups) {
                    return Run(program, lookups);
                  });
  }

  void CheckBrdfSample(const test::BrdfSampleOptions& options, uint64_t seed) {
    CheckBrdf(options, seed, 2000, GetParam(),
              [&](const GpuProgram& program, const std::vector<float>& pairs) {
                return Run(program, pairs);
              });
  }

  std::unique_ptr<VulkanDevice> device_;
};

// OpenGL runs the GLSL through all of this.
class HlslOnVulkan : public OnVulkan {};

TEST_P(OnVulkan, MaterialsAgree) {
  CheckMaterialShape({.width = 37, .height = 101, .shifts = {0, 1, 2, 3}, .constants = 2}, 201);
}

TEST_P(HlslOnVulkan, MaterialsAgreeForOtherShapes) {
  CheckMaterialShape({.outputs = 17, .address = "clamp"}, 202, 5);
  CheckMaterialShape({.shifts = {2, 0, 1, 0, 1}, .is_signed = true, .outputs = 1}, 203);
}

TEST_P(HlslOnVulkan, MaterialsAgreeWithWeightsInATexture) {
  // More than 64 KiB.
  CheckMaterialShape({.shifts = {1}, .hidden = 128, .outputs = 128}, 204);
}

TEST_P(HlslOnVulkan, MaterialsAgreeWhereAllIsConstant) {
  CheckMaterialShape({.shifts = {}, .outputs = 0, .constants = 7}, 205);
}

TEST_P(HlslOnVulkan, BrdfsAgreeForOtherRecipes) {
  test::BrdfSampleOptions options;
  options.pack.half_vector_inputs = true;
  options.pack.interpolation = Interpolation::kInverseDistance;
  CheckBrdfSample(options, 210);
}

TEST_P(OnVulkan, BrdfsAgree) {
  test::BrdfSampleOptions options;
  options.pack.isotropic = options.pack.canonical_order = true;
  options.pack.nside = 16;
  options.pack.primitive_size = 16;
  options.hidden = {32, 32};
  CheckBrdfSample(options, 211);
}

TEST_P(HlslOnVulkan, UncompressedNeuralTexturesAgree) {
  test::BrdfSampleOptions options;
  options.textures = 2;
  options.halves = true;
  CheckBrdfSample(options, 212);
}

INSTANTIATE_TEST_SUITE_P(Languages, OnVulkan,
                         testing::Values(ShaderLanguage::kHlsl, ShaderLanguage::kGlsl),
                         [](const auto& language) {
                           return language.param == ShaderLanguage::kHlsl ? "Hlsl" : "Glsl";
                         });

INSTANTIATE_TEST_SUITE_P(Languages, HlslOnVulkan, testing::Values(ShaderLanguage::kHlsl));

}  // namespace
}  // namespace patina::gpu_test
