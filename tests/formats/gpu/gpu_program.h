// What the tests run on a GPU: a function of a few vectors, evaluated for many items, around a
// shader that `patina shader` wrote.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "formats/shader_package.h"

namespace patina::gpu_test {

// An image file (DDS with DX10 header) as an engine reads it: what the header says, and bytes.
struct DdsFile {
  uint32_t dxgi_format = 0;
  int width = 0;
  int height = 0;
  std::vector<std::vector<uint8_t>> levels;
};

struct GpuTexture {
  std::string name;
  int binding = 0;
  bool filtered = false;  // between texels and levels; else read by texel
  DdsFile file;
};

struct GpuProgram {
  ShaderLanguage language = ShaderLanguage::kGlsl;
  std::string shader;
  bool wrap = true;
  std::vector<GpuTexture> textures;
  std::string constants_name;  // empty: none
  int constants_binding = 0;
  std::vector<uint8_t> constants;
  // Statements in the words of patina_language.*; they read the vectors of four in0 and in1 and
  // write result[0] .. result[outputs - 1].
  std::string body;
  int outputs = 0;
};

// Reads bindings.json, the tables and the container's textures as an engine would, from the files
// of the package and the container's directory. Fails the current test for what is not as it should
// be.
GpuProgram LoadProgram(const Container& container, const ShaderOptions& options);

// Runs a program for items of eight floats (in0, in1): program.outputs floats each.
using RunProgram = std::function<std::vector<float>(const GpuProgram&, const std::vector<float>&)>;

// The body for materials: in0 = (u, v, s, -), all channels; and for BRDFs: in0 = wi, in1 = wo, of
// spatially varying ones with u and v behind them and s = 5 u - 1.
void SetMaterialBody(GpuProgram* program, int channels);
void SetBrdfBody(GpuProgram* program, bool varies = false);

// True if the named Debian package is installed, and so a test that needs it may not be skipped.
bool IsInstalled(const std::string& package);

}  // namespace patina::gpu_test

// Skips the test if Mesa is not installed; fails it if it is and does not work.
#define PATINA_NEED_MESA(condition, package, why)                                              \
  do {                                                                                         \
    if (!(condition)) {                                                                        \
      ASSERT_FALSE(patina::gpu_test::IsInstalled(package)) << package << " is there: " << why; \
      GTEST_SKIP() << package << " is not installed: " << why;                                 \
    }                                                                                          \
  } while (false)
