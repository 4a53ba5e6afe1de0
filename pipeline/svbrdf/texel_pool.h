// The training samples of spatially varying reflectance; those of an image set: random places of
// its images and of their mips.
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

// f at a place under a pair of directions: u, v of texture coordinates, s the level, filtered as
// decoders filter (bilinear in area-averaged mips, linear between them).
struct TexelSample {
  uint32_t pair = 0;  // of an image set the image
  float u = 0, v = 0, s = 0;
  float value[3] = {};
  float importance = 1;  // of the sample beside others, above 0, at most 1: less of noisy ones
};

struct TexelPool {
  // What every sample of a pair has: corners, weights, scalars, the cosine; the rest is open.
  AlignedBuffer<brdf::PoolSample> lookups;  // [pair]
  std::vector<TexelSample> samples;         // in random order
  // What the texels of the neural texture start from: rows as NeuralTexture::rows; empty: zeros.
  std::vector<float> start;
  brdf::SimulationCost cost;  // of what was simulated; else zeros
};

struct TexelPoolOptions {
  size_t count = size_t{1} << 20;
  int levels = 1;
  int features = 0;  // of the neural texture; 0: TexelPool::start is not wanted
  brdf::GridShape grid;
  uint64_t seed = 1;
  std::function<void(double fraction)> on_progress;  // on the calling thread; may be empty
  const CancelToken* cancel = nullptr;
};

// Reads every image once, several at a time; places are drawn as PlaceDrawer does. The same for any
// number of threads. Errors: those of ReadSetImage, of the first image that has any; kCancelled.
Result<TexelPool> DrawTexels(const ImageSet& set, const TexelPoolOptions& options,
                             ThreadPool& pool);

// The mips of an image, `levels` of them, the image itself the first.
std::vector<PlaneLevel> MipsOf(PlaneLevel image, int levels);

void Shuffle(uint64_t seed, std::vector<TexelSample>* samples);

}  // namespace patina::svbrdf
