// What a material's textures would take in the formats that are usually chosen for them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/manifest.h"

namespace patina {

struct TextureBytes {
  std::string name;
  uint64_t bytes = 0;
};

// Computed from sizes and mips, without headers: 4x4 blocks of 8 bytes (BC1, BC4) or 16 (BC5, BC6H,
// BC7), at the source's size and with the mips that the container stores. Maps whose channels are
// all constant take nothing. Colours that do not fit into [0, 1] go to BC6H, or to 16 bits where
// nothing is compressed. Empty if every map is constant.
std::vector<TextureBytes> UsualTextures(const Manifest& manifest);

}  // namespace patina
