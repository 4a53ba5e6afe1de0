#include "formats/shader_package.h"

#include <algorithm>

#include "formats/base/file_io.h"
#include "formats/base/sha256.h"
#include "formats/dds.h"
#include "formats/shader_build.h"
#include "formats/shader_text.h"

namespace patina {
namespace {

// What every implementation has: OpenGL ES 3.00 16 KiB, the others 64 KiB in practice.
constexpr size_t kMaxConstantBytesEssl = 16384;
constexpr size_t kMaxConstantBytes = 65536;
constexpr int kMaxTextureSide = 16384;

std::string Upper(std::string text) {
  for (char& c : text) c = c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  return text;
}

const char* FormatName(DataFormat format) {
  switch (format) {
    case DataFormat::kRgba32Float:
      return "RGBA32_FLOAT";
    case DataFormat::kRgba16Float:
      return "RGBA16_FLOAT";
    case DataFormat::kR32Uint:
      return "R32_UINT";
    case DataFormat::kR16Uint:
      break;
  }
  return "R16_UINT";
}

const char* LanguageName(ShaderLanguage language) {
  switch (language) {
    case ShaderLanguage::kGlsl:
      return "glsl";
    case ShaderLanguage::kEssl:
      return "essl";
    case ShaderLanguage::kHlsl:
      break;
  }
  return "hlsl";
}

}  // namespace

void ShaderDraft::Define(const std::string& name, const std::string& value) {
  defines += "#define PATINA_" + Upper(prefix) + "_" + name +
             (value.empty() || value[0] == ' ' ? "" : " ") + value + "\n";
}

Status ShaderDraft::AddTable(const std::string& name, DataFormat format,
                             std::vector<uint8_t> texels) {
  const auto texel_bytes = static_cast<size_t>(DataTexelBytes(format));
  const size_t count = texels.size() / texel_bytes;
  int shift = 0;
  while ((size_t{1} << (2 * shift)) < count) ++shift;
  const size_t width = size_t{1} << shift;
  const size_t height = (count + width - 1) / width;
  if (width > static_cast<size_t>(kMaxTextureSide)) {
    return Fail(ErrorCode::kUnsupported, container.directory + ": the table of " +
                                             std::to_string(count) + " texels for " + name +
                                             " does not fit into a texture");
  }
  texels.resize(width * height * texel_bytes, 0);
  const std::string file = prefix + "_" + name + ".dds";
  Define(Upper(name) + "_BINDING", next_binding());
  Define(Upper(name) + "_SHIFT", shift);
  textures.push_back({{"name", "patina_" + prefix + "_" + name},
                      {"binding", next_binding()},
                      {"file", file},
                      {"format", FormatName(format)},
                      {"width", width},
                      {"height", height},
                      {"levels", 1}});
  tables.push_back(
      {file, EncodeDataDds(format, static_cast<int>(width), static_cast<int>(height), texels)});
  return {};
}

Status ShaderDraft::AddConstants(const ShaderConstants& constants) {
  Define("MATRICES", constants.matrices());
  Define("VECTORS", constants.vectors());
  std::string layers;
  for (const auto& [input4, output4, matrix, vector] : constants.layers()) {
    layers += " PATINA_" + Upper(prefix) + "_LAYER(" + std::to_string(input4) + ", " +
              std::to_string(output4) + ", " + std::to_string(matrix) + ", " +
              std::to_string(vector) + ")";
  }
  Define("LAYERS", layers);
  std::vector<uint8_t> bytes = constants.Bytes();
  const bool essl = options.language == ShaderLanguage::kEssl;
  if (bytes.size() > (essl ? kMaxConstantBytesEssl : kMaxConstantBytes))
    return AddTable("weights", DataFormat::kRgba32Float, std::move(bytes));
  // Vulkan counts all bindings of a set together; registers b of HLSL count by themselves, and are
  // few.
  const int binding =
      options.language == ShaderLanguage::kHlsl ? options.first_binding : next_binding();
  const std::string file = prefix + "_weights.bin";
  Define("WEIGHTS_BINDING", binding);
  bindings["constants"] = {
      {"name", prefix == "brdf" ? "PatinaBrdfWeights" : "PatinaMaterialWeights"},
      {"binding", binding},
      {"file", file},
      {"bytes", bytes.size()},
      {"matrices", constants.matrices()},
      {"vectors", constants.vectors()}};
  tables.push_back({file, std::move(bytes)});
  return {};
}

Result<ShaderPackage> BuildShaderPackage(const Container& container, const ShaderOptions& options) {
  if (options.first_binding < 0 || options.first_binding > kMaxFirstBinding) {
    return Fail(ErrorCode::kInvalidArgument,
                "the first binding " + std::to_string(options.first_binding) +
                    " is not within 0 to " + std::to_string(kMaxFirstBinding));
  }
  PATINA_TRY(VerifyPayloads(container));
  const bool is_brdf = container.manifest.brdf.has_value();
  ShaderDraft draft{container, options, is_brdf ? "brdf" : "material", {}, {}, {}, {}, {}};
  draft.bindings = nlohmann::ordered_json::object();
  draft.textures = nlohmann::ordered_json::array();
  PATINA_TRY(is_brdf ? DraftBrdf(&draft) : DraftMaterial(&draft));

  const bool hlsl = options.language == ShaderLanguage::kHlsl;
  const std::string name = draft.prefix + (hlsl ? ".hlsl" : ".glsl");
  const std::string shader =
      "// Made by `patina shader`; containers of the same structure have the same text.\n"
      "// bindings.json says what to bind.\n\n" +
      draft.defines + "\n" + ShaderSource("patina_" + name) + draft.tail;
  nlohmann::ordered_json json = {{"format", "patina-shader"},
                                 {"format_version", 1},
                                 {"kind", container.manifest.kind},
                                 {"asset", container.manifest.asset},
                                 {"fingerprint", container.manifest.fingerprint},
                                 {"working_space", container.manifest.working_space},
                                 {"language", LanguageName(options.language)},
                                 {"shader", name},
                                 {"shader_sha256", Sha256Hex(AsBytes(shader))},
                                 {"textures", std::move(draft.textures)}};
  for (auto& [key, value] : draft.bindings.items()) json[key] = std::move(value);

  const auto bytes_of = [](const std::string& text) {
    return std::vector<uint8_t>(text.begin(), text.end());
  };
  ShaderPackage package;
  package.files.push_back({name, bytes_of(shader)});
  for (ShaderFile& table : draft.tables) package.files.push_back(std::move(table));
  package.files.push_back(
      {"bindings.json",
       bytes_of(json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
                "\n")});
  return package;
}

}  // namespace patina
