#include "pipeline/brdf/grid_trainer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace patina::brdf {
namespace {

// 1 / (1 - beta^steps)
float Correction(float beta, int steps) {
  return steps > 10000 ? 1.0f
                       : static_cast<float>(1 / (1 - std::pow(static_cast<double>(beta), steps)));
}

AdamSettings Settings(float rate, float decay, int steps) {
  AdamSettings settings;
  settings.decay = decay;
  settings.rate = rate;
  settings.correction1 = Correction(settings.beta1, steps);
  settings.correction2 = Correction(settings.beta2, steps);
  return settings;
}

float UniformIn(Rng* rng, float bound) { return (2 * rng->Uniform() - 1) * bound; }

}  // namespace

GridTrainer::GridTrainer(const NetworkLayout& layout, int corners, const BrdfKernels& kernels,
                         ThreadPool& pool, uint64_t seed)
    : layout_(layout), corners_(corners), kernels_(kernels), pool_(pool) {
  for (auto* buffer :
       {&parameters_, &parameter_gradient_, &parameter_moment1_, &parameter_moment2_})
    buffer->Reset(layout.parameter_count);
  transposed_.Reset(layout.transposed_count);
  const size_t values = static_cast<size_t>(corners) * layout.feature_stride;
  for (auto* buffer : {&features_, &gradient_, &moment1_, &moment2_}) buffer->Reset(values);
  touched_.resize(corners);
  for (int t = 0; t < pool.threads(); ++t)
    scratch_.push_back(std::make_unique<ChunkScratch>(layout));

  Rng rng(seed, 11);
  constexpr float kFeatureSpread = 0.1f;
  for (int c = 0; c < corners; ++c) {
    for (int k = 0; k < layout.primitive_size; ++k)
      features_[static_cast<size_t>(c) * layout.feature_stride + k] =
          UniformIn(&rng, kFeatureSpread);
  }
  for (size_t l = 0; l < layout.layers.size(); ++l) {
    const DenseLayer& layer = layout.layers[l];
    const bool last = l + 1 == layout.layers.size();
    const float bound = std::sqrt(6.0f / static_cast<float>(layer.inputs)) * (last ? 0.3f : 1.0f);
    const int used = last ? kOutputs : layout.hidden;
    for (int i = 0; i < layer.inputs; ++i) {
      // Rows of padding stay zero, or features that are never written would learn something.
      const int side = i / layout.feature_stride, texture = i - 2 * layout.feature_stride;
      const bool padding =
          l > 0      ? i >= layout.hidden
          : side < 2 ? i % layout.feature_stride >= layout.primitive_size
                     : texture >= layout.texture_inputs && texture < layout.texture_stride;
      if (padding) continue;
      for (int n = 0; n < used; ++n)
        parameters_[layer.weights + static_cast<size_t>(i) * layer.outputs + n] =
            UniformIn(&rng, bound);
    }
  }
  ParametersChanged();
}

ChunkTask GridTrainer::MakeTask(const PoolSample* samples, int count, const TexelTaps* taps) const {
  ChunkTask task;
  task.layout = &layout_;
  task.parameters = parameters_.data();
  task.transposed = transposed_.data();
  task.features = has_codebook() ? codebook_.data() : features_.data();
  task.row_of_corner = has_codebook() ? index_.data() : nullptr;
  task.samples = samples;
  task.count = count;
  if (texture_ != nullptr) {
    task.texture = texture_->rows();
    task.taps = taps;
  }
  return task;
}

bool GridTrainer::UpdateRows(const std::vector<int32_t>& rows, const AdamSettings& settings,
                             float* values, float* gradient, float* moment1, float* moment2) {
  const size_t stride = layout_.feature_stride;
  bool finite = true;
  for (const int32_t row : rows) {
    const size_t at = static_cast<size_t>(row) * stride;
    finite &=
        kernels_.adam(values + at, gradient + at, moment1 + at, moment2 + at, stride, settings);
  }
  return finite;
}

