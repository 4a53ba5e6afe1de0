#include "tests/formats/gpu/gpu_program.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"

namespace patina::gpu_test {
namespace {

DdsFile ReadDdsFile(const std::vector<uint8_t>& bytes) {
  DdsFile file;
  EXPECT_GE(bytes.size(), 148u);
  if (bytes.size() < 148) return file;
  file.height = static_cast<int>(LoadLittle32(bytes.data() + 12));
  file.width = static_cast<int>(LoadLittle32(bytes.data() + 16));
  file.dxgi_format = LoadLittle32(bytes.data() + 128);
  const int levels = static_cast<int>(LoadLittle32(bytes.data() + 28));
  size_t at = 148;
  for (int level = 0; level < levels; ++level) {
    const auto w = static_cast<size_t>(std::max(1, file.width >> level));
    const auto h = static_cast<size_t>(std::max(1, file.height >> level));
    const uint32_t format = file.dxgi_format;
    const size_t size = format == 95 || format == 96 ? (w + 3) / 4 * ((h + 3) / 4) * 16
                        : format == 2                ? w * h * 16
                        : format == 10               ? w * h * 8
                        : format == 42               ? w * h * 4
                        : format == 57               ? w * h * 2
                                                     : 0;
    EXPECT_GT(size, 0u) << "DXGI format " << format;
    EXPECT_LE(at + size, bytes.size());
    if (size == 0 || at + size > bytes.size()) return file;
    file.levels.emplace_back(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                             bytes.begin() + static_cast<std::ptrdiff_t>(at + size));
    at += size;
  }
  EXPECT_EQ(at, bytes.size());
  return file;
}

}  // namespace

GpuProgram LoadProgram(const Container& container, const ShaderOptions& options) {
  GpuProgram program;
  program.language = options.language;
  const auto package = BuildShaderPackage(container, options);
  EXPECT_TRUE(package) << package.error().message;
  if (!package) return program;
  const auto bytes_of = [&](const std::string& name) -> std::vector<uint8_t> {
    for (const ShaderFile& file : package->files) {
      if (file.name == name) return file.bytes;
    }
    ADD_FAILURE() << "the package has no " << name;
    return {};
  };
  const auto json = nlohmann::json::parse(bytes_of("bindings.json"));
  const std::vector<uint8_t> shader = bytes_of(json["shader"]);
  program.shader.assign(shader.begin(), shader.end());
  program.wrap = json.value("address", "wrap") == "wrap";
  for (const auto& listed : json["textures"]) {
    GpuTexture texture;
    texture.name = listed["name"];
    texture.binding = listed["binding"];
    if (listed.contains("container_file")) {
      texture.filtered = true;
      const auto bytes = ReadFile(container.PathOf(listed["container_file"]), uint64_t{1} << 30);
      EXPECT_TRUE(bytes);
      if (bytes) texture.file = ReadDdsFile(*bytes);
    } else {
      texture.file = ReadDdsFile(bytes_of(listed["file"]));
    }
    EXPECT_EQ(texture.file.width, listed["width"]);
    EXPECT_EQ(texture.file.height, listed["height"]);
    EXPECT_EQ(texture.file.levels.size(), listed["levels"]);
    program.textures.push_back(std::move(texture));
  }
  if (json.contains("constants")) {
    const auto& constants = json["constants"];
    program.constants_name = constants["name"];
    program.constants_binding = constants["binding"];
    program.constants = bytes_of(constants["file"]);
    EXPECT_EQ(program.constants.size(), constants["bytes"]);
  }
  return program;
}

void SetMaterialBody(GpuProgram* program, int channels) {
  program->outputs = channels;
  program->body =
      "PatinaMaterial material = patina_material_lod(in0.xy, in0.z);\n"
      "for (int c = 0; c < " +
      std::to_string(channels) + "; ++c) result[c] = material.value[c];\n";
}

void SetBrdfBody(GpuProgram* program, bool varies) {
  program->outputs = 3;
  program->body =
      std::string("PATINA_VEC3 f = ") +
      (varies ? "patina_svbrdf(in0.xyz, in1.xyz, PATINA_VEC2(in0.w, in1.w), 5.0 * in0.w - 1.0);\n"
              : "patina_brdf(in0.xyz, in1.xyz);\n") +
      "result[0] = f.x; result[1] = f.y; result[2] = f.z;\n";
}

bool IsInstalled(const std::string& package) {
  const std::string command =
      "dpkg-query -W -f='${db:Status-Status}' " + package + " 2>/dev/null | grep -q ^installed";
  return std::system(command.c_str()) == 0;
}

}  // namespace patina::gpu_test
