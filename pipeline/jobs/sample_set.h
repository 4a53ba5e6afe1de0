// Sample input on disk: a material to bake without a download.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/sample_material.h"

namespace patina {

inline constexpr int kMaxSampleSide = 16384;

// What every sample of textures starts with: `folder` is made if it is missing. Errors:
// kInvalidArgument (size outside 1..kMaxSampleSide), kIo, kResourceExhausted.
Result<SampleMaterial> StartSample(const std::string& folder, int size, uint64_t seed,
                                   ThreadPool& pool);

// Writes the maps of MakeSampleMaterial as PNG files into `folder` (made if missing), with a
// job.json that bakes them into `folder`/baked: base colour and emissive 8 bit sRGB, OpenGL normals
// 16 bit, ambient occlusion, roughness and metalness packed into one 8 bit file, height 16 bit.
// Files of the same names are replaced. Returns the paths written, the job last. Errors:
// those of StartSample.
Result<std::vector<std::string>> WriteSampleSet(const std::string& folder, int size, uint64_t seed,
                                                ThreadPool& pool);

}  // namespace patina
