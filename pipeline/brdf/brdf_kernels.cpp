#include "pipeline/brdf/brdf_kernels.h"

#include <algorithm>

namespace patina {

namespace simd_avx2 {
extern const brdf::BrdfKernels kBrdfKernels;
}
namespace simd_avx512 {
extern const brdf::BrdfKernels kBrdfKernels;
}

namespace brdf {

NetworkLayout::NetworkLayout(int primitive_size_, int extra_inputs_, int hidden_, int hidden_layers,
                             int texture_inputs_)
    : primitive_size(primitive_size_),
      feature_stride(PadTo16(primitive_size_)),
      extra_inputs(extra_inputs_),
      texture_inputs(texture_inputs_),
      texture_stride(PadTo16(texture_inputs_)),
      hidden(hidden_) {
  int inputs = input_columns();
  for (int l = 0; l <= hidden_layers; ++l) {
    DenseLayer layer;
    layer.inputs = inputs;
    layer.outputs = l < hidden_layers ? PadTo16(hidden) : 16;
    layer.input_stride = PadTo16(inputs + 1);
    layer.weights = parameter_count;
    layer.transposed = transposed_count;
    parameter_count += static_cast<size_t>(inputs + 1) * layer.outputs;
    transposed_count += static_cast<size_t>(layer.outputs) * PadTo16(inputs);
    inputs = layer.outputs;
    layers.push_back(layer);
  }
}

double NetworkLayout::ForwardMacs() const {
  const int hidden_layers = static_cast<int>(layers.size()) - 1;
  const double inputs = 2.0 * primitive_size + texture_inputs + extra_inputs;
  return inputs * hidden + static_cast<double>(hidden_layers - 1) * hidden * hidden +
         static_cast<double>(hidden) * kOutputs;
}

ChunkScratch::ChunkScratch(const NetworkLayout& layout) : outputs(kChunkRows * 16) {
  int widest = 16;
  for (const DenseLayer& layer : layout.layers) {
    activations.emplace_back(static_cast<size_t>(kChunkRows) * layer.input_stride);
    for (int s = 0; s < kChunkRows; ++s)
      activations.back()[static_cast<size_t>(s) * layer.input_stride + layer.inputs] = 1;
    widest = std::max(widest, layer.outputs);
  }
  for (auto& buffer : gradient) buffer.Reset(static_cast<size_t>(kChunkRows) * widest);
}

ChunkResult::ChunkResult(const NetworkLayout& layout)
    : weight_gradient(layout.parameter_count),
      feature_gradient(static_cast<size_t>(kChunkRows) * layout.feature_columns()) {}

const BrdfKernels& KernelsFor(SimdTarget target) {
  return target == SimdTarget::kAvx512 ? simd_avx512::kBrdfKernels : simd_avx2::kBrdfKernels;
}

void TransposeWeights(const NetworkLayout& layout, const float* parameters, float* transposed) {
  for (const DenseLayer& layer : layout.layers) {
    const int stride = PadTo16(layer.inputs);
    for (int i = 0; i < layer.inputs; ++i) {
      for (int n = 0; n < layer.outputs; ++n) {
        transposed[layer.transposed + static_cast<size_t>(n) * stride + i] =
            parameters[layer.weights + static_cast<size_t>(i) * layer.outputs + n];
      }
    }
  }
}

}  // namespace brdf
}  // namespace patina
