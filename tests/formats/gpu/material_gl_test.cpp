// The GLSL decoder of materials on llvmpipe, with the files as they are, against the C++ decoder.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/formats/gpu/gl_runner.h"
#include "tests/formats/gpu/material_samples.h"
#include "tests/formats/test_support.h"

namespace patina::gpu_test {
namespace {

using test::TemporaryDirectory;

// Of a channel's range: pow of the driver against that of the C library.
constexpr double kBound = 1e-4;

class MaterialOnGl : public testing::TestWithParam<GlApi> {
 protected:
  void SetUp() override {
    std::string why;
    gl_ = GlContext::Create(GetParam(), GlCompiler::kQuick, &why);
    PATINA_NEED_MESA(gl_ != nullptr, "libgl1-mesa-dri", why);
    ASSERT_NE(gl_->renderer().find("llvmpipe"), std::string::npos) << gl_->renderer();
  }

  void Check(const MaterialShape& shape, uint64_t seed, size_t count = 3000) {
    const TemporaryDirectory folder;
    CheckMaterial(MakeMaterial(folder.path(), shape, seed), seed, count, Options(),
                  [&](const GpuProgram& program, const std::vector<float>& lookups) {
                    return RunOnGl(*gl_, program, lookups);
                  });
  }

  ShaderOptions Options(int first_binding = 0) const {
    const bool es = GetParam() == GlApi::kEs30;
    return {es ? ShaderLanguage::kEssl : ShaderLanguage::kGlsl, first_binding};
  }

