// The training samples of an image set: random places of its images and of their mips.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/aligned_buffer.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/sample_pool.h"
#include "pipeline/svbrdf/image_set.h"
#include "pipeline/svbrdf/neural_texture.h"

namespace patina::svbrdf {

// f at a place of an image: u, v of texture coordinates, s the level, filtered as decoders filter
// (bilinear in area-averaged mips, linear between them).
struct TexelSample {
  uint32_t image = 0;
  float u = 0, v = 0, s = 0;
  float value[3] = {};
};

struct TexelPool {
  // What every sample of an image has: corners, weights, scalars, the light's cosine; f is open.
  AlignedBuffer<brdf::PoolSample> lookups;  // [image]
  std::vector<TexelSample> samples;         // in random order
};

struct TexelPoolOptions {
  size_t count = size_t{1} << 20;
  int levels = 1;
  brdf::GridShape grid;
  uint64_t seed = 1;
  std::function<void(double fraction)> on_progress;  // on the calling thread; may be empty
  const CancelToken* cancel = nullptr;
};

// Reads every image once, several at a time. Levels are drawn by their share of the texels, small
// ones more often; half of the samples lie on texel centres of a level, the others anywhere between
// it and the next. The same for any number of threads. Errors: those of ReadSetImage,
// of the first image that has any; kCancelled.
Result<TexelPool> DrawTexels(const ImageSet& set, const TexelPoolOptions& options,
                             ThreadPool& pool);

// The mips of an image, `levels` of them, the image itself the first.
std::vector<PlaneLevel> MipsOf(PlaneLevel image, int levels);

}  // namespace patina::svbrdf
