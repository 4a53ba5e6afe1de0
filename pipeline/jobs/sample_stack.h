// A sample layered material with maps on disk: wood under a scratched lacquer.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina {

inline constexpr int kDefaultSampleStackSide = 128;

// Writes scratched_lacquer.layers.json and its maps of albedo, thickness and roughness, `side`
// texels a side, tileable, into `folder` (made if missing), replacing files of the same names;
// returns the paths. The same bytes for a side and a seed. Errors: kIo, kResourceExhausted.
Result<std::vector<std::string>> WriteSampleStack(const std::string& folder, int side,
                                                  uint64_t seed);

}  // namespace patina
