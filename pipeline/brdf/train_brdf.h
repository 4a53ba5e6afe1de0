// Trains a neural BRDF: index grid, codebook and network from a source to what is written.
//
// Based on: Dou 2023 ("NeuBRDF"). Differs from section 4: continuous features are trained first and
// clustered, then codes and network go on with the indices as they are. Re-assigning corners along
// the way (straight-through, every 50 steps) cost 7 % of the image error where it was tried, on one
// NP-decoded MERL table (green-acrylic), and used fewer codes. The model has three scalar inputs
// and a canonical order of the directions, both of which can be left out.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"
#include "formats/index_pack.h"
#include "formats/weights.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/rate_guard.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/sample_pool.h"

namespace patina::brdf {

struct ModelShape {
  GridShape grid;
  int primitive_size = 16;  // k
  int index_bits = 9;       // b
  int hidden = 32;
  int hidden_layers = 3;
};

// Errors: kInvalidArgument (out of range).
Status CheckShape(const ModelShape& shape);

// What of a source decides the shape of its model.
struct SourceKind {
  bool isotropic = true;
  bool list = false;       // some hundred measurements instead of a table
  bool simulated = false;  // a table whose values cost time and have noise
};
SourceKind KindOf(const Source& source);

// The default model. Anisotropic materials get the half vector's place as a further input and a
// larger network; lists a grid that is coarse enough for every corner to be supervised.
ModelShape DefaultShape(const SourceKind& kind);

// The paper's plain model, whatever the source: Nside 64, 9 bits, two hidden layers of 64, neither
// scalar inputs nor canonical order.
ModelShape PaperShape(const SourceKind& kind);

// How corners come to their codes.
enum class IndexTraining {
  // Continuous features first, then k-means; codes and network go on with the indices as they are.
  kClusters,
  // The paper's (section 4): codes at random and a softmax over logits, straight-through, from the
  // first step on.
  kSoftmax,
  // k-means, then straight-through from the distances to the codes.
  kClustersThenSoftmax
};

struct TrainOptions {
  uint64_t seed = 1;
  size_t pool = size_t{1} << 20;
  double half_angle_share = 0.5;
  int batch = 512;
  int free_steps = 6000;      // with continuous features; kSoftmax: more of the others
  int codebook_steps = 6000;  // with codes
  float feature_rate = 0.02f;
  float network_rate = 0.006f;
  IndexTraining index_training = IndexTraining::kClusters;
  // How far features are drawn to the nearest code, sixteen times in the last two thirds of the
  // free steps, rising to this share of the way: 0 none, 1 all of it.
  float pull = 1;
  // Of the two ways with a softmax. The paper's 0.01 learns more slowly here: SSIM .89 against .97
  // on one NP-decoded MERL table (alum-bronze, plain model).
  float logit_rate = 0.05f;
  float codebook_rate = 0.01f;  // of the codes
  float codebook_network_rate = 0.003f;
  // Of features, codes and weights, per step and rate (AdamW). Keeps what the data leaves open
  // small, and with it the speckle of neighbouring corners. More costs narrow peaks their height:
  // 0.1 adds a quarter to the error of glossy tables.
  float decay = 0.02f;
  const CancelToken* cancel = nullptr;
  RateFault rate_fault;  // for tests
};

// The default training. Lists get a strong decay, which makes them smooth between measurements.
TrainOptions DefaultTraining(const SourceKind& kind);

// The training of the plain model: it needs large features, and decay costs its codes most of what
// they know.
TrainOptions PaperTraining();

struct CurvePoint {
  double samples = 0;
  double wall_s = 0;
  double cpu_s = 0;
  // Mean |log1p(f) - log1p(f*)| of held-out samples, cosine-weighted f; of lists, which are too
  // short to hold some back, of the measurements themselves.
  double log1p_mae = 0;
};

struct TrainedBrdf {
  ModelShape shape;
  IndexPack pack;        // codebook inline; features as the codebook holds them
  WeightBuffer network;  // layer{n}.weight [out][in], layer{n}.bias [out]
  std::vector<CurvePoint> curve;
  double samples = 0;
  double used_codes = 0;  // perplexity
  double free_loss = 0;   // held-out, of the continuous features before they became codes
  double final_loss = 0;
  double recording_s = 0;  // wall seconds that measuring the curve took
  int rollbacks = 0;       // how often training went back because a value was not finite
};

// Errors: kInvalidArgument (a shape out of range), kCorruptData (no valid data), kCancelled,
// kOutOfRange (weights or codes beyond halves; RateGuard::kMaxRollbacks rollbacks), kUnsupported
// (CPU).
Result<TrainedBrdf> TrainBrdf(const Source& source, const ModelShape& shape,
                              const TrainOptions& options, ThreadPool& pool,
                              ProgressSink& progress);

// Trains several materials of one kind on one codebook and one network, each with a grid of its
// own: NeuBRDF, section 3.3. The results stand in the order of the sources; their codebooks and
// networks are equal, and losses and the curve are those of all together. m materials get
// (m + 1) / 2 times the steps of one.
Result<std::vector<TrainedBrdf>> TrainShared(std::span<const Source* const> sources,
                                             const ModelShape& shape, const TrainOptions& options,
                                             ThreadPool& pool, ProgressSink& progress);

}  // namespace patina::brdf