void GridTrainer::RunChunks(const PoolSample* samples, int count, const TexelTaps* taps) {
  const int chunks = (count + kChunkRows - 1) / kChunkRows;
  while (static_cast<int>(results_.size()) < chunks)
    results_.push_back(std::make_unique<ChunkResult>(layout_));
  pool_.ParallelFor(chunks, [&](int chunk, int worker) {
    const int first = chunk * kChunkRows;
    kernels_.train_chunk(MakeTask(samples + first, std::min(kChunkRows, count - first),
                                  taps == nullptr ? nullptr : taps + first),
                         scratch_[worker].get(), results_[chunk].get());
  });
}

void GridTrainer::VisitGradients(
    const PoolSample* samples, size_t count, const TexelTaps* taps,
    const std::function<void(size_t first, int rows, const ChunkResult& result)>& visit) {
  constexpr size_t kBatch = size_t{16} * kChunkRows;
  for (size_t begin = 0; begin < count; begin += kBatch) {
    const int rows = static_cast<int>(std::min(kBatch, count - begin));
    RunChunks(samples + begin, rows, taps == nullptr ? nullptr : taps + begin);
    for (int first = 0; first < rows; first += kChunkRows)
      visit(begin + first, std::min(kChunkRows, rows - first), *results_[first / kChunkRows]);
  }
}

bool GridTrainer::Step(const PoolSample* samples, int count, const StepRates& rates,
                       const TexelTaps* taps) {
  const int chunks = (count + kChunkRows - 1) / kChunkRows;
  RunChunks(samples, count, taps);
  double loss = 0;
  for (int chunk = 0; chunk < chunks; ++chunk) {
    if (!std::isfinite(results_[chunk]->loss) || !results_[chunk]->finite) return false;
    loss += results_[chunk]->loss;
  }
  step_loss_ = loss / count;
  ++steps_;
  if (has_codebook()) ++code_steps_;

  bool finite[3] = {true, true, true};
  pool_.ParallelFor(texture_ != nullptr ? 4 : 3, [&](int job, int) {
    if (job == 3) {
      for (int chunk = 0; chunk < chunks; ++chunk) {
        const int first = chunk * kChunkRows;
        texture_->Scatter(taps + first, std::min(kChunkRows, count - first), *results_[chunk]);
      }
      return;
    }
    if (job == 2) {
      for (int chunk = 0; chunk < chunks; ++chunk) {
        const float* from = results_[chunk]->weight_gradient.data();
        for (size_t i = 0; i < layout_.parameter_count; ++i) parameter_gradient_[i] += from[i];
      }
      finite[job] = kernels_.adam(parameters_.data(), parameter_gradient_.data(),
                                  parameter_moment1_.data(), parameter_moment2_.data(),
                                  layout_.parameter_count,
                                  Settings(rates.network, rates.decay, steps_));
      TransposeWeights(layout_, parameters_.data(), transposed_.data());
      return;
    }
    std::vector<int32_t>& rows = rows_[job];
    rows.clear();
    for (int s = 0; s < count; ++s) {
      for (int c = 4 * job; c < 4 * job + 4; ++c) {
        const int32_t corner = samples[s].corner[c];
        if (touched_[corner] == 0) {
          touched_[corner] = 1;
          rows.push_back(corner);
        }
      }
    }
    for (int chunk = 0; chunk < chunks; ++chunk) {
      const int first = chunk * kChunkRows;
      kernels_.scatter(layout_, samples + first, std::min(kChunkRows, count - first), job,
                       *results_[chunk], gradient_.data());
    }
    for (const int32_t row : rows) touched_[row] = 0;
    if (!has_codebook())
      finite[job] = UpdateRows(rows, Settings(rates.features, rates.decay, steps_),
                               features_.data(), gradient_.data(), moment1_.data(),
                               moment2_.data());
  });
  bool all_finite = finite[0] && finite[1] && finite[2];
  if (texture_ != nullptr) all_finite &= texture_->Update(pool_);
  if (!has_codebook()) return all_finite;

  // Corners of both directions share the codes.
  code_rows_.clear();
  const size_t stride = layout_.feature_stride;
  for (const auto& rows : rows_) {
    for (const int32_t corner : rows) {
      const int32_t code = index_[corner];
      if (code_touched_[code] == 0) {
        code_touched_[code] = 1;
        code_rows_.push_back(code);
      }
      float* from = gradient_.data() + static_cast<size_t>(corner) * stride;
      if (soft_) soft_->Accumulate(corner, from);
      float* to = code_gradient_.data() + static_cast<size_t>(code) * stride;
      for (size_t k = 0; k < stride; ++k) {
        to[k] += from[k];
        from[k] = 0;
      }
    }
  }
  for (const int32_t code : code_rows_) code_touched_[code] = 0;
  all_finite &=
      UpdateRows(code_rows_, Settings(rates.features, rates.decay, code_steps_), codebook_.data(),
                 code_gradient_.data(), code_moment1_.data(), code_moment2_.data());
  if (soft_ && code_steps_ % kStepsPerUpdate == 0) {
    all_finite &= soft_->Update(codebook_.data(), rates.temperature,
                                Settings(rates.logits, 0, ++logit_steps_), index_);
  }
  return all_finite;
}

