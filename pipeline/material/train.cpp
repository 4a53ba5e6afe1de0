#include "pipeline/material/train.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <numbers>

#include "pipeline/base/cpu_time.h"
#include "pipeline/material/channel_stats.h"
#include "pipeline/material/exporter.h"
#include "pipeline/material/feature_init.h"
#include "pipeline/material/quality_trend.h"
#include "pipeline/material/time_reserve.h"
#include "pipeline/material/trainer.h"

namespace patina {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

// Training effort in samples a texel of the whole pyramid. Quality still grows with the logarithm beyond: see the README.
double SamplesPerTexel(Quality quality) {
  switch (quality) {
    case Quality::kPreview: return 6;
    case Quality::kStandard: return 96;
    case Quality::kReference: return 1200;
  }
  return 96;
}

// Small sources train fast anyway, and their network needs steps to settle.
constexpr double kMinSamples = 4e6;

constexpr float kEndpointRate = 0.08f;  // binades
constexpr float kIndexRate = 0.08f;
constexpr float kNetworkRate = 3e-3f;
constexpr double kWarmUp = 0.02;
constexpr int kPolishRounds = 4, kQuickPolishRounds = 2;
constexpr double kTuneRate = 3e-5;
constexpr double kTuneShare = 0.02;     // of the samples, for the network after the features are frozen
// Re-encodes during the training, as shares of it: later training then starts from legal blocks.
constexpr double kReencodeAt[] = {0.6, 0.85};

double CosineRate(double progress) {
  const double warm = std::min(1.0, progress / kWarmUp);
  return warm * 0.5 * (1 + std::cos(std::numbers::pi * std::min(1.0, progress)));
}

// How far the training is and how long it still goes. Without limits it is a plain count of samples; a time budget makes
// progress follow the clock, a reached target or a flat slope brings the end near.
class Schedule {
 public:
  Schedule(const TrainOptions& options, double budget) : options_(options), end_(budget) {}

  // What follows the training, as it is now expected to take.
  void Reserve(double reserve_s) {
    if (options_.time_budget_s > 0) train_s_ = std::max(0.2 * options_.time_budget_s, options_.time_budget_s - reserve_s);
  }

  double Progress(double samples, double elapsed_s) {
    const double by_samples = samples / end_;
    const double by_time = train_s_ > 0 ? elapsed_s / train_s_ : 0;
    progress_ = std::max(by_samples, by_time);
    // Where both end together the budget of samples was spent, whoever led on the way.
    if (progress_ >= 1 && !ending_ && by_samples < 0.98) stopped_by_ = "time";
    return progress_;
  }

  // At checkpoints: the quality so far. Ends early with what is left of the falling rates.
  void Observe(double samples, double psnr_mip0_db) {
    if (ending_) return;
    outlook_db_ = psnr_mip0_db + GainToCome(std::clamp(progress_, 1e-3, 1.0));
    if (options_.target_psnr_db > 0 && psnr_mip0_db >= options_.target_psnr_db + options_.target_margin_db) {
      End(samples, "target");
    } else if (options_.quality == Quality::kReference && options_.samples == 0 && last_samples_ > 0) {
      const double doublings = std::log2(samples / last_samples_);
      if (doublings > 0.4 && (psnr_mip0_db - last_psnr_db_) / doublings < kFlatDb) End(samples, "slope");
    }
    last_samples_ = samples;
    last_psnr_db_ = psnr_mip0_db;
  }

  // What the training may reach at best; below the target it is out of reach.
  double outlook_db() const { return outlook_db_; }
  bool hopeless() const { return !ending_ && outlook_db_ < options_.target_psnr_db; }

  const char* stopped_by() const { return stopped_by_; }

 private:
  // Gain of mip 0 in dB for twice the samples below which more of them do not pay.
  static constexpr double kFlatDb = 0.03;
  static constexpr double kEndingFrom = 0.8;  // the last fifth of the cosine: where most of the noise settles

  void End(double samples, const char* why) {
    ending_ = true;
    end_ = std::min(end_, samples / kEndingFrom);
    stopped_by_ = why;
  }

