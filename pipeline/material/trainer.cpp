#include "pipeline/material/trainer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>

#include "pipeline/material/channel_stats.h"

namespace patina {
namespace {

// The share of windows that a small mip gets at least: enough to follow a network that keeps moving.
constexpr double kMipFloor = 0.01;
constexpr int kPlacementTries = 8;

std::vector<double> CumulativeMipShares(const TargetPyramid& pyramid, bool uniform) {
  std::vector<double> cumulative;
  double total_area = 0, total = 0;
  for (const TargetLevel& level : pyramid.levels) total_area += static_cast<double>(level.width) * level.height;
  for (const TargetLevel& level : pyramid.levels) {
    const double share = static_cast<double>(level.width) * level.height / total_area;
    total += uniform ? 1.0 : std::max(share, kMipFloor);
    cumulative.push_back(total);
  }
  for (double& value : cumulative) value /= total;
  return cumulative;
}

WindowSpec SpecAt(const TargetPyramid& pyramid, int mip, int x_block, int y) {
  const TargetLevel& level = pyramid.levels[mip];
  WindowSpec spec;
  spec.mip = mip;
  spec.x0 = x_block * 16;
  spec.y0 = y;
  spec.cols = WindowCols(level.width);
  spec.rows = WindowRows(level.height);
  return spec;
}

}  // namespace

double PsnrOfMse(double mse) { return mse > 0 ? std::min(99.99, -10 * std::log10(mse)) : 99.99; }

double ModelError::MipPsnr(int mip) const {
  double sum = 0;
  for (const double mse : mip_mse[mip]) sum += mse;
  return PsnrOfMse(sum / static_cast<double>(mip_mse[mip].size()));
}

double ModelError::MeanMipsPsnr() const {
  double sum = 0;
  for (size_t mip = 0; mip < mip_mse.size(); ++mip) sum += MipPsnr(static_cast<int>(mip));
  return sum / static_cast<double>(mip_mse.size());
}

Trainer::Trainer(const MaterialReference& reference, const ModelShape& shape, FeatureStore* store, Network* network,
                 const MaterialKernels& kernels, ThreadPool& pool, uint64_t seed, const WindowDraw& draw,
                 int windows_per_step)
    : reference_(reference),
      shape_(shape),
      store_(store),
      network_(network),
      kernels_(kernels),
      pool_(pool),
      rng_(seed, 1),
      draw_(draw),
      mip_cumulative_(CumulativeMipShares(reference.pyramid, draw.uniform_scale)),
      slots_(windows_per_step),
      next_slots_(windows_per_step),
      gradient_(network->parameter_count()) {
  channel_weight_ = ChannelWeights(reference);
  for (const TargetChannel& channel : reference.channels) {
    if (channel.learned_index < 0) continue;
    const double peak = static_cast<double>(CodedPeak(channel));
    error_weight_.push_back(1 / (peak * peak));
  }
  state_bytes_ = sizeof(float) * static_cast<size_t>(network->parameter_count());
  for (const auto& texture : store->textures) {
    for (const FeatureLevel& level : texture) {
      if (level.moments.size() == 0) continue;
      features_learn_ = true;
      state_bytes_ += sizeof(float) * level.params.size();
    }
  }
  for (int k = 0; k < pool.threads(); ++k) scratch_.push_back(std::make_unique<WindowScratch>());
  for (Slot& slot : next_slots_) {
    slot.spec = Draw();
    PlanWindow(reference_.pyramid, shape_, store_, slot.spec, &slot.plan);
  }
}

WindowSpec Trainer::Draw() {
  const float pick = rng_.Uniform();
  int mip = 0;
  while (mip + 1 < static_cast<int>(mip_cumulative_.size()) && pick >= mip_cumulative_[mip]) ++mip;
  const TargetLevel& level = reference_.pyramid.levels[mip];
  // Rows in steps of 8: the finest features then see whole blocks.
  const int x_block = static_cast<int>(rng_.Below(static_cast<uint32_t>((level.width + 15) / 16)));
  const int y = level.height > kWindowSide ? static_cast<int>(rng_.Below(static_cast<uint32_t>((level.height + 7) / 8))) * 8 : 0;
  WindowSpec spec = SpecAt(reference_.pyramid, mip, x_block, y);
  if (rng_.Uniform() < draw_.off_grid_share) {
    spec.phase_x = rng_.Uniform();
    spec.phase_y = rng_.Uniform();
    spec.fraction = rng_.Uniform();
    if (mip + 1 == static_cast<int>(reference_.pyramid.levels.size())) spec.fraction = 0;
  }
  return spec;
}

WindowTask Trainer::MakeTask(const WindowPlan& plan) const {
  WindowTask task;
  task.plan = &plan;
  task.network = network_->raw();
  task.outputs = network_->outputs();
  task.form = store_->form;
  task.channel_weight = channel_weight_.data();
  return task;
}

// Windows that touch a common block may not run together. One that does is drawn again a few times, then starts a group.
void Trainer::PlanGroups() {
  groups_.clear();
  int begin = 0;
  for (int k = 0; k < static_cast<int>(slots_.size()); ++k) {
    bool free = false;
    for (int attempt = 0; attempt < kPlacementTries && !free; ++attempt) {
      free = true;
      for (int other = begin; other < k && free; ++other) free = !WindowsConflict(slots_[other].plan, slots_[k].plan);
      if (free || attempt + 1 == kPlacementTries) break;
      slots_[k].spec = Draw();
      PlanWindow(reference_.pyramid, shape_, store_, slots_[k].spec, &slots_[k].plan);
    }
    if (!free) {
      groups_.emplace_back(begin, k);
      begin = k;
    }
  }
  groups_.emplace_back(begin, static_cast<int>(slots_.size()));
}

bool Trainer::Step(const AdamRates& features, const AdamRates& network, bool accumulate) {
  std::swap(slots_, next_slots_);
  PlanGroups();
  for (Slot& slot : next_slots_) slot.spec = Draw();

  const bool update = features.endpoint > 0 || features.index > 0;
  for (const auto& [begin, end] : groups_) {
    pool_.ParallelFor(end - begin, [&, first = begin](int k, int worker) {
      Slot& slot = slots_[first + k];
      WindowTask task = MakeTask(slot.plan);
      task.network_gradient = true;
      task.rates = features;
      task.update = !update ? FeatureUpdate::kNone : accumulate ? FeatureUpdate::kAccumulate : FeatureUpdate::kAdam;
      kernels_.run_window(task, scratch_[worker].get(), &slot.result);
      Slot& next = next_slots_[first + k];
      PlanWindow(reference_.pyramid, shape_, store_, next.spec, &next.plan);
    });
  }

  double samples = 0, error = 0;
  bool finite = true;
  std::vector<const float*> lanes;
  lanes.reserve(slots_.size());
  for (const Slot& slot : slots_) {
    finite &= slot.result.finite;
    samples += slot.result.samples;
    lanes.push_back(slot.result.gradient.sum);
    for (int c = 0; c < network_->outputs(); ++c) {
      running_error_ += slot.result.squared_error[c];
      error += channel_weight_[c] * slot.result.squared_error[c];
    }
  }
  step_error_ = error / samples;
  // Weighted errors are in units of a channel's range: whatever is a thousand ranges off has run away, and would end in
  // weights that halves cannot hold.
  constexpr double kRunAway = 1e6;
  finite &= step_error_ < kRunAway * network_->outputs();
  running_samples_ += samples;
  samples_ += samples;
  if (finite) {
    kernels_.fold_gradient(lanes.data(), static_cast<int>(lanes.size()), network_->parameter_count(), gradient_.data());
    finite = network_->Step(kernels_, gradient_, network);
  }
  if (accumulate && update) {
    for (auto& texture : store_->textures) {
      for (FeatureLevel& level : texture) {
        constexpr int kPiece = 1024;
        std::atomic<bool> applied{true};
        pool_.ParallelFor((level.block_count() + kPiece - 1) / kPiece, [&](int piece, int) {
          const int first = piece * kPiece;
          const int count = std::min(kPiece, level.block_count() - first);
          if (!kernels_.apply_gradient(&level, store_->form, first, count, features)) applied.store(false, std::memory_order_relaxed);
        });
        finite &= applied.load();
      }
    }
  }
  return finite;
}

void Trainer::Save() {
  network_->Save();
  if (features_learn_) saved_features_.Save(*store_, pool_);
}

void Trainer::Rollback() {
  network_->Restore();
  if (features_learn_) saved_features_.Restore(store_);
  running_error_ = running_samples_ = 0;
}

double Trainer::TakeRunningError() {
  const double error = running_samples_ > 0 ? running_error_ / running_samples_ / network_->outputs() : 0;
  running_error_ = running_samples_ = 0;
  return error;
}

void Trainer::SumErrors(FeatureStore* store, const float* network, const WindowSpec& spec, int worker, double* sums) {
  WindowPlan plan;
  PlanWindow(reference_.pyramid, shape_, store, spec, &plan);
  WindowTask task = MakeTask(plan);
  task.network = network;
  task.form = store->form;
  const auto result = std::make_unique<WindowResult>();
  kernels_.run_window(task, scratch_[worker].get(), result.get());
  for (int c = 0; c < task.outputs; ++c) sums[c] = result->squared_error[c];
  sums[task.outputs] = result->samples;
}

std::vector<double> Trainer::MipMse(FeatureStore* store, const float* network, int mip) {
  const TargetLevel& level = reference_.pyramid.levels[mip];
  const int outputs = network_->outputs();
  // Windows tile the mip; the last of a row or column is smaller, so that each texel counts once (but for the repeats that fill
  // up a vector).
  std::vector<WindowSpec> specs;
  for (int y = 0; y < level.height; y += kWindowSide) {
    for (int x = 0; x < level.width; x += kWindowSide) {
      WindowSpec spec = SpecAt(reference_.pyramid, mip, x / 16, y);
      spec.rows = std::min(kWindowSide, level.height - y);
      spec.cols = std::min(kWindowSide, (level.width - x + 15) / 16 * 16);
      specs.push_back(spec);
    }
  }
  std::vector<double> sums(specs.size() * (outputs + 1));
  pool_.ParallelFor(static_cast<int>(specs.size()), [&](int k, int worker) {
    SumErrors(store, network, specs[k], worker, &sums[static_cast<size_t>(k) * (outputs + 1)]);
  });
  std::vector<double> mean(outputs);
  double samples = 0;
  for (size_t k = 0; k < specs.size(); ++k) {
    for (int c = 0; c < outputs; ++c) mean[c] += sums[k * (outputs + 1) + c];
    samples += sums[k * (outputs + 1) + outputs];
  }
  for (double& value : mean) value /= samples;
  return mean;
}

double Trainer::MipError(int mip) {
  const std::vector<double> mse = MipMse(store_, network_->raw(), mip);
  double sum = 0;
  for (size_t c = 0; c < mse.size(); ++c) sum += channel_weight_[c] * mse[c];
  return sum;
}

ModelError Trainer::Evaluate(FeatureStore* store, const float* network, int off_grid_windows) {
  const int outputs = network_->outputs();
  const int mips = static_cast<int>(reference_.pyramid.levels.size());
  ModelError error;
  for (int mip = 0; mip < mips; ++mip) {
    error.mip_mse.push_back(MipMse(store, network, mip));
    for (int c = 0; c < outputs; ++c) error.mip_mse.back()[c] *= error_weight_[c];
  }
  if (off_grid_windows == 0) return error;

  // Its own stream: asking does not change the training.
  Rng rng(12345, 7);
  std::vector<WindowSpec> specs;
  for (int k = 0; k < off_grid_windows; ++k) {
    const int mip = std::min<int>(static_cast<int>(rng.Below(4)), mips - 1);
    const TargetLevel& level = reference_.pyramid.levels[mip];
    WindowSpec spec = SpecAt(reference_.pyramid, mip, static_cast<int>(rng.Below(static_cast<uint32_t>((level.width + 15) / 16))),
                             static_cast<int>(rng.Below(static_cast<uint32_t>(level.height))));
    spec.phase_x = rng.Uniform();
    spec.phase_y = rng.Uniform();
    spec.fraction = mip + 1 < mips ? rng.Uniform() : 0;
    specs.push_back(spec);
  }
  std::vector<double> sums(specs.size() * (outputs + 1));
  pool_.ParallelFor(static_cast<int>(specs.size()), [&](int k, int worker) {
    SumErrors(store, network, specs[k], worker, &sums[static_cast<size_t>(k) * (outputs + 1)]);
  });
  double total = 0, samples = 0;
  for (size_t k = 0; k < specs.size(); ++k) {
    for (int c = 0; c < outputs; ++c) total += error_weight_[c] * sums[k * (outputs + 1) + c];
    samples += sums[k * (outputs + 1) + outputs];
  }
  error.off_grid_mse = total / samples / outputs;
  return error;
}

void Trainer::Sensitivity(int texture, int level_index, AlignedBuffer<float>* planes) {
  const FeatureLevel& level = store_->textures[texture][level_index];
  planes->Reset(static_cast<size_t>(9) * level.width * level.height);
  const SensitivityPlanes out{planes->data(), level.width, level.height};

  for (int mip = 0; mip < static_cast<int>(reference_.pyramid.levels.size()); ++mip) {
    const int lod = std::clamp(mip - shape_[texture].lod_shift, 0, shape_[texture].levels - 1);
    if (lod != level_index) continue;
    const TargetLevel& target = reference_.pyramid.levels[mip];
    // Bands of windows write to overlapping texels only with their neighbours: first the even bands, then the odd ones, and
    // a last band that would wrap onto an even first one by itself.
    const int bands = (target.height + kWindowSide - 1) / kWindowSide;
    const auto run_band = [&](int band, int worker) {
      for (int x = 0; x < target.width; x += kWindowSide) {
        WindowSpec spec = SpecAt(reference_.pyramid, mip, x / 16, band * kWindowSide);
        spec.rows = std::min(kWindowSide, target.height - band * kWindowSide);
        spec.cols = std::min(kWindowSide, (target.width - x + 15) / 16 * 16);
        WindowPlan plan;
        PlanWindow(reference_.pyramid, shape_, store_, spec, &plan);
        kernels_.sensitivity(MakeTask(plan), texture, scratch_[worker].get(), out);
      }
    };
    // A band of 64 rows must be at least two texels of this level, or even bands would meet.
    const bool separate = static_cast<int64_t>(kWindowSide) * level.height >= int64_t{4} * target.height && bands >= 4;
    if (!separate) {
      for (int band = 0; band < bands; ++band) run_band(band, 0);
      continue;
    }
    const int paired = bands / 2 * 2;
    pool_.ParallelFor(paired / 2, [&](int k, int worker) { run_band(2 * k, worker); });
    pool_.ParallelFor(paired / 2, [&](int k, int worker) { run_band(2 * k + 1, worker); });
    if (bands % 2 != 0) run_band(bands - 1, 0);
  }
}

}  // namespace patina
