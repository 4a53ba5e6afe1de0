// A procedural PBR material for trying Patina without a download.
//
// A floor of octagonal stone tiles with brass inlays between them: worn and cracked stone,
// verdigris on the brass, moss in the joints, and veins that glow in some cracks. It repeats in
// both directions.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/base/thread_pool.h"

namespace patina {

// Row-major planes, interleaved where a map has several channels, all values in [0,1].
struct SampleMaterial {
  int size = 0;
  std::vector<float> albedo;  // [size*size][3], sRGB-coded
  std::vector<float>
      normal;              // [size*size][3], 0.5 + 0.5 n, OpenGL (Y up), consistent with `height`
  std::vector<float> arm;  // [size*size][3]: ambient occlusion, roughness, metalness
  std::vector<float> height;    // [size*size]; 1 is kSampleDepth above 0, in sides of the texture
  std::vector<float> emissive;  // [size*size][3], sRGB-coded
};

// How far height 1 lies above height 0, as a share of the texture's side.
inline constexpr float kSampleDepth = 0.045f;

// size: 1..16384 texels a side. The same values for a size and a seed, for any number of threads.
SampleMaterial MakeSampleMaterial(int size, uint64_t seed, ThreadPool& pool);

}  // namespace patina
