// The parts of BuildShaderPackage; nothing else includes this.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "formats/dds.h"
#include "formats/shader_constants.h"
#include "formats/shader_package.h"

namespace patina {

// A package in the making. `bindings` is what becomes bindings.json.
struct ShaderDraft {
  const Container& container;
  ShaderOptions options;
  std::string prefix;   // of the defines and files: "material" or "brdf"
  std::string defines;  // the configuration: lines of `#define`
  std::string tail;     // what follows the decoder
  std::vector<ShaderFile> tables;
  nlohmann::ordered_json bindings = nlohmann::ordered_json::object();
  nlohmann::ordered_json textures = nlohmann::ordered_json::array();

  // `#define PATINA_<PREFIX>_<name> value`
  void Define(const std::string& name, const std::string& value);
  void Define(const std::string& name, int value) { Define(name, std::to_string(value)); }
  // Adds a table of `texel_count` texels as a texture of one level whose rows are a power of two
  // wide, defines <name>_BINDING and <name>_SHIFT, and lists it. Errors: kUnsupported (too large).
  Status AddTable(const std::string& name, DataFormat format, std::vector<uint8_t> texels);
  // Adds the constants as a buffer, or as a texture if they are too many for one.
  Status AddConstants(const ShaderConstants& constants);
  // Of the next texture.
  int next_binding() const { return options.first_binding + static_cast<int>(textures.size()); }
};

// Checks and lists a feature texture of the container; returns its PATINA_TEXTURE(name, binding).
// Errors: those of ReadDds and MatchTexture.
Result<std::string> AddFeatureTexture(ShaderDraft* draft, size_t index);

Status DraftMaterial(ShaderDraft* draft);
Status DraftBrdf(ShaderDraft* draft);

}  // namespace patina
