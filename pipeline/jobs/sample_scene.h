// A sample scene on disk: glTF materials to bake without a download.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/thread_pool.h"

namespace patina {

// Writes mosaic.gltf, which has materials and no geometry, afar.patina.json, which says the same
// of one of them and how large it is seen, and their textures, the maps of MakeSampleMaterial, as
// 8-bit PNG files. Materials: a floor with all textures that glows beyond 1; the same floor wet,
// with a clearcoat; an unlit sign; brass and glass without textures. Files of the same names are
// replaced. Returns the paths written. Errors: those of WriteSampleSet.
Result<std::vector<std::string>> WriteSampleScene(const std::string& folder, int size,
                                                  uint64_t seed, ThreadPool& pool);

}  // namespace patina
