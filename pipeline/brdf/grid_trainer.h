// The optimiser of a grid of features (or of indices into a codebook) and the network behind it.
//
// Based on: Dou 2023 ("NeuBRDF"), sections 3.3 and 4, with the per-corner accumulation of
// design/neural-brdf: the gradient by the feature of a corner is summed first, so that what follows
// (Adam, codebook, softmax) costs one row a corner and step.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "pipeline/base/rng.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/brdf_kernels.h"
#include "pipeline/brdf/soft_index.h"
#include "pipeline/brdf/texture_part.h"

namespace patina::brdf {

struct StepRates {
  float features = 0;  // or, once there is a codebook, of its codes
  float network = 0;
  float decay = 0;   // of features, codes and weights, per step and rate
  float logits = 0;  // of a soft index
  float temperature = 1;
};

// Corners are numbered through both grids; rows of features have layout.feature_stride floats.
// Results do not depend on the number of threads. Not thread-safe.
class GridTrainer {
 public:
  // corners: rows of both grids together; a sample's corners of wi and of wo are never the same
  // rows. Features and network start at random from the seed. All references must outlive it.
  GridTrainer(const NetworkLayout& layout, int corners, const BrdfKernels& kernels,
              ThreadPool& pool, uint64_t seed);

  // One step on `count` samples. Returns false if the loss, a gradient, a moment or a parameter is
  // not finite: the state is then of no use and has to be rolled back.
  // taps: of each sample, with a texture; else null.
  bool Step(const PoolSample* samples, int count, const StepRates& rates,
            const TexelTaps* taps = nullptr);

  // With a layout that has texture inputs, before anything else: the texture takes part in steps,
  // saving and rolling back from now on. It must outlive the trainer.
  void UseTexture(TexturePart* texture) { texture_ = texture; }

  // The gradients of samples as a step would get them, chunk by chunk in order; nothing changes.
  void VisitGradients(
      const PoolSample* samples, size_t count, const TexelTaps* taps,
      const std::function<void(size_t first, int rows, const ChunkResult& result)>& visit);

  // Save keeps what is trained for Rollback, which also forgets the optimiser's state. Whatever
  // else changes what is trained should save anew; UseCodebook and UseSoftIndex must be followed by
  // it.
  void Save();
  void Rollback();
  // What Rollback does to the optimiser's state alone: after the parameters were changed otherwise.
  void ForgetMoments();
  size_t state_bytes() const;  // of what Save copies
  double step_loss() const { return step_loss_; }  // mean of the last step's samples

  // Goes over to a codebook: `codes` rows and an index for each corner. From here on steps move the
  // codes; the index stays.
  void UseCodebook(std::vector<float> codebook, std::vector<int32_t> index);
  // Lets the index move as well: from now on its logits take a step with every kStepsPerUpdate-th
  // step of the codes. There is a codebook; the soft index has its number of codes.
  void UseSoftIndex(std::unique_ptr<SoftIndex> soft);
  static constexpr int kStepsPerUpdate = 8;
  bool has_codebook() const { return !index_.empty(); }

  // y of samples in order: [count][3].
  void Evaluate(const PoolSample* samples, size_t count, float* y, const TexelTaps* taps = nullptr);

  int corners() const { return corners_; }
  AlignedBuffer<float>& features() { return features_; }
  AlignedBuffer<float>& codebook() { return codebook_; }
  const std::vector<int32_t>& index() const { return index_; }
  AlignedBuffer<float>& parameters() { return parameters_; }
  void ParametersChanged() { TransposeWeights(layout_, parameters_.data(), transposed_.data()); }

 private:
  ChunkTask MakeTask(const PoolSample* samples, int count, const TexelTaps* taps) const;
  // The chunks of a batch, into results_.
  void RunChunks(const PoolSample* samples, int count, const TexelTaps* taps);
  bool UpdateRows(const std::vector<int32_t>& rows, const AdamSettings& settings, float* values,
                  float* gradient, float* moment1, float* moment2);

  const NetworkLayout& layout_;
  int corners_;
  const BrdfKernels& kernels_;
  ThreadPool& pool_;
  AlignedBuffer<float> parameters_, transposed_, parameter_gradient_, parameter_moment1_,
      parameter_moment2_;
  AlignedBuffer<float> features_, gradient_, moment1_, moment2_;
  AlignedBuffer<float> codebook_, code_gradient_, code_moment1_, code_moment2_;
  AlignedBuffer<float> saved_parameters_, saved_features_;  // features or codebook
  std::vector<int32_t> index_;
  std::unique_ptr<SoftIndex> soft_;
  TexturePart* texture_ = nullptr;
  std::vector<std::unique_ptr<ChunkScratch>> scratch_;
  std::vector<std::unique_ptr<ChunkResult>> results_;
  std::vector<uint8_t> touched_, code_touched_;
  std::vector<int32_t> rows_[2], code_rows_;
  int steps_ = 0, code_steps_ = 0, logit_steps_ = 0;
  double step_loss_ = 0;
};

}  // namespace patina::brdf
