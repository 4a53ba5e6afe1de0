#pragma once

#include <cstdint>
#include <vector>

#include "formats/manifest.h"

namespace patina {

// What an engine loads of a container, in bytes: without reports and previews.
uint64_t ModelBytes(const std::vector<ManifestPayload>& payloads);

// Of images that were baked together: their bytes as half floats, over `bytes`.
double CompressionRatio(const ManifestBrdf& brdf, uint64_t bytes);

}  // namespace patina
