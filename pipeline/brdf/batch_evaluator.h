// Evaluates a baked BRDF in batches with the SIMD kernels: what a CPU renderer would do, and what
// verification uses.
#pragma once

#include <memory>
#include <vector>

#include "formats/base/result.h"
#include "formats/index_pack.h"
#include "formats/weights.h"
#include "pipeline/brdf/brdf_kernels.h"
#include "pipeline/brdf/sample_pool.h"

namespace patina::brdf {

class BatchEvaluator {
 public:
  // Scratch of one thread.
  class Scratch {
   public:
    explicit Scratch(const BatchEvaluator& evaluator);

   private:
    friend class BatchEvaluator;
    ChunkScratch chunk_;
    AlignedBuffer<PairLookups> pairs_;   // one
    AlignedBuffer<PoolSample> samples_;  // of a chunk; empty if corners are folded
  };

  // features: as ExpandCorners gives them. texture_inputs: of a spatially varying BRDF. Errors:
  // kCorruptData (tensors that do not fit the pack or each other), kUnsupported (CPU).
  static Result<BatchEvaluator> Create(const IndexPack& pack, const std::vector<float>& features,
                                       const WeightBuffer& network, int texture_inputs = 0);

  // f of `count` pairs of unit vectors, rgb [count][3]; zero where a direction is not above the
  // horizon. Any count. With texture inputs: texture (rows of layout().texture_stride floats) and
  // the taps of each pair.
  void Evaluate(Scratch* scratch, size_t count, const Direction* wi, const Direction* wo,
                float* rgb, const float* texture = nullptr, const TexelTaps* taps = nullptr) const;

  const NetworkLayout& layout() const { return *layout_; }

 private:
  BatchEvaluator() = default;

  void FoldFirstLayer();
  void LookUp(const Direction* wi, const Direction* wo, int count, PairLookups* pairs) const;
  void ForwardUnfolded(int count, const float* texture, const TexelTaps* taps,
                       Scratch* scratch) const;

  const BrdfKernels* kernels_ = nullptr;
  GridShape grid_;
  std::unique_ptr<NetworkLayout> layout_;
  AlignedBuffer<float> parameters_;
  // Of the corners: what the first layer makes of them, or, where that would not stay in a cache,
  // the features themselves.
  AlignedBuffer<float> folded_, features_;
};

}  // namespace patina::brdf
