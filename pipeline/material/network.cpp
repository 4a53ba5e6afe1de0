#include "pipeline/material/network.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "formats/half.h"

namespace patina {

Network::Network(std::span<const float> mean, std::span<const float> scale)
    : outputs_(static_cast<int>(mean.size())), mean_(mean.begin(), mean.end()), scale_(scale.begin(), scale.end()) {
  const size_t padded = (parameter_count() + 15) / 16 * 16;
  for (auto* buffer : {&params_, &raw_, &gradient_, &moment1_, &moment2_, &saved_params_, &saved_moment1_, &saved_moment2_}) {
    buffer->Reset(padded);
  }
}

void Network::Unfold() {
  const int b2 = mlp::OffsetB2(outputs_);
  std::memcpy(raw_.data(), params_.data(), sizeof(float) * mlp::kW2);
  for (int c = 0; c < outputs_; ++c) {
    for (int j = 0; j < mlp::kHidden; ++j) {
      const int at = mlp::kW2 + c * mlp::kHidden + j;
      raw_[at] = params_[at] * scale_[c];
    }
    raw_[b2 + c] = std::fma(params_[b2 + c], scale_[c], mean_[c]);
  }
}

bool Network::Step(const MaterialKernels& kernels, std::span<const float> raw_gradient, const AdamRates& rates) {
  const int b2 = mlp::OffsetB2(outputs_);
  for (int k = 0; k < parameter_count(); ++k) {
    float scale = 1;
    if (k >= b2) {
      scale = scale_[k - b2];
    } else if (k >= mlp::kW2) {
      scale = scale_[(k - mlp::kW2) / mlp::kHidden];
    }
    gradient_[k] = raw_gradient[k] * scale;
    if (!std::isfinite(gradient_[k])) return false;
  }
  ++updates_;
  const bool finite = kernels.adam_flat(params_.data(), gradient_.data(), moment1_.data(), moment2_.data(), parameter_count(), updates_, rates);
  Unfold();
  // Unfolded, a weight may be beyond what a float holds.
  return finite && std::all_of(raw_.data(), raw_.data() + parameter_count(), [](float w) { return std::isfinite(w); });
}

void Network::Save() {
  const size_t bytes = params_.size() * sizeof(float);
  std::memcpy(saved_params_.data(), params_.data(), bytes);
  std::memcpy(saved_moment1_.data(), moment1_.data(), bytes);
  std::memcpy(saved_moment2_.data(), moment2_.data(), bytes);
  saved_updates_ = updates_;
}

void Network::Restore() {
  const size_t bytes = params_.size() * sizeof(float);
  std::memcpy(params_.data(), saved_params_.data(), bytes);
  std::memcpy(moment1_.data(), saved_moment1_.data(), bytes);
  std::memcpy(moment2_.data(), saved_moment2_.data(), bytes);
  updates_ = saved_updates_;
  Unfold();
}

void Network::RoundRawToHalf() {
  for (int k = 0; k < parameter_count(); ++k) raw_[k] = HalfToFloat(FloatToHalf(raw_[k]));
}

}  // namespace patina
