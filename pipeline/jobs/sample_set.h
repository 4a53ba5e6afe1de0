// Sample input on disk: a material to bake without a download.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/thread_pool.h"

namespace patina {

inline constexpr int kMaxSampleSide = 16384;

// Writes the maps of MakeSampleMaterial as PNG files into `folder` (made if missing), with a
// job.json that bakes them into `folder`/baked: base colour and emissive 8 bit sRGB, OpenGL normals
// 16 bit, ambient occlusion, roughness and metalness packed into one 8 bit file, height 16 bit.
// Files of the same names are replaced. Returns the paths written, the job last. Errors:
// kInvalidArgument (size outside 1..kMaxSampleSide), kIo, kResourceExhausted.
Result<std::vector<std::string>> WriteSampleSet(const std::string& folder, int size, uint64_t seed,
                                                ThreadPool& pool);

}  // namespace patina