  std::unique_ptr<GlContext> gl_;
};

// Compiling takes the time, and ES has the same text: what is in MaterialOnGl45 is not repeated
// there.
class MaterialOnGl45 : public MaterialOnGl {};

TEST_P(MaterialOnGl, AgreesAtRandomPlaces) {
  Check({}, 1);
  Check({.address = "clamp"}, 2);
}

TEST_P(MaterialOnGl, AgreesWithOddAndNarrowSizes) {
  Check({.width = 37, .height = 101, .shifts = {0, 1, 2, 3}}, 3);
  Check({.width = 37, .height = 101, .shifts = {0, 1, 2, 3}, .address = "clamp"}, 4);
  Check({.width = 128, .height = 3, .shifts = {1, 1, 3, 3}}, 5);
  Check({.width = 1, .height = 1, .shifts = {0, 1, 2, 3}}, 6);
}

TEST_P(MaterialOnGl, AgreesForAnyNumberOfChannels) {
  const bool es = GetParam() == GlApi::kEs30;
  for (const int outputs : es ? std::vector<int>{1, 21} : std::vector<int>{1, 3, 4, 16, 21})
    Check({.outputs = outputs}, static_cast<uint64_t>(10 + outputs), 500);
}

TEST_P(MaterialOnGl, AgreesWithConstants) {
  Check({.outputs = 4, .constants = 3}, 40, 500);
  Check({.outputs = 1, .constants = 6}, 41, 500);
  Check({.shifts = {}, .outputs = 0, .constants = 7}, 42, 100);
}

TEST_P(MaterialOnGl45, AgreesForAnyNumberOfTextures) {
  Check({.shifts = {0}}, 50, 500);
  Check({.shifts = {2, 0}}, 51, 500);
  Check({.shifts = {0, 1, 2}}, 52, 500);
  Check({.shifts = {0, 1, 2, 3, 4}}, 53, 500);
  Check({.shifts = {0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0}}, 54, 500);
}

TEST_P(MaterialOnGl45, AgreesForSignedTextures) { Check({.is_signed = true}, 60); }

TEST_P(MaterialOnGl45, AgreesForACutRangeOfLevels) {
  for (const auto& [fine, coarse] : {std::pair(1, 2), std::pair(0, 9), std::pair(9, 0)}) {
    const TemporaryDirectory folder;
    const Container whole = MakeMaterial(folder.path(), {.shifts = {0, 1, 2, 3}}, 65);
    CheckMaterial(CutLevels(whole, fine, coarse), 66, 1000, Options(),
                  [&](const GpuProgram& program, const std::vector<float>& lookups) {
                    return RunOnGl(*gl_, program, lookups);
                  });
  }
}

// Two channels of one output (equal channels are learned once) keep their own range and encoding.
TEST_P(MaterialOnGl45, ChannelsMayShareAnOutput) {
  const TemporaryDirectory folder;
  Container container = MakeMaterial(folder.path(), {.outputs = 6}, 67);
  const size_t channels = container.manifest.channels.size();
  const auto lookups = RandomLookups(68, 500, 64, 48);
  const auto run = [&] {
    GpuProgram program = LoadProgram(container, Options());
    SetMaterialBody(&program, static_cast<int>(channels));
    return RunOnGl(*gl_, program, lookups);
  };
  const std::vector<float> alone = run();
  // Channel 0 is srgb, channel 5 linear: channel 5 now shows what channel 0 has, before its curve.
  container.manifest.channels[5].output = container.manifest.channels[0].output;
  const std::vector<float> shared = run();
  ASSERT_EQ(alone.size(), shared.size());
  const Decoder decoder = LoadDecoder(container);
  for (size_t i = 0; i < lookups.size() / 8; ++i) {
    const float* values = shared.data() + i * channels;
    EXPECT_EQ(values[0], alone[i * channels]);
    EXPECT_NEAR(Decoder::ToPhysical(decoder.channels()[0], values[5]), values[0],
                kBound * PhysicalRange(decoder.channels()[0]));
  }
}

TEST_P(MaterialOnGl45, AgreesForAnyWidth) {
  Check({.hidden = 1}, 70, 500);
  Check({.hidden = 30}, 71, 500);
}

// More weights than a constant buffer is sure to hold in ES.
TEST_P(MaterialOnGl, AgreesWithWeightsInATexture) {
  Check({.shifts = {1}, .hidden = 120, .outputs = 30}, 72, 200);
}

TEST_P(MaterialOnGl, GivesWhatUnpackWrites) {
  const MaterialShape shape{.width = 40, .height = 24};
  const TemporaryDirectory folder;
  const Container container = MakeMaterial(folder.path(), shape, 80);
  const Decoder decoder = LoadDecoder(container);
  const size_t channels = decoder.channels().size();
  std::vector<float> lookups, expected;
  for (int mip = 0; mip < decoder.levels(); ++mip) {
    const int width = decoder.MipWidth(mip), height = decoder.MipHeight(mip);
    const size_t plane = static_cast<size_t>(width) * height;
    const std::vector<float> coded = decoder.DecodeMip(mip);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        lookups.insert(lookups.end(), {static_cast<float>((x + 0.5) / width),
                                       static_cast<float>((y + 0.5) / height),
                                       static_cast<float>(mip), 0, 0, 0, 0, 0});
        for (size_t c = 0; c < channels; ++c) {
          const size_t at = c * plane + static_cast<size_t>(y) * width + x;
          expected.push_back(Decoder::ToPhysical(decoder.channels()[c], coded[at]));
        }
      }
    }
  }
  GpuProgram program = LoadProgram(container, Options(3));
  SetMaterialBody(&program, static_cast<int>(channels));
  ExpectMaterialClose(decoder, lookups, RunOnGl(*gl_, program, lookups), expected);
}

// The encoding of high dynamic range: scale * sign(c) * (exp2(|c|) - 1), also for small values,
// where the difference from 1 has no digits left.
TEST_P(MaterialOnGl, SignedLogIsExact) {
  const TemporaryDirectory folder;
  const Container container =
      MakeMaterial(folder.path(), {.shifts = {}, .outputs = 0, .constants = 1}, 95);
  GpuProgram program = LoadProgram(container, Options());
  program.outputs = 1;
  program.body = "result[0] = PATINA_SIGNED_LOG(in0.x, in0.y);\n";
  std::vector<float> inputs;
  for (const float scale : {1.0f, 0.01f, 300.0f}) {
    for (const float coded : {0.0f, 1e-6f, 1e-3f, 0.0288f, 0.0289f, 0.5f, 1.0f, 7.25f, 15.9f}) {
      for (const float sign : {1.0f, -1.0f})
        inputs.insert(inputs.end(), {sign * coded, scale, 0, 0, 0, 0, 0, 0});
    }
  }
  const std::vector<float> values = RunOnGl(*gl_, program, inputs);
  ASSERT_EQ(values.size(), inputs.size() / 8);
  for (size_t i = 0; i < values.size(); ++i) {
    const double coded = inputs[8 * i], scale = inputs[8 * i + 1];
    const double expected = std::copysign(scale * (std::exp2(std::abs(coded)) - 1), coded);
    // Next to the series exp2(x) - 1 has lost six of 24 bits.
    EXPECT_NEAR(values[i], expected, 1e-5 * std::abs(expected)) << coded << " * " << scale;
  }
}

