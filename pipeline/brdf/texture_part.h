// What a neural texture does in the training of a spatially varying BRDF.
#pragma once

#include <cstddef>

#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/brdf_kernels.h"

namespace patina::brdf {

class TexturePart {
 public:
  virtual ~TexturePart() = default;

  // What samples look up: rows of NetworkLayout::texture_stride floats.
  virtual const float* rows() const = 0;
  // Adds up the gradients of a chunk. Called for one chunk after another, in order.
  virtual void Scatter(const TexelTaps* taps, int count, const ChunkResult& result) = 0;
  // One step with what was added up, which is forgotten. False if a value is not finite afterwards.
  virtual bool Update(ThreadPool& pool) = 0;

  // As GridTrainer::Save and Rollback.
  virtual void Save(ThreadPool& pool) = 0;
  virtual void Rollback(ThreadPool& pool) = 0;
  virtual size_t state_bytes() const = 0;
};

}  // namespace patina::brdf
