// What the neural decode of a material costs a frame at 1080p, against the same channels as plain
// textures, on Mesa's software renderer: medians over alternated frames, and their ratio. Not a
// GPU: llvmpipe decodes BC6H texel by texel through a slow path and BC1 and BC5 through a fast one,
// so textures are compared as they are and both uncompressed, where only samples and arithmetic
// count.
//
// Plain textures: BC1 (albedo), BC5 (normal), BC1 (ao, roughness, metalness), or RGBA8, with all
// mips. Their bits are random, which every block format allows; what is read does not change the
// cost. The same level of detail for both; the picture covers levels 0 to 2.
//
// Usage: patina_gpu_bench [frames]
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "tests/formats/gpu/gl_runner.h"
#include "tests/formats/gpu/material_samples.h"
#include "tests/formats/test_support.h"

namespace {

using namespace patina;
using namespace patina::gpu_test;

constexpr int kSide = 1024, kWidth = 1920, kHeight = 1080;

// Along y the texels a pixel grow from 1 to 4.
constexpr const char* kUv =
    "vec2 uv = gl_FragCoord.xy * (1.0 + gl_FragCoord.y / 720.0) / 1024.0;\n";

DdsFile RandomTexture(uint32_t dxgi, size_t block_bytes, int block_side, uint64_t seed) {
  test::Random random(seed);
  DdsFile file{dxgi, kSide, kSide, {}};
  for (int side = kSide; side >= 1; side /= 2) {
    const auto blocks = static_cast<size_t>((side + block_side - 1) / block_side);
    std::vector<uint8_t> bytes(blocks * blocks * block_bytes);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random.Next());
    file.levels.push_back(std::move(bytes));
  }
  return file;
}

GpuProgram Plain(bool compressed) {
  GpuProgram program;
  const uint32_t formats[] = {71, 83, 71};
  for (int i = 0; i < 3; ++i) {
    const size_t bytes = !compressed ? 4 : i == 1 ? 16 : 8;
    program.textures.push_back({"plain" + std::to_string(i), i, true,
                                RandomTexture(compressed ? formats[i] : 28, bytes,
                                              compressed ? 4 : 1, static_cast<uint64_t>(i))});
    program.shader += "layout(binding = " + std::to_string(i) + ") uniform sampler2D plain" +
                      std::to_string(i) + ";\n";
  }
  program.outputs = 4;
  program.body = std::string(kUv) +
                 "vec3 a = texture(plain0, uv).rgb; vec2 n = 2.0 * texture(plain1, uv).rg - 1.0;\n"
                 "vec3 o = texture(plain2, uv).rgb;\n"
                 "float z = sqrt(max(0.0, 1.0 - dot(n, n)));\n"
                 "result[0] = a.r + n.x; result[1] = a.g + n.y; result[2] = a.b + z;\n"
                 "result[3] = o.r + o.g + o.b;\n";
  return program;
}

GpuProgram Neural(const Container& container, bool compressed) {
  GpuProgram program = LoadProgram(container, {});
  program.shader = "#define PATINA_DERIVATIVES\n" + program.shader;
  program.outputs = 4;
  program.body = std::string(kUv) +
                 "PatinaMaterial m = patina_material(uv); vec3 n = patina_map_normal(m);\n"
                 "vec3 a = patina_map_albedo(m);\n"
                 "result[0] = a.r + n.x; result[1] = a.g + n.y; result[2] = a.b + n.z;\n"
                 "result[3] = m.value[5] + m.value[6] + m.value[7];\n";
  if (compressed) return program;
  for (GpuTexture& texture : program.textures) {
    DdsFile plain{10, texture.file.width, texture.file.height, {}};
    const DdsTexture blocks = *ReadDds(container.PathOf(
        container.manifest.features[static_cast<size_t>(texture.binding)].payload));
    for (int level = 0; level < static_cast<int>(blocks.levels.size()); ++level) {
      const std::vector<uint16_t> rgb = DecodeDdsLevel(blocks, level);
      std::vector<uint8_t> bytes;
      for (size_t i = 0; i < rgb.size() / 3; ++i) {
        for (size_t c = 0; c < 4; ++c) {
          const uint16_t half = c < 3 ? rgb[3 * i + c] : uint16_t{0};
          bytes.push_back(static_cast<uint8_t>(half));
          bytes.push_back(static_cast<uint8_t>(half >> 8));
        }
      }
      plain.levels.push_back(std::move(bytes));
    }
    texture.file = std::move(plain);
  }
  return program;
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
  const int frames = std::max(7, argc > 1 ? std::atoi(argv[1]) : 9);
  std::string why;
  const auto gl = GlContext::Create(GlApi::kGl45, GlCompiler::kOptimizing, &why);
  if (gl == nullptr) {
    std::fprintf(stderr, "patina_gpu_bench: %s\n", why.c_str());
    return 1;
  }
  const test::TemporaryDirectory folder;
  const Container container =
      MakeMaterial(folder.path(), {.width = kSide, .height = kSide, .outputs = 8}, 1);
  const GlPicture picture(*gl, kWidth, kHeight);
  std::printf("%s, %dx%d, %d frames each\n", gl->renderer().c_str(), kWidth, kHeight, frames);
  for (const bool compressed : {true, false}) {
    const auto neural = picture.Compile(Neural(container, compressed));
    const auto plain = picture.Compile(Plain(compressed));
    if (!neural->good() || !plain->good()) return 1;
    std::vector<double> neural_ms, plain_ms, ratios;
    for (int frame = -1; frame < frames; ++frame) {  // the first one compiles
      double ms[2];
      for (int which = 0; which < 2; ++which) {
        const auto begin = std::chrono::steady_clock::now();
        picture.Draw(which == 0 ? *neural : *plain);
        ms[which] =
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
                .count();
      }
      if (frame < 0) continue;
      neural_ms.push_back(ms[0]);
      plain_ms.push_back(ms[1]);
      ratios.push_back(ms[0] / ms[1]);
    }
    const auto [least, most] = std::minmax_element(ratios.begin(), ratios.end());
    std::printf("%-34s neural %7.1f ms, plain %7.1f ms, ratio %.2f (%.2f to %.2f)\n",
                compressed ? "BC6H against BC1 + BC5 + BC1" : "RGBA16F against three RGBA8",
                Median(neural_ms), Median(plain_ms), Median(ratios), *least, *most);
  }
  return 0;
}
