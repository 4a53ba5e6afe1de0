// Sample layered materials on disk, to bake without a file of one's own.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina {

// Writes the presets of the simulator as <name>.layers.json into `folder` (made if missing),
// replacing files of the same names; returns the paths. Errors: kIo, kResourceExhausted.
Result<std::vector<std::string>> WriteSampleLayers(const std::string& folder);

}  // namespace patina
