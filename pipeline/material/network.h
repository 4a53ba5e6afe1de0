// The decoder network in training: normalised parameters, their optimiser, and the affine that unfolds them.
#pragma once

#include <span>
#include <vector>

#include "pipeline/base/aligned_buffer.h"
#include "pipeline/base/rng.h"
#include "pipeline/material/window_kernels.h"
#include "pipeline/nn/mlp.h"

namespace patina {

// Parameters are kept for outputs normalised per channel, (coded - mean) / scale, so that one learning rate suits channels of
// any range; the kernels and the container use the raw network, in which scale and mean are folded into the last layer.
class Network {
 public:
  // mean, scale: per output channel, scale > 0.
  Network(std::span<const float> mean, std::span<const float> scale);

  int outputs() const { return outputs_; }
  int parameter_count() const { return mlp::ParameterCount(outputs_); }

  // Normalised parameters, mlp.h order, for initialisation.
  float* normalised() { return params_.data(); }
  // The raw parameters of the current state. Call Unfold() after changing normalised().
  const float* raw() const { return raw_.data(); }
  void Unfold();

  // One Adam step from the gradient by the raw parameters. Returns false if that, or a parameter afterwards, is not finite.
  bool Step(const MaterialKernels& kernels, std::span<const float> raw_gradient, const AdamRates& rates);

  // Copies of everything, for rolling back.
  void Save();
  void Restore();

  // Replaces the raw parameters by their nearest halves (Unfold undoes it).
  void RoundRawToHalf();

 private:
  int outputs_;
  std::vector<float> mean_, scale_;
  AlignedBuffer<float> params_, raw_, gradient_, moment1_, moment2_;
  AlignedBuffer<float> saved_params_, saved_moment1_, saved_moment2_;
  int updates_ = 0;
  int saved_updates_ = 0;
};

}  // namespace patina
