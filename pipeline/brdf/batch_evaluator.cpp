#include "pipeline/brdf/batch_evaluator.h"

#include <algorithm>

#include "formats/half.h"

namespace patina::brdf {
namespace {

const WeightTensor* FindTensor(const WeightBuffer& buffer, const std::string& name) {
  for (const WeightTensor& tensor : buffer.tensors) {
    if (tensor.name == name) return &tensor;
  }
  return nullptr;
}

Error BadNetwork(const std::string& what) {
  return {ErrorCode::kCorruptData, "the network does not fit the index pack: " + what};
}

}  // namespace

Result<BatchEvaluator> BatchEvaluator::Create(const IndexPack& pack,
                                              const std::vector<float>& features,
                                              const WeightBuffer& network, int texture_inputs) {
  PATINA_ASSIGN(const SimdTarget target, ActiveSimdTarget());
  BatchEvaluator evaluator;
  evaluator.kernels_ = &KernelsFor(target);
  evaluator.grid_ = {pack.nside,           pack.interpolation, pack.isotropic,
                     pack.canonical_order, pack.angle_inputs,  pack.half_vector_inputs};
  const int layers = static_cast<int>(network.tensors.size() / 2);
  const WeightTensor* first = FindTensor(network, "layer0.weight");
  if (layers < 2 || first == nullptr || first->shape.size() != 2)
    return Fail(BadNetwork("two layers or more are needed"));
  const int hidden = static_cast<int>(first->shape[0]);
  if (hidden > 256) return Fail(BadNetwork("more than 256 hidden units"));
  evaluator.layout_ = std::make_unique<NetworkLayout>(
      pack.primitive_size, evaluator.grid_.extra_inputs(), hidden, layers - 1, texture_inputs);
  const NetworkLayout& layout = *evaluator.layout_;
  evaluator.parameters_.Reset(layout.parameter_count);
  for (int l = 0; l < layers; ++l) {
    const DenseLayer& layer = layout.layers[l];
    const std::string name = "layer" + std::to_string(l);
    const WeightTensor *weight = FindTensor(network, name + ".weight"),
                       *bias = FindTensor(network, name + ".bias");
    const uint32_t outputs = l + 1 < layers ? hidden : kOutputs;
    const uint32_t inputs =
        l == 0 ? 2 * pack.primitive_size + layout.extra_inputs + texture_inputs : hidden;
    if (weight == nullptr || weight->shape != std::vector<uint32_t>{outputs, inputs})
      return Fail(BadNetwork(name + ".weight has another shape"));
    if (bias == nullptr || bias->shape != std::vector<uint32_t>{outputs})
      return Fail(BadNetwork(name + ".bias has another shape"));
    for (uint32_t o = 0; o < outputs; ++o) {
      for (uint32_t i = 0; i < inputs; ++i) {
        uint32_t column = i;  // features are padded to whole vectors
        if (l == 0) {
          const uint32_t k = pack.primitive_size, stride = layout.feature_stride;
          const uint32_t scalars = 2 * k + layout.extra_inputs;
          column = i < k         ? i
                   : i < 2 * k   ? stride + i - k
                   : i < scalars ? layout.feature_columns() + i - 2 * k
                                 : 2 * stride + i - scalars;
        }
        evaluator.parameters_[layer.weights + static_cast<size_t>(column) * layer.outputs + o] =
            HalfToFloat(weight->elements[static_cast<size_t>(o) * inputs + i]);
      }
      evaluator.parameters_[layer.weights + static_cast<size_t>(layer.inputs) * layer.outputs + o] =
          HalfToFloat(bias->elements[o]);
    }
  }
  const size_t corners = 2 * static_cast<size_t>(evaluator.grid_.corners());
  if (features.size() != corners * pack.primitive_size)
    return Fail(BadNetwork("another number of corners"));
  evaluator.features_.Reset(corners * layout.feature_stride);
  for (size_t c = 0; c < corners; ++c) {
    std::copy_n(features.data() + c * pack.primitive_size, pack.primitive_size,
                evaluator.features_.data() + c * layout.feature_stride);
  }
  evaluator.FoldFirstLayer();
  return evaluator;
}

void BatchEvaluator::FoldFirstLayer() {
  constexpr size_t kMostFloats = size_t{1} << 19;  // 2 MB
  const DenseLayer& first = layout_->layers[0];
  const size_t stride = layout_->feature_stride, corners = features_.size() / stride,
               columns = first.outputs;
  if (corners * columns > kMostFloats || layout_->texture_inputs > 0) return;
  folded_.Reset(corners * columns);
  for (size_t c = 0; c < corners; ++c) {
    const size_t side = c < corners / 2 ? 0 : 1;
    for (size_t k = 0; k < stride; ++k) {
      const float feature = features_[c * stride + k];
      const float* weights = parameters_.data() + first.weights + (side * stride + k) * columns;
      for (size_t n = 0; n < columns; ++n) folded_[c * columns + n] += feature * weights[n];
    }
  }
  features_.Reset(0);
}

BatchEvaluator::Scratch::Scratch(const BatchEvaluator& evaluator)
    : chunk_(evaluator.layout()),
      pairs_(1),
      samples_(evaluator.folded_.size() > 0 ? 0 : kChunkRows) {}

void BatchEvaluator::LookUp(const Direction* wi, const Direction* wo, int count,
                            PairLookups* pairs) const {
  if (grid_.interpolation == healpix::Interpolation::kBilinear) {
    const LookUpGrid grid = {grid_.nside,           grid_.corners(),    grid_.isotropic,
                             grid_.canonical_order, grid_.angle_inputs, grid_.half_vector_inputs};
    kernels_->look_up_pairs(grid, wi, wo, count, pairs);
    return;
  }
  for (int s = 0; s < kChunkRows; ++s) {
    const int pair = s < count ? s : 0;
    PoolSample sample = {};
    LookUpPair(grid_, wi[pair], wo[pair], &sample);
    for (int c = 0; c < 8; ++c) pairs->corner[c][s] = sample.corner[c];
    for (int c = 0; c < 8; ++c) pairs->weight[c][s] = sample.weight[c];
    for (int e = 0; e < kMaxExtraInputs; ++e) pairs->extra[e][s] = sample.extra[e];
  }
}

void BatchEvaluator::ForwardUnfolded(int count, const float* texture, const TexelTaps* taps,
                                     Scratch* scratch) const {
  const PairLookups& pairs = scratch->pairs_[0];
  for (int s = 0; s < count; ++s) {
    PoolSample& sample = scratch->samples_[s];
    for (int c = 0; c < 8; ++c) sample.corner[c] = pairs.corner[c][s];
    for (int c = 0; c < 8; ++c) sample.weight[c] = pairs.weight[c][s];
    for (int e = 0; e < kMaxExtraInputs; ++e) sample.extra[e] = pairs.extra[e][s];
  }
  ChunkTask task;
  task.layout = layout_.get();
  task.parameters = parameters_.data();
  task.features = features_.data();
  task.samples = scratch->samples_.data();
  task.count = count;
  task.texture = texture;
  task.taps = taps;
  kernels_->forward_chunk(task, &scratch->chunk_);
}

void BatchEvaluator::Evaluate(Scratch* scratch, size_t count, const Direction* wi,
                              const Direction* wo, float* rgb, const float* texture,
                              const TexelTaps* taps) const {
  for (size_t first = 0; first < count; first += kChunkRows) {
    const int used = static_cast<int>(std::min<size_t>(kChunkRows, count - first));
    LookUp(wi + first, wo + first, used, &scratch->pairs_[0]);
    if (folded_.size() > 0) {
      kernels_->evaluate_chunk(*layout_, parameters_.data(), folded_.data(), scratch->pairs_[0],
                               &scratch->chunk_);
    } else {
      ForwardUnfolded(used, texture, taps == nullptr ? nullptr : taps + first, scratch);
    }
    kernels_->output_values(scratch->chunk_.outputs.data(), wi + first, wo + first, used,
                            rgb + first * kOutputs);
  }
}

}  // namespace patina::brdf
