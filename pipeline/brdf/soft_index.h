// Indices into a codebook that are learned: a row of logits for each corner, whose largest is the
// corner's index.
//
// Based on: Dou 2023 ("NeuBRDF"), Eq. 7, and Takikawa 2022: the forward pass takes the code of the
// largest logit, the backward pass goes through a softmax with a temperature (straight-through).
// The gradient by the feature of a corner is summed over the samples first; the softmax is then run
// once for each corner, which gives exactly the sum of the samples' gradients.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/base/aligned_buffer.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/brdf_kernels.h"

namespace patina::brdf {

class SoftIndex {
 public:
  // `corners`: those that have logits; others keep their index. codes: entries of the codebook;
  // stride: floats between its rows. Logits are zero.
  SoftIndex(std::vector<int32_t> corners, int codes, int stride, const BrdfKernels& kernels,
            ThreadPool& pool);

  // Logits from the standard normal distribution: nothing is known.
  void StartAtRandom(uint64_t seed);
  // Logits that fall with the squared distance of a corner's feature to the codes, by `sharpness`
  // times the mean gap between the nearest and the second. features: rows of all corners.
  void StartFromFeatures(const float* features, const float* codebook, float sharpness);

  // Adds to the gradient by the feature of a corner that has logits; others are left out.
  void Accumulate(int32_t corner, const float* gradient);

  // One Adam step of all rows that got a gradient since the last one, then their indices anew.
  // Returns false if a logit or moment is not finite afterwards.
  bool Update(const float* codebook, float temperature, const AdamSettings& settings,
              std::span<int32_t> index);
  // The indices of all corners that have logits.
  void WriteIndices(std::span<int32_t> index) const;

  // Save keeps the logits; Rollback brings them back and forgets gradients and moments.
  void Save();
  void Rollback();
  size_t state_bytes() const { return logits_.size() * sizeof(float); }

 private:
  float* LogitsOfRow(size_t row) { return logits_.data() + row * columns_; }
  int32_t Largest(size_t row) const;

  std::vector<int32_t> corners_;  // of each row
  std::vector<int32_t> row_of_corner_;
  int codes_, columns_, stride_;
  const BrdfKernels& kernels_;
  ThreadPool& pool_;
  AlignedBuffer<float> logits_, moment1_, moment2_;  // [row][columns_]
  AlignedBuffer<float> saved_logits_;
  AlignedBuffer<float> gradient_;                    // [row][stride_]
  AlignedBuffer<float> transposed_;                  // codebook [stride_][columns_]
  AlignedBuffer<float> scratch_;                     // [thread][columns_]
  std::vector<uint8_t> touched_;
  std::vector<int32_t> touched_rows_;
};

}  // namespace patina::brdf
