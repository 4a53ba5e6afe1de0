// Trains the neural material of a reference and returns it as legal BC6H blocks and half-representable weights.
//
// Based on: Weinreich, de Oliveira, Houdard, Nader 2024, "Real-Time Neural Materials using Block-Compressed Features".
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bc6h.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/rate_guard.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/material/target_pyramid.h"

namespace patina {

inline constexpr int kFeatureTextures = 4;
inline constexpr int kNetworkInputs = 12;  // 4 textures x RGB
inline constexpr int kNetworkHidden = 16;
inline constexpr int kMaxOutputs = 64;

enum class Profile { kBcf05k, kBcf1k, kBcf2k, kBcf2kPlus };  // "bcf-0.5k", "bcf-1k", "bcf-2k", "bcf-2k++"
enum class Quality { kPreview, kStandard, kReference };       // "preview", "standard", "reference"
enum class Recipe { kPatina, kPaper };                        // "patina", "paper"
const char* ProfileName(Profile profile);
const char* QualityName(Quality quality);
const char* RecipeName(Recipe recipe);
Result<Profile> ParseProfile(const std::string& name);
Result<Quality> ParseQuality(const std::string& name);
Result<Recipe> ParseRecipe(const std::string& name);

// Raised whenever the same input, job and seed would give other bytes. Part of the fingerprint.
inline constexpr int kRecipeVersion = 3;

// One feature texture. Level l is max(1, width >> l) x max(1, height >> l) texels.
struct FeatureShape {
  int lod_shift = 0;  // level 0 is the source's size shifted right by this; sampled at level s - lod_shift
  int width = 0;
  int height = 0;
  int levels = 0;
};
using ModelShape = std::array<FeatureShape, kFeatureTextures>;

// Shapes for a source of width x height (each 1..65536).
ModelShape ShapeForProfile(Profile profile, int width, int height);

struct TrainOptions {
  Recipe recipe = Recipe::kPatina;
  Quality quality = Quality::kStandard;
  uint64_t seed = 1;
  double time_budget_s = 0;     // 0: none. Leaves room to export, verify and report within it; not reproducible to the byte
  double target_psnr_db = 0;    // 0: none. Stops once the held-out PSNR of mip 0 is there ...
  double target_margin_db = 0.1;  // ... and so much above: what the export is expected to lose
  bool give_up = false;         // ends without a model (stopped_by "hopeless") once the target is out of reach: see GainToCome
  double samples = 0;           // 0: by quality and size. Otherwise train with exactly this many (rounded up to a step)
  const CancelToken* cancel = nullptr;
  RateFault rate_fault;         // for tests
};

// Quality along the way, on texel centres that the estimate visits at a fixed stride; deterministic but for the seconds.
struct CurvePoint {
  double samples = 0;
  double wall_s = 0;
  double cpu_s = 0;
  double psnr_mip0_db = 0;       // learned channels, coded values
  double psnr_mean_mips_db = 0;  // mean over mips of the per-mip PSNR
  std::vector<double> psnr_channels_db;  // [learned channel], of mip 0
};

struct TrainedMaterial {
  ModelShape shape;
  int outputs = 0;  // learned channels
  // blocks[texture][level]: row-major, ceil(w/4) x ceil(h/4), UF16.
  std::array<std::vector<std::vector<bc6h::Block>>, kFeatureTextures> blocks;
  // Row-major weights that are exact in half precision: w1 [16][12], b1 [16], w2 [outputs][16], b2 [outputs]. Outputs are
  // coded values: the normalisation of the training is folded in.
  std::vector<float> w1, b1, w2, b2;
  double samples = 0;
  std::string stopped_by;  // "budget", "slope", "target", "time"; "hopeless": there are no blocks and no weights
  std::vector<CurvePoint> curve;
  // The trainer's own float model (before BC6H and half rounding) and the exported one (exact decode of the blocks, half
  // weights) by one measure: learned channels, unclamped coded values; all texel centres, and 64 windows of samples at random
  // (u, v, s) against the bicubic reference. Their difference is what the export costs.
  double float_psnr_mip0_db = 0;
  double float_psnr_mean_mips_db = 0;
  double float_psnr_off_grid_db = 0;
  double exported_psnr_mip0_db = 0;
  double exported_psnr_mean_mips_db = 0;
  double exported_psnr_off_grid_db = 0;
  std::vector<double> float_psnr_mips_db, exported_psnr_mips_db;  // per mip of the source
  int rollbacks = 0;  // how often training went back to an earlier state because a value was not finite
  double recording_s = 0;  // wall seconds that measuring the curve took
};

// What a training that is done to `progress` (above 0, at most 1) may still add to the PSNR of mip 0, in dB: a bound that
// nearly all materials keep. Of 72 trainings of 24 real sets one of hard-edged charts gained more at 1/8, 1/4 and 1/2
// (tests/bench/gain_to_come.py).
double GainToCome(double progress);

// The samples that the options ask for at most.
double SampleBudget(const MaterialReference& reference, const TrainOptions& options);

// Errors: kInvalidArgument (no learned channel, more than kMaxOutputs), kOutOfRange (coded values whose network does not fit
// half precision; RateGuard::kMaxRollbacks rollbacks), kCancelled, kUnsupported (CPU).
Result<TrainedMaterial> TrainMaterial(const MaterialReference& reference, const ModelShape& shape,
                                      const TrainOptions& options, ThreadPool& pool, ProgressSink& progress);

}  // namespace patina
