// The texts of the runtime decoders, and numbers as they stand in shaders.
#pragma once

#include <string>
#include <vector>

#include "formats/manifest.h"

namespace patina {

// formats/decoder/<name> with its `#include` lines replaced by the files they name. The file must
// be one of ours.
std::string ShaderSource(const std::string& name);

// The shortest decimal that reads back as the same number, with a point or an exponent.
std::string ShaderNumber(float value);

// Functions that give each map as a number or vector, patina_map_<role>(material); names are made
// of what the languages allow. Maps of more than four channels have none.
std::string MapAccessors(const std::vector<ManifestChannel>& channels);

}  // namespace patina
