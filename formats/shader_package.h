// What an engine's build needs to decode one container on a GPU: a shader that is specialised to
// it, its numbers as a constant buffer, tables as textures, and a list of what to bind where.
// formats/ENGINE.md is the guide for users.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/container.h"

namespace patina {

enum class ShaderLanguage {
  kGlsl,  // 450: OpenGL 4.5 and Vulkan
  kEssl,  // OpenGL ES 3.00
  kHlsl   // shader model 5 and newer
};

inline constexpr int kMaxFirstBinding = 64;

struct ShaderOptions {
  ShaderLanguage language = ShaderLanguage::kGlsl;
  int first_binding = 0;  // 0..kMaxFirstBinding: of the first texture; the others follow
};

struct ShaderFile {
  std::string name;
  std::vector<uint8_t> bytes;
};

// The shader first, `bindings.json` last.
struct ShaderPackage {
  std::vector<ShaderFile> files;
};

// Checks the container's payloads and makes the files. The shader's text depends on the container's
// structure and constant channels alone: containers with equal ones share it. Errors, which name
// the file: those of VerifyPayloads and of the readers of textures, weights and index packs;
// kCorruptData if these do not fit the manifest; kInvalidArgument for an option out of its range;
// kUnsupported for a table that no texture can hold.
Result<ShaderPackage> BuildShaderPackage(const Container& container, const ShaderOptions& options);

}  // namespace patina
