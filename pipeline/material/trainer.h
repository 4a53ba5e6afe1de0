// The training loop: windows drawn by mip, run in parallel where they do not touch, one network step every few windows.
//
// The result depends on the seed alone: which windows run together is planned without regard to the number of threads,
// windows of a group share no feature block, and the network's gradient is summed in window order.
#pragma once

#include <memory>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/base/rng.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/material/network.h"
#include "pipeline/material/train.h"
#include "pipeline/material/window_kernels.h"

namespace patina {

// Windows between two network steps. More keep threads from waiting for each other, fewer give small sources enough steps.
inline int WindowsPerStep(int width, int height) { return static_cast<double>(width) * height >= 2e6 ? 8 : 4; }

// How windows are drawn.
struct WindowDraw {
  bool uniform_scale = false;   // every s equally likely (the paper); else mips by area with a floor
  float off_grid_share = 0.15f; // of windows at continuous (u, v, s); 1 for the paper
};

// Squared errors on texel centres, [mip][learned channel], as means, with CodedPeak as 1; and off the grid.
struct ModelError {
  std::vector<std::vector<double>> mip_mse;  // [mip][channel]
  double off_grid_mse = 0;                   // mean over channels, random (u, v, s); 0 if not asked for
  double MipPsnr(int mip) const;             // all learned channels
  double MeanMipsPsnr() const;
};

// PSNR of values in [0, 1]; capped at 99.99.
double PsnrOfMse(double mse);

class Trainer {
 public:
  // All references must outlive the trainer. windows_per_step: windows between two network steps.
  Trainer(const MaterialReference& reference, const ModelShape& shape, FeatureStore* store, Network* network,
          const MaterialKernels& kernels, ThreadPool& pool, uint64_t seed, const WindowDraw& draw, int windows_per_step);

  // One step: the windows, their feature updates (features.endpoint 0 and index 0: features stay), one network update.
  // accumulate: feature gradients are summed over the step's windows and applied once at its end.
  // Returns false when a loss, gradient, moment or parameter is not finite or the loss has run away: the state is then of no
  // use and has to be rolled back.
  bool Step(const AdamRates& features, const AdamRates& network, bool accumulate);

  // Save keeps features (where they learn) and network for Rollback, which also forgets the optimiser's state of the features.
  // The constructor saves nothing; whatever else changes features or network has to save anew.
  void Save();
  void Rollback();
  size_t state_bytes() const { return state_bytes_; }  // of what Save copies

  double samples() const { return samples_; }
  // Weighted squared error of the last step's windows, mean over samples, channels summed.
  double step_error() const { return step_error_; }
  // Mean squared error of the windows since the last call, averaged over channels and samples as drawn.
  double TakeRunningError();

  // Forward over all texel centres of all mips (and off_grid_windows random windows, the same on every call).
  ModelError Evaluate(FeatureStore* store, const float* network, int off_grid_windows);
  // Weighted squared error of the current model on one mip's texel centres, [channel] means summed.
  double MipError(int mip);

  // For all texels of one level of one texture: nine sums, see SensitivityPlanes. planes: [9][height][width], overwritten.
  void Sensitivity(int texture, int level, AlignedBuffer<float>* planes);

  const std::vector<float>& channel_weight() const { return channel_weight_; }

 private:
  struct Slot {
    WindowSpec spec;
    WindowPlan plan;
    WindowResult result;
  };

  WindowSpec Draw();
  std::vector<double> MipMse(FeatureStore* store, const float* network, int mip);
  // Squared errors of one window, [channel], then its number of samples.
  void SumErrors(FeatureStore* store, const float* network, const WindowSpec& spec, int worker, double* sums);
  void PlanGroups();
  WindowTask MakeTask(const WindowPlan& plan) const;

  const MaterialReference& reference_;
  const ModelShape& shape_;
  FeatureStore* store_;
  Network* network_;
  const MaterialKernels& kernels_;
  ThreadPool& pool_;
  Rng rng_;
  WindowDraw draw_;
  std::vector<double> mip_cumulative_;
  std::vector<float> channel_weight_;
  std::vector<double> error_weight_;  // [channel]: 1 / CodedPeak^2, of the errors that are reported
  std::vector<std::unique_ptr<WindowScratch>> scratch_;
  std::vector<Slot> slots_;       // this step's windows
  std::vector<Slot> next_slots_;  // planned while this step runs
  std::vector<std::pair<int, int>> groups_;  // [first, last) of slots_
  std::vector<float> gradient_;
  FeatureSnapshot saved_features_;
  size_t state_bytes_ = 0;
  bool features_learn_ = false;
  double step_error_ = 0;
  double samples_ = 0;
  double running_error_ = 0, running_samples_ = 0;
};

}  // namespace patina
