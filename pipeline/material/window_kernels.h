// The SIMD work on one window: features -> inputs -> network -> loss, and back. Two targets, the same bits.
//
// One call does a whole window, so dispatch costs nothing. Scratch is owned by one worker; nothing is allocated.
#pragma once

#include <cstdint>

#include "pipeline/kernels/dispatch.h"
#include "pipeline/material/window.h"
#include "pipeline/nn/mlp.h"

namespace patina {

// Adam with bias correction by the number of updates that a block (or the network) has had (Kingma, Ba 2014).
struct AdamRates {
  float endpoint = 0;  // step in binades (linear units for free texels)
  float index = 0;
  float beta1 = 0.9f;
  float beta2 = 0.999f;
  float epsilon = 1e-8f;
};

// What becomes of feature gradients.
enum class FeatureUpdate {
  kNone,        // features are constant; no input gradients are computed
  kAdam,        // applied at once to the blocks that the window owns
  kAccumulate   // added to FeatureLevel::gradient of every block that the window owns
};

struct WindowTask {
  const WindowPlan* plan = nullptr;
  const float* network = nullptr;   // parameters, mlp.h order
  int outputs = 0;
  BlockForm form = BlockForm::kSegments;
  const float* channel_weight = nullptr;  // [outputs] of the squared error in the loss
  FeatureUpdate update = FeatureUpdate::kNone;
  bool network_gradient = false;
  AdamRates rates;
};

// What a window leaves behind, besides updated features.
struct alignas(64) WindowResult {
  float squared_error[mlp::kMaxOutputs];  // summed over the window's samples, unweighted
  int samples = 0;
  bool finite = true;  // false: an error, or a feature or a moment once updated, is not: the step has to be undone
  mlp::GradientLanes gradient;            // by the network's parameters; loss = sum weight * error^2 / 2
};

// Working memory of one worker; about 1.6 MB, of which an ordinary window touches a third.
struct alignas(64) WindowScratch {
  static constexpr int kTilePitch = 80;  // kMaxExtent + 8, whole vectors
  static constexpr int kTileRows = kMaxExtent + 8;
  static constexpr int kPlanes = 9;      // feature gradients use 3, the sensitivity pass 9
  mlp::Chunk chunk;
  float tile[3 * kTileRows * kTilePitch + 64];
  float rows[2 * kFeatureTextures][3 * kMaxExtent * kWindowSide];  // interpolated along x
  float input_gradient[kWindowSide * kWindowSide / mlp::kChunkSamples][mlp::kInputs * mlp::kChunkSamples];
  float column[kMaxExtent + 13][kWindowSide];
  float turned[kWindowSide][kTilePitch];
  float scattered[kTilePitch][kTilePitch];
  float gradient_tile[kPlanes * kTileRows * kTilePitch];
  float folded_tile[kPlanes * kTileRows * kTilePitch];
  float target[kWindowSide * kWindowSide * mlp::kMaxOutputs];      // filtered reference [row][block][channel][16]
  float filter_line[kWindowSide * 2 + 64];
  float filter_rows[kWindowSide + 4][mlp::kMaxOutputs * kWindowSide];
  float jacobian_products[mlp::kHidden * mlp::kMaxOutputs * 3];
  float sensitivity[kWindowSide * kWindowSide / mlp::kChunkSamples][kPlanes * mlp::kChunkSamples];
};

// Sums over samples, for every texel of one level: gradient J^T r (3) and Gauss-Newton diagonal J^T J (6: xx xy xz yy yz
// zz), J the derivative of the weighted outputs by the texture's three inputs; linear (not squared) tap weights, which
// majorises the true diagonal. Planes [9][height][width].
struct SensitivityPlanes {
  float* planes = nullptr;
  int width = 0;
  int height = 0;
};

struct MaterialKernels {
  // Forward, loss, and as the task says backward and update.
  void (*run_window)(const WindowTask& task, WindowScratch* scratch, WindowResult* result) noexcept;
  // Forward on texel centres, then adds texture `texture`'s sums to `out` (the plane set of the one level that the
  // window's plan has for it). Not thread-safe for windows whose taps meet.
  void (*sensitivity)(const WindowTask& task, int texture, WindowScratch* scratch, const SensitivityPlanes& out) noexcept;
  // The filtered target of a window: [row][cols/16][channels][16], coded values. For tests and previews.
  void (*filter_target)(const WindowPlan& plan, WindowScratch* scratch, float* out) noexcept;
  // One Adam step on `count` blocks from FeatureLevel::gradient, which is cleared; blocks with no gradient are skipped.
  // Returns false if a gradient, or a parameter or moment afterwards, is not finite.
  bool (*apply_gradient)(FeatureLevel* level, BlockForm form, int first_block, int count, const AdamRates& rates) noexcept;
  // Adam on a flat array of network parameters: rates.endpoint is the step, `updates` counts from 1.
  // Returns false if a parameter or moment is not finite afterwards.
  bool (*adam_flat)(float* params, const float* gradient, float* moment1, float* moment2, int count, int updates,
                    const AdamRates& rates) noexcept;
  // The network alone on one chunk, for tests and the benchmark: forward; forward and backward.
  void (*mlp_forward)(const float* network, int outputs, mlp::Chunk* chunk) noexcept;
  void (*mlp_backward)(const float* network, int outputs, mlp::Chunk* chunk, float* lanes) noexcept;
  // out[k] = lanes summed over windows in order, then over the 16 lanes by the fixed tree. lanes: [windows] -> [count][16].
  void (*fold_gradient)(const float* const* lanes, int windows, int count, float* out) noexcept;
};

const MaterialKernels& KernelsFor(SimdTarget target);

}  // namespace patina