size_t GridTrainer::state_bytes() const {
  const size_t floats = parameters_.size() + (has_codebook() ? codebook_ : features_).size();
  return floats * sizeof(float) + (soft_ ? soft_->state_bytes() : 0) +
         (texture_ != nullptr ? texture_->state_bytes() : 0);
}

void GridTrainer::Save() {
  const auto copy = [](const AlignedBuffer<float>& from, AlignedBuffer<float>* to) {
    if (to->size() != from.size()) to->Reset(from.size());
    std::memcpy(to->data(), from.data(), from.size() * sizeof(float));
  };
  copy(parameters_, &saved_parameters_);
  copy(has_codebook() ? codebook_ : features_, &saved_features_);
  if (soft_) soft_->Save();
  if (texture_ != nullptr) texture_->Save(pool_);
}

void GridTrainer::Rollback() {
  AlignedBuffer<float>& features = has_codebook() ? codebook_ : features_;
  std::memcpy(parameters_.data(), saved_parameters_.data(), parameters_.size() * sizeof(float));
  std::memcpy(features.data(), saved_features_.data(), features.size() * sizeof(float));
  ForgetMoments();
  if (soft_) {
    soft_->Rollback();
    soft_->WriteIndices(index_);
  }
  if (texture_ != nullptr) texture_->Rollback(pool_);
  ParametersChanged();
}

void GridTrainer::ForgetMoments() {
  for (auto* buffer : {&parameter_gradient_, &parameter_moment1_, &parameter_moment2_, &gradient_,
                       &moment1_, &moment2_, &code_gradient_, &code_moment1_, &code_moment2_}) {
    std::fill(buffer->data(), buffer->data() + buffer->size(), 0.0f);
  }
  steps_ = code_steps_ = logit_steps_ = 0;
}

void GridTrainer::UseSoftIndex(std::unique_ptr<SoftIndex> soft) {
  soft_ = std::move(soft);
  soft_->WriteIndices(index_);
  logit_steps_ = 0;
}

void GridTrainer::UseCodebook(std::vector<float> codebook, std::vector<int32_t> index) {
  for (auto* buffer : {&codebook_, &code_gradient_, &code_moment1_, &code_moment2_})
    buffer->Reset(codebook.size());
  std::copy(codebook.begin(), codebook.end(), codebook_.data());
  code_touched_.assign(codebook.size() / layout_.feature_stride, 0);
  index_ = std::move(index);
  code_steps_ = 0;
}

void GridTrainer::Evaluate(const PoolSample* samples, size_t count, float* y,
                           const TexelTaps* taps) {
  const int chunks = static_cast<int>((count + kChunkRows - 1) / kChunkRows);
  pool_.ParallelFor(chunks, [&](int chunk, int worker) {
    const size_t first = static_cast<size_t>(chunk) * kChunkRows;
    const int rows = static_cast<int>(std::min<size_t>(kChunkRows, count - first));
    kernels_.forward_chunk(
        MakeTask(samples + first, rows, taps == nullptr ? nullptr : taps + first),
        scratch_[worker].get());
    for (int s = 0; s < rows; ++s) {
      for (int c = 0; c < kOutputs; ++c)
        y[(first + s) * kOutputs + c] = scratch_[worker]->outputs[static_cast<size_t>(s) * 16 + c];
    }
  });
}

}  // namespace patina::brdf