  const TrainOptions& options_;
  double end_;
  double train_s_ = 0;
  double progress_ = 0;
  double outlook_db_ = 1e9;
  bool ending_ = false;
  double last_samples_ = 0, last_psnr_db_ = 0;
  const char* stopped_by_ = "budget";
};

AdamRates FeatureRates(double factor) {
  AdamRates rates;
  rates.endpoint = static_cast<float>(kEndpointRate * factor);
  rates.index = static_cast<float>(kIndexRate * factor);
  rates.beta1 = 0.8f;
  rates.beta2 = 0.99f;
  rates.epsilon = 1e-7f;
  return rates;
}

AdamRates NetworkRates(double rate) {
  AdamRates rates;
  rates.endpoint = static_cast<float>(rate);
  rates.beta1 = 0.9f;
  rates.beta2 = 0.99f;
  rates.epsilon = 1e-8f;
  return rates;
}

// What both recipes share: the clock, the curve, progress, cancelling, rolling back.
class Session {
 public:
  Session(const TrainOptions& options, ProgressSink& progress, TrainedMaterial* result)
      : options_(options), progress_(progress), result_(result), start_(Clock::now()), start_cpu_(ProcessCpuSeconds()) {}

  bool cancelled() const { return options_.cancel && options_.cancel->cancelled(); }
  double seconds() const { return SecondsSince(start_); }

  // Reports at most a few times a second.
  void Report(Trainer* trainer, double fraction) {
    if (SecondsSince(last_report_) < 0.2) return;
    last_report_ = Clock::now();
    ProgressEvent event;
    event.stage = "train";
    event.samples = trainer->samples();
    event.fraction = std::min(1.0, fraction);
    event.elapsed_s = seconds();
    event.samples_per_s = event.samples / std::max(1e-3, event.elapsed_s);
    event.eta_s = event.fraction > 0.01 ? event.elapsed_s * (1 - event.fraction) / event.fraction : -1;
    event.psnr_db = PsnrOfMse(trainer->TakeRunningError());
    trend_.Add(event.elapsed_s, event.psnr_db);
    event.gain_10s_db = trend_.GainWithin(std::min(10.0, event.eta_s > 0 ? event.eta_s : 10.0));
    progress_.OnProgress(event);
  }

  // Once, and early: the training goes on.
  void SayHopeless(double progress, double outlook_db) {
    if (said_hopeless_) return;
    said_hopeless_ = true;
    char text[240];
    std::snprintf(text, sizeof text,
                  "the target is out of reach: after %.0f %% of the training at most %.1f dB can be expected of the %.1f dB it "
                  "takes; it goes on to the best there is; needed: a larger --profile, a higher --quality, more time, or a "
                  "lower target",
                  100 * progress, outlook_db, options_.target_psnr_db);
    progress_.OnWarning(text);
  }

  double Record(Trainer* trainer, FeatureStore* store, const float* network) {
    const Clock::time_point begin = Clock::now();
    const ModelError error = trainer->Evaluate(store, network, 0);
    CurvePoint point;
    point.samples = trainer->samples();
    point.wall_s = seconds();
    point.cpu_s = ProcessCpuSeconds() - start_cpu_;
    point.psnr_mip0_db = error.MipPsnr(0);
    point.psnr_mean_mips_db = error.MeanMipsPsnr();
    for (const double mse : error.mip_mse[0]) point.psnr_channels_db.push_back(PsnrOfMse(mse));
    result_->curve.push_back(point);
    result_->recording_s += SecondsSince(begin);
    return point.psnr_mip0_db;
  }

