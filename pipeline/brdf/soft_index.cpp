#include "pipeline/brdf/soft_index.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <utility>

#include "pipeline/base/rng.h"

namespace patina::brdf {
namespace {

constexpr int kRowsPerTask = 64;
constexpr float kNever = -1e30f;  // the logit of a column of padding

double SquaredDistance(const float* a, const float* b, int count) {
  double sum = 0;
  for (int k = 0; k < count; ++k) {
    const double d = static_cast<double>(a[k]) - static_cast<double>(b[k]);
    sum += d * d;
  }
  return sum;
}

}  // namespace

SoftIndex::SoftIndex(std::vector<int32_t> corners, int codes, int stride,
                     const BrdfKernels& kernels, ThreadPool& pool)
    : corners_(std::move(corners)),
      codes_(codes),
      columns_(PadTo16(codes)),
      stride_(stride),
      kernels_(kernels),
      pool_(pool) {
  const size_t rows = corners_.size();
  for (auto* buffer : {&logits_, &moment1_, &moment2_}) buffer->Reset(rows * columns_);
  gradient_.Reset(rows * stride_);
  transposed_.Reset(static_cast<size_t>(stride_) * columns_);
  scratch_.Reset(static_cast<size_t>(pool.threads()) * columns_);
  touched_.assign(rows, 0);
  const int32_t last = corners_.empty() ? -1 : *std::max_element(corners_.begin(), corners_.end());
  row_of_corner_.assign(static_cast<size_t>(last) + 1, -1);
  for (size_t row = 0; row < rows; ++row) {
    row_of_corner_[corners_[row]] = static_cast<int32_t>(row);
    std::fill(LogitsOfRow(row) + codes_, LogitsOfRow(row) + columns_, kNever);
  }
}

void SoftIndex::StartAtRandom(uint64_t seed) {
  Rng rng(seed, 23);
  for (size_t row = 0; row < corners_.size(); ++row) {
    for (int j = 0; j < codes_; ++j) {
      // The sum of twelve: normal enough, and the same bits everywhere.
      float sum = -6;
      for (int u = 0; u < 12; ++u) sum += rng.Uniform();
      LogitsOfRow(row)[j] = sum;
    }
  }
}

void SoftIndex::StartFromFeatures(const float* features, const float* codebook, float sharpness) {
  const size_t rows = corners_.size();
  std::vector<double> gap(rows);
  const int tasks = static_cast<int>((rows + kRowsPerTask - 1) / kRowsPerTask);
  const auto for_rows = [&](const auto& body) {
    pool_.ParallelFor(tasks, [&](int task, int) {
      const size_t begin = static_cast<size_t>(task) * kRowsPerTask;
      for (size_t row = begin; row < std::min(rows, begin + kRowsPerTask); ++row) body(row);
    });
  };
  for_rows([&](size_t row) {
    const float* feature = features + static_cast<size_t>(corners_[row]) * stride_;
    double first = 1e300, second = 1e300;
    for (int j = 0; j < codes_; ++j) {
      const double d =
          SquaredDistance(feature, codebook + static_cast<size_t>(j) * stride_, stride_);
      LogitsOfRow(row)[j] = static_cast<float>(-d);
      second = std::min(second, std::max(first, d));
      first = std::min(first, d);
    }
    gap[row] = codes_ > 1 ? second - first : 0;
  });
  double mean = 0;
  for (const double g : gap) mean += g / static_cast<double>(rows);
  const float scale = static_cast<float>(static_cast<double>(sharpness) / std::max(mean, 1e-12));
  for_rows([&](size_t row) {
    float* logits = LogitsOfRow(row);
    const float largest = *std::max_element(logits, logits + codes_);
    for (int j = 0; j < codes_; ++j) logits[j] = scale * (logits[j] - largest);
  });
}

void SoftIndex::Accumulate(int32_t corner, const float* gradient) {
  const int32_t row =
      static_cast<size_t>(corner) < row_of_corner_.size() ? row_of_corner_[corner] : -1;
  if (row < 0) return;
  if (touched_[row] == 0) {
    touched_[row] = 1;
    touched_rows_.push_back(row);
  }
  float* to = gradient_.data() + static_cast<size_t>(row) * stride_;
  for (int k = 0; k < stride_; ++k) to[k] += gradient[k];
}

bool SoftIndex::Update(const float* codebook, float temperature, const AdamSettings& settings,
                       std::span<int32_t> index) {
  for (int j = 0; j < codes_; ++j) {
    for (int k = 0; k < stride_; ++k)
      transposed_[static_cast<size_t>(k) * columns_ + j] =
          codebook[static_cast<size_t>(j) * stride_ + k];
  }
  const int tasks = static_cast<int>((touched_rows_.size() + kRowsPerTask - 1) / kRowsPerTask);
  std::atomic<bool> finite{true};
  pool_.ParallelFor(tasks, [&](int task, int worker) {
    float* slope = scratch_.data() + static_cast<size_t>(worker) * columns_;
    const size_t begin = static_cast<size_t>(task) * kRowsPerTask;
    for (size_t i = begin; i < std::min(touched_rows_.size(), begin + kRowsPerTask); ++i) {
      const auto row = static_cast<size_t>(touched_rows_[i]);
      float* gradient = gradient_.data() + row * stride_;
      kernels_.softmax_gradient(LogitsOfRow(row), columns_, temperature, transposed_.data(),
                                gradient, stride_, slope);
      std::fill(gradient, gradient + stride_, 0.0f);
      if (!kernels_.adam(LogitsOfRow(row), slope, moment1_.data() + row * columns_,
                         moment2_.data() + row * columns_, columns_, settings)) {
        finite.store(false, std::memory_order_relaxed);
      }
      touched_[row] = 0;
      index[corners_[row]] = Largest(row);
    }
  });
  touched_rows_.clear();
  return finite.load();
}

void SoftIndex::Save() {
  if (saved_logits_.size() == 0) saved_logits_.Reset(logits_.size());
  std::memcpy(saved_logits_.data(), logits_.data(), logits_.size() * sizeof(float));
}

void SoftIndex::Rollback() {
  std::memcpy(logits_.data(), saved_logits_.data(), logits_.size() * sizeof(float));
  for (auto* buffer : {&moment1_, &moment2_, &gradient_})
    std::fill(buffer->data(), buffer->data() + buffer->size(), 0.0f);
  std::fill(touched_.begin(), touched_.end(), uint8_t{0});
  touched_rows_.clear();
}

void SoftIndex::WriteIndices(std::span<int32_t> index) const {
  for (size_t row = 0; row < corners_.size(); ++row) index[corners_[row]] = Largest(row);
}

int32_t SoftIndex::Largest(size_t row) const {
  const float* logits = logits_.data() + row * columns_;
  return static_cast<int32_t>(std::max_element(logits, logits + codes_) - logits);
}

}  // namespace patina::brdf