// The derivatives of (u, v) choose the level: Eq. 11 of the paper on a picture of bands with other
// scales, also below the finest and above the coarsest level.
TEST_P(MaterialOnGl, ImplicitEntryFollowsTheScreen) {
  const MaterialShape shape{.width = 64, .height = 32};
  const TemporaryDirectory folder;
  const Container container = MakeMaterial(folder.path(), shape, 90);
  const Decoder decoder = LoadDecoder(container);
  const size_t channels = decoder.channels().size();
  // Texels of the source per pixel, along x and along y; the larger one counts.
  const std::vector<std::array<double, 2>> steps = {{0.125, 0.03125}, {1, 1},  {3, 0.5},
                                                    {0.75, 5.5},      {40, 2}, {1000, 900}};
  const int width = 16, band = 8, height = band * static_cast<int>(steps.size());
  GpuProgram program = LoadProgram(container, Options());
  program.shader = "#define PATINA_DERIVATIVES\n" + program.shader;
  program.outputs = static_cast<int>(channels);
  program.body = "vec2 texels = vec2(0.0);\n";
  for (size_t b = 0; b < steps.size(); ++b) {
    program.body += "if (int(gl_FragCoord.y) / " + std::to_string(band) +
                    " == " + std::to_string(b) + ") texels = vec2(" + std::to_string(steps[b][0]) +
                    ", " + std::to_string(steps[b][1]) + ");\n";
  }
  program.body +=
      "PatinaMaterial material = patina_material(gl_FragCoord.xy * texels / vec2(64.0, 32.0));\n"
      "for (int c = 0; c < 4; ++c) result[c] = material.value[c];\n";
  const GlPicture picture(*gl_, width, height);
  const auto compiled = picture.Compile(program);
  ASSERT_TRUE(compiled->good());
  picture.Draw(*compiled);
  const std::vector<float> pixels = picture.Pixels();
  ASSERT_EQ(pixels.size(), static_cast<size_t>(width * height * 4));
  std::vector<float> expected(channels);
  for (int y = 0; y < height; ++y) {
    const auto& [along_x, along_y] = steps[static_cast<size_t>(y / band)];
    double worst = 0;
    for (int x = 0; x < width; ++x) {
      decoder.Physical((x + 0.5) * along_x / shape.width, (y + 0.5) * along_y / shape.height,
                       std::log2(std::max(along_x, along_y)), expected.data());
      for (size_t c = 0; c < 4; ++c) {
        const float got = pixels[static_cast<size_t>(y * width + x) * 4 + c];
        const double error = std::abs(static_cast<double>(expected[c]) - got);
        worst = std::max(worst, error / PhysicalRange(decoder.channels()[c]));
      }
    }
    // Differences of floats around 1000 texture widths, and log2, are off by about 1e-4 levels.
    EXPECT_LE(worst, 1e-3) << "row " << y << ": " << along_x << " x " << along_y;
  }
}

INSTANTIATE_TEST_SUITE_P(Apis, MaterialOnGl, testing::Values(GlApi::kGl45, GlApi::kEs30),
                         [](const auto& api) {
                           return api.param == GlApi::kGl45 ? "Gl45" : "Es30";
                         });

INSTANTIATE_TEST_SUITE_P(Apis, MaterialOnGl45, testing::Values(GlApi::kGl45));

}  // namespace
}  // namespace patina::gpu_test
