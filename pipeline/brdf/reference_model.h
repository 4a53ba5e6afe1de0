// The BRDF model and its loss, written like the definition: what the kernels are tested against. S
// is float, double or std::complex<double> (complex step); real parts decide every branch.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "pipeline/brdf/brdf_kernels.h"

namespace patina::brdf {

inline double RealOf(double x) { return x; }
inline double RealOf(const std::complex<double>& x) { return x.real(); }

// y [kOutputs] of one sample: features are rows of layout.feature_stride, parameters as layout
// says; texture and taps as in ChunkTask.
template <class S>
void ForwardReference(const NetworkLayout& layout, const S* parameters, const S* features,
                      const PoolSample& sample, S* y, const S* texture = nullptr,
                      const TexelTaps* taps = nullptr) {
  std::vector<S> a(layout.input_columns());
  for (int side = 0; side < 2; ++side) {
    for (int k = 0; k < layout.feature_stride; ++k) {
      S sum = S(0);
      for (int c = 4 * side; c < 4 * side + 4; ++c) {
        sum += S(sample.weight[c]) *
               features[static_cast<size_t>(sample.corner[c]) * layout.feature_stride + k];
      }
      a[side * layout.feature_stride + k] = sum;
    }
  }
  for (int k = 0; k < layout.texture_stride; ++k) {
    S sum = S(0);
    for (int c = 0; c < 8; ++c) {
      sum += S(taps->weight[c]) *
             texture[static_cast<size_t>(taps->row[c]) * layout.texture_stride + k];
    }
    a[2 * layout.feature_stride + k] = sum;
  }
  for (int e = 0; e < layout.extra_inputs; ++e)
    a[layout.feature_columns() + e] = S(sample.extra[e]);
  for (size_t l = 0; l < layout.layers.size(); ++l) {
    const DenseLayer& layer = layout.layers[l];
    std::vector<S> c(layer.outputs);
    for (int n = 0; n < layer.outputs; ++n) {
      c[n] = parameters[layer.weights + static_cast<size_t>(layer.inputs) * layer.outputs + n];
      for (int i = 0; i < layer.inputs; ++i)
        c[n] += a[i] * parameters[layer.weights + static_cast<size_t>(i) * layer.outputs + n];
      if (l + 1 < layout.layers.size() && !(RealOf(c[n]) > 0)) c[n] = S(0);
    }
    a = std::move(c);
  }
  for (int o = 0; o < kOutputs; ++o) y[o] = a[o];
}

// The loss of BrdfKernels::train_chunk for one sample.
template <class S>
S LossReference(const PoolSample& sample, const S* y) {
  const auto magnitude = [](const S& x) { return RealOf(x) < 0 ? -x : x; };
  const auto log1p_or_line = [](double f) { return f > 0 ? std::log1p(f) : f; };
  S loss = S(0);
  const double cosine = static_cast<double>(sample.cosine);
  for (int o = 0; o < kOutputs; ++o) {
    // The gradient goes on where the value is capped, so that a runaway sample finds back.
    const S capped = RealOf(y[o]) > static_cast<double>(kMaxLogValue)
                         ? y[o] - S(RealOf(y[o]) - static_cast<double>(kMaxLogValue))
                         : y[o];
    const S g = RealOf(capped) > 0 ? std::log(S(1) + S(cosine) * (std::exp(capped) - S(1)))
                                   : S(cosine) * capped;
    const double value = static_cast<double>(sample.value[o]);
    loss += magnitude(g - S(log1p_or_line(value * cosine))) +
            S(0.05) * magnitude(capped - S(log1p_or_line(value)));
  }
  return S(static_cast<double>(sample.importance)) * loss;
}

}  // namespace patina::brdf