 private:
  const TrainOptions& options_;
  ProgressSink& progress_;
  TrainedMaterial* result_;
  Clock::time_point start_;
  Clock::time_point last_report_{};
  double start_cpu_;
  bool said_hopeless_ = false;
  QualityTrend trend_;
};

// One step under guard; the trainer's state must have been saved once.
Status GuardedStep(Trainer* trainer, RateGuard* guard, AdamRates features, AdamRates network, bool accumulate) {
  const float factor = static_cast<float>(guard->NextFactor());
  for (float* rate : {&features.endpoint, &features.index, &network.endpoint}) *rate *= factor;
  if (trainer->Step(features, network, accumulate)) {
    if (guard->SaveIsDue(trainer->step_error(), trainer->state_bytes())) trainer->Save();
    return {};
  }
  trainer->Rollback();
  return guard->RolledBack(trainer->samples());
}

constexpr int kOffGridWindows = 64;

void KeepFloatQuality(Trainer* trainer, FeatureStore* store, const float* network, TrainedMaterial* result) {
  const ModelError error = trainer->Evaluate(store, network, kOffGridWindows);
  for (size_t mip = 0; mip < error.mip_mse.size(); ++mip) result->float_psnr_mips_db.push_back(error.MipPsnr(static_cast<int>(mip)));
  result->float_psnr_mip0_db = error.MipPsnr(0);
  result->float_psnr_mean_mips_db = error.MeanMipsPsnr();
  result->float_psnr_off_grid_db = PsnrOfMse(error.off_grid_mse);
}

// Freezes the exported features, tunes the network on exactly what a decoder sees, and rounds it to the halves that are
// written; then polishes the coarse levels for just that network; fills the result.
Status FinishNetwork(const MaterialReference& reference, const MaterialKernels& kernels, ThreadPool& pool,
                   const TrainOptions& options, const WindowDraw& draw, int windows_per_step, double tune_samples,
                   double rate, int polish_rounds, RateGuard* guard, Exporter* exporter, Network* network, TrainedMaterial* result) {
  FeatureStore decoded;
  exporter->DecodeTo(&decoded);
  Trainer tuner(reference, result->shape, &decoded, network, kernels, pool, options.seed + 1, draw, windows_per_step);
  network->RoundRawToHalf();
  ModelError error = tuner.Evaluate(&decoded, network->raw(), kOffGridWindows);
  network->Unfold();
  network->Save();
  const std::vector<float> untuned(network->normalised(), network->normalised() + network->parameter_count());
  while (tuner.samples() < tune_samples && !(options.cancel && options.cancel->cancelled())) {
    const double factor = 0.5 * (1 + std::cos(std::numbers::pi * tuner.samples() / tune_samples));
    PATINA_TRY(GuardedStep(&tuner, guard, AdamRates{.endpoint = 0, .index = 0}, NetworkRates(rate * factor), false));
  }
  result->samples += tuner.samples();
  network->RoundRawToHalf();
  const ModelError tuned = tuner.Evaluate(&decoded, network->raw(), kOffGridWindows);
  // What the mips gain together decides; a tune may favour the fine ones, which have most of the samples.
  const auto score = [](const ModelError& e) { return e.MipPsnr(0) + e.MeanMipsPsnr(); };
  if (score(tuned) > score(error)) {
    error = tuned;
  } else {
    std::copy(untuned.begin(), untuned.end(), network->normalised());
    network->Unfold();
    network->RoundRawToHalf();
  }
  if (polish_rounds > 0) {
    exporter->Polish(polish_rounds, &tuner, &decoded);
    error = tuner.Evaluate(&decoded, network->raw(), kOffGridWindows);
  }
  for (size_t mip = 0; mip < error.mip_mse.size(); ++mip) result->exported_psnr_mips_db.push_back(error.MipPsnr(static_cast<int>(mip)));
  result->exported_psnr_mip0_db = error.MipPsnr(0);
  result->exported_psnr_mean_mips_db = error.MeanMipsPsnr();
  result->exported_psnr_off_grid_db = PsnrOfMse(error.off_grid_mse);

  const int outputs = network->outputs();
  const float* raw = network->raw();
  result->w1.assign(raw + mlp::kW1, raw + mlp::kB1);
  result->b1.assign(raw + mlp::kB1, raw + mlp::kW2);
  result->w2.assign(raw + mlp::kW2, raw + mlp::OffsetB2(outputs));
  result->b2.assign(raw + mlp::OffsetB2(outputs), raw + mlp::ParameterCount(outputs));
  result->blocks = exporter->TakeBlocks();
  return {};
}

Status TrainPatina(const MaterialReference& reference, const MaterialKernels& kernels, const TrainOptions& options,
                 double budget, ThreadPool& pool, Session* session, TrainedMaterial* result) {
  const int mips = static_cast<int>(reference.pyramid.levels.size());
  const ChannelStats stats = MeasureChannels(reference, std::min(1, mips - 1), pool);
  std::vector<float> scale(stats.deviation);
  for (float& s : scale) s = std::max(s, 1e-3f);
  Network network(stats.mean, scale);
  Rng rng(options.seed);
  InitNetworkFromComponents(stats, scale, &rng, &network);
  FeatureStore store;
  store.Allocate(result->shape, BlockForm::kSegments, StoreUse::kAdam);
  InitFeaturesFromComponents(reference, result->shape, stats, pool, &store);

  const WindowDraw draw;
  const TargetLevel& base = reference.pyramid.levels[0];
  const int windows_per_step = WindowsPerStep(base.width, base.height);
  Trainer trainer(reference, result->shape, &store, &network, kernels, pool, options.seed, draw, windows_per_step);
  Exporter exporter(&trainer, result->shape, &store, pool);
  session->Record(&trainer, &store, network.raw());
  trainer.Save();
  size_t next_reencode = 0;
  // Checkpoints at twice the samples each, and more often where a target waits for them.
  const double checkpoint_growth = options.target_psnr_db > 0 || options.quality == Quality::kReference ? std::numbers::sqrt2 : 2;
  const bool quick = options.quality == Quality::kPreview;
  double next_record = quick ? 0.5 : 1.0 / 16;
  RateGuard guard(options.rate_fault);
  Schedule schedule(options, budget);
  TimeReserve reserve(reference, store, quick ? 0 : static_cast<int>(std::size(kReencodeAt)), kTuneShare * budget, pool.threads());
  while (!session->cancelled()) {
    schedule.Reserve(reserve.Seconds());
    const double progress = schedule.Progress(trainer.samples(), session->seconds());
    if (progress >= 1) break;
    const double factor = CosineRate(progress);
    const double samples = trainer.samples(), step_begin = session->seconds();
    PATINA_TRY(GuardedStep(&trainer, &guard, FeatureRates(factor), NetworkRates(kNetworkRate * factor), false));
    reserve.CountStep(trainer.samples() - samples, session->seconds() - step_begin);
    if (!quick && next_reencode < std::size(kReencodeAt) && progress >= kReencodeAt[next_reencode]) {
      ++next_reencode;
      const double begin = session->seconds();
      exporter.Encode(bc6::Effort::kFull);
      reserve.CountEncode(session->seconds() - begin);
      trainer.Save();
    }
    if (progress >= next_record) {
      schedule.Observe(trainer.samples(), session->Record(&trainer, &store, network.raw()));
      next_record *= checkpoint_growth;
      if (schedule.hopeless()) {
        if (options.give_up) {
          result->stopped_by = "hopeless";
          return {};
        }
        session->SayHopeless(progress, schedule.outlook_db());
      }
    }
    session->Report(&trainer, progress);
  }
  if (session->cancelled()) return {};
  session->Record(&trainer, &store, network.raw());
  result->stopped_by = schedule.stopped_by();
  result->samples = trainer.samples();
  KeepFloatQuality(&trainer, &store, network.raw(), result);
  exporter.Encode(quick ? bc6::Effort::kQuick : bc6::Effort::kFull);
  if (!quick) {
    exporter.Refine(0);
    exporter.Refine(1);
  }
  PATINA_TRY(FinishNetwork(reference, kernels, pool, options, draw, windows_per_step, kTuneShare * budget, kTuneRate,
                           quick ? kQuickPolishRounds : kPolishRounds, &guard, &exporter, &network, result));
  result->rollbacks = guard.rollbacks();
  return {};
}

// The recipe of Weinreich 2024, sections 5.1, 6.1: random start, free texels, then blocks; uniform s, batches of 512 x 512,
// Adam with exponentially falling rates; one 6-bit mode; at last the network alone. Iterations are those that the samples
// allow. The paper does not say in what units its endpoints and indices are: its rates of 1e-2 taken literally give 23.3 dB on a
// 1k rock, endpoints in units of their range 26.4 dB, and the rates below 27.7 dB (ours 30.9), so those stand for the paper.
// Differs from the paper: a batch is 64 windows of 64 x 64 samples at random places, each with its own s, in place of one
// jittered grid over the whole texture; blocks that a batch does not touch are not updated; and sources below 2048 x 2048 get
// smaller batches in proportion, as they would else get too few iterations from the same samples a texel; and the rates of the
// block phase fall by e^-4 in all, not the e^-20 of 200,000 iterations, and the network's starts at three times the paper's.
Status TrainPaper(const MaterialReference& reference, const MaterialKernels& kernels, const TrainOptions& options, double budget,
                  ThreadPool& pool, Session* session, TrainedMaterial* result) {
  const TargetLevel& base = reference.pyramid.levels[0];
  const int windows_per_batch = static_cast<int>(std::clamp(static_cast<double>(base.width) * base.height / 65536, 4.0, 64.0));
  constexpr double kFreeShare = 5.0 / 205, kTune = 1.0 / 205;
  constexpr double kFreeFall = 5000 * 5e-4, kBlockFall = 4;  // -ln of the total decay
  constexpr double kBlockRate = 0.1;                         // binades, and of an index
  const std::vector<float> mean(reference.pyramid.channels, 0.0f), scale(reference.pyramid.channels, 1.0f);
  Network network(mean, scale);
  Rng rng(options.seed);
  InitNetworkAtRandom(&rng, &network);
  const WindowDraw draw{.uniform_scale = true, .off_grid_share = 1.0f};
  const auto rates = [](double endpoint, double index) {
    AdamRates r;
    r.endpoint = static_cast<float>(endpoint);
    r.index = static_cast<float>(index);
    return r;
  };
  RateGuard guard(options.rate_fault);
  const auto run = [&](Trainer* trainer, double samples, double endpoint_rate, double index_rate, double network_rate, double fall) -> Status {
    trainer->Save();
    while (trainer->samples() < samples && !session->cancelled()) {
      const double factor = std::exp(-fall * trainer->samples() / samples);
      PATINA_TRY(GuardedStep(trainer, &guard, rates(endpoint_rate * factor, index_rate * factor), rates(network_rate * factor, 0), true));
      session->Report(trainer, (result->samples + trainer->samples()) / budget);
    }
    return {};
  };

  // At least 300 iterations of the free phase: fewer leave the partitions to chance.
  const double batch = windows_per_batch * kWindowSide * kWindowSide;
  const double free_samples = std::max(budget * kFreeShare, std::min(300 * batch, 0.1 * budget));
  FeatureStore store;
  {
    FeatureStore free_store;
    free_store.Allocate(result->shape, BlockForm::kFree, StoreUse::kAccumulate);
    InitFeaturesAtRandom(&rng, &free_store);
    Trainer trainer(reference, result->shape, &free_store, &network, kernels, pool, options.seed, draw, windows_per_batch);
    PATINA_TRY(run(&trainer, free_samples, 5e-2, 5e-2, 1e-3, kFreeFall));
    if (session->cancelled()) return {};
    session->Record(&trainer, &free_store, network.raw());
    store.Allocate(result->shape, BlockForm::kSegments, StoreUse::kAccumulate);
    InitBlocksFromFreeTexels(free_store, pool, &store);
    result->samples = trainer.samples();
  }
  Trainer trainer(reference, result->shape, &store, &network, kernels, pool, options.seed + 7, draw, windows_per_batch);
  Exporter exporter(&trainer, result->shape, &store, pool);
  const double block_samples = budget * (1 - kTune) - free_samples;
  PATINA_TRY(run(&trainer, block_samples, kBlockRate, kBlockRate, 3e-3, kBlockFall));
  if (session->cancelled()) return {};
  session->Record(&trainer, &store, network.raw());
  result->samples += trainer.samples();
  result->stopped_by = "budget";
  KeepFloatQuality(&trainer, &store, network.raw(), result);
  exporter.EncodeSixBit();
  PATINA_TRY(FinishNetwork(reference, kernels, pool, options, draw, windows_per_batch, kTune * budget, 1e-3, 0, &guard, &exporter,
                           &network, result));
  result->rollbacks = guard.rollbacks();
  return {};
}

Status CheckOutputs(int outputs) {
  if (outputs >= 1 && outputs <= kMaxOutputs) return {};
  return Fail(ErrorCode::kInvalidArgument, "a material needs 1 to " + std::to_string(kMaxOutputs) +
                                               " channels that vary to be trained, this one has " + std::to_string(outputs));
}

}  // namespace

double GainToCome(double progress) { return progress < 1 ? 1 + 1.9 * std::log2(1 / progress) : 0; }

double SampleBudget(const MaterialReference& reference, const TrainOptions& options) {
  if (options.samples > 0) return options.samples;
  double texels = 0;
  for (const TargetLevel& level : reference.pyramid.levels) texels += static_cast<double>(level.width) * level.height;
  return std::max(kMinSamples, texels * SamplesPerTexel(options.quality));
}

Result<TrainedMaterial> TrainMaterial(const MaterialReference& reference, const ModelShape& shape,
                                      const TrainOptions& options, ThreadPool& pool, ProgressSink& progress) {
  PATINA_ASSIGN(const SimdTarget target, ActiveSimdTarget());
  const int outputs = reference.pyramid.channels;
  PATINA_TRY(CheckOutputs(outputs));
  TrainedMaterial result;
  result.shape = shape;
  result.outputs = outputs;
  const double budget = SampleBudget(reference, options);
  Session session(options, progress, &result);
  PATINA_TRY(options.recipe == Recipe::kPaper ? TrainPaper(reference, KernelsFor(target), options, budget, pool, &session, &result)
                                              : TrainPatina(reference, KernelsFor(target), options, budget, pool, &session, &result));
  if (session.cancelled()) return Fail(ErrorCode::kCancelled, "training was interrupted");
  if (result.stopped_by == "hopeless") return result;
  for (const auto* weights : {&result.w1, &result.b1, &result.w2, &result.b2}) {
    for (const float w : *weights) {
      if (std::isfinite(w)) continue;
      return Fail(ErrorCode::kOutOfRange, "a weight of the decoder network does not fit half precision: bring the coded values of "
                                          "the channels near [-1, 1] by their scale");
    }
  }
  return result;
}

}  // namespace patina
