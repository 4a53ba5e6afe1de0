#include "pipeline/brdf/train_brdf.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "pipeline/base/cpu_time.h"
#include "pipeline/brdf/grid_trainer.h"
#include "pipeline/brdf/model_export.h"
#include "pipeline/brdf/quantiser.h"
#include "pipeline/brdf/schedule.h"

namespace patina::brdf {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kHeldOut = 16384;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

class Session {
 public:
  Session(std::span<const Source* const> sources, const ModelShape& shape,
          const TrainOptions& options, ThreadPool& pool, ProgressSink& progress,
          const BrdfKernels& kernels)
      : shape_(shape),
        options_(options),
        pool_(pool),
        progress_(progress),
        kernels_(kernels),
        materials_(static_cast<int>(sources.size())),
        layout_(shape.primitive_size, shape.grid.extra_inputs(), shape.hidden, shape.hidden_layers),
        trainer_(layout_, 2 * materials_ * shape.grid.corners(), kernels, pool, options.seed),
        guard_(options.rate_fault) {
    DrawSamples(sources);
  }

  Result<std::vector<TrainedBrdf>> Run() {
    if (Cancelled()) return Fail(ErrorCode::kCancelled, "training was interrupted");
    if (samples_.size() < 64)
      return Fail(ErrorCode::kCorruptData, "too few directions have valid data to train on");
    held_out_ = std::min(kHeldOut, samples_.size() / 8);
    train_count_ = samples_.size() - held_out_;
    CountUsage();
    const double growth = 0.5 * (materials_ + 1);
    const int total = static_cast<int>(growth * (options_.free_steps + options_.codebook_steps));
    trainer_.Save();
    const bool has_free_part = options_.index_training != IndexTraining::kSoftmax;
    const int free_steps = has_free_part ? static_cast<int>(growth * options_.free_steps) : 0;
    const int code_steps = total - free_steps;
    for (int step = 0; step < free_steps; ++step) {
      if (Cancelled()) return Fail(ErrorCode::kCancelled, "training was interrupted");
      const float factor = CosineRate(step, free_steps);
      PATINA_TRY(
          Step({options_.feature_rate * factor, options_.network_rate * factor, options_.decay}));
      PullToCodes(step, free_steps);
      Report(step, total);
      RecordSometimes(step + 1, total);
    }
    result_.free_loss = HeldOut();
    Record();
    if (has_free_part) {
      StartCodebook();
    } else {
      StartCodesAtRandom();
    }
    trainer_.Save();
    for (int step = 0; step < code_steps; ++step) {
      if (Cancelled()) return Fail(ErrorCode::kCancelled, "training was interrupted");
      const float factor = CosineRate(step, code_steps);
      StepRates rates;
      rates.features = factor * (has_free_part ? options_.codebook_rate : options_.feature_rate);
      rates.network =
          factor * (has_free_part ? options_.codebook_network_rate : options_.network_rate);
      rates.decay = options_.decay;
      rates.logits = options_.logit_rate * factor;
      rates.temperature = 1 - 0.5f * static_cast<float>(step) / static_cast<float>(code_steps);
      PATINA_TRY(Step(rates));
      Report(free_steps + step, total);
      RecordSometimes(free_steps + step + 1, total);
    }
    result_.used_codes = UsagePerplexity(trainer_.index(), usage_, Codes());
    result_.final_loss = HeldOut();
    result_.rollbacks = guard_.rollbacks();
    Record();
    return Finish();
  }

 private:
  // Samples of all materials in turn; corners of each material follow those of the one before.
  void DrawSamples(std::span<const Source* const> sources) {
    PoolOptions pool_options;
    // Several materials share the memory that one may use four times over.
    pool_options.count =
        std::min(options_.pool, 4 * options_.pool / static_cast<size_t>(materials_)) +
        kHeldOut / static_cast<size_t>(materials_);
    pool_options.half_angle_share = options_.half_angle_share;
    pool_options.cancel = options_.cancel;
    // Tables are read in no time.
    if (KindOf(*sources[0]).simulated) {
      pool_options.on_progress = [this](double fraction) { ReportSimulation(fraction); };
    }
    std::vector<AlignedBuffer<PoolSample>> pools;
    size_t each = pool_options.count;
    for (int m = 0; m < materials_; ++m) {
      pool_options.seed = options_.seed + static_cast<uint64_t>(m);
      pools.push_back(DrawPool(*sources[m], shape_.grid, pool_options, pool_));
      each = std::min(each, pools.back().size());
    }
    if (materials_ == 1) {
      samples_ = std::move(pools[0]);
      return;
    }
    samples_.Reset(each * static_cast<size_t>(materials_));
    for (int m = 0; m < materials_; ++m) {
      const int first = 2 * m * shape_.grid.corners();
      for (size_t s = 0; s < each; ++s) {
        PoolSample& to = samples_[s * static_cast<size_t>(materials_) + static_cast<size_t>(m)];
        to = pools[m][s];
        for (int32_t& corner : to.corner) corner += first;
      }
      pools[m].Reset(0);
    }
  }

  bool Cancelled() const { return options_.cancel && options_.cancel->cancelled(); }
  int Codes() const { return CodesOf(shape_); }
  double HeldOut() {
    std::vector<float> y(held_out_ * kOutputs);
    trainer_.Evaluate(samples_.data() + train_count_, held_out_, y.data());
    return MeanLogError(y, samples_.data() + train_count_);
  }

  void CountUsage() {
    usage_.assign(static_cast<size_t>(trainer_.corners()), 0.0f);
    for (size_t s = 0; s < train_count_; ++s) {
      for (int c = 0; c < 8; ++c) usage_[samples_[s].corner[c]] += samples_[s].weight[c];
    }
    for (float& u : usage_) u = std::sqrt(u);
  }

  Status Step(StepRates rates) {
    const float guarded = static_cast<float>(guard_.NextFactor());
    for (float* rate : {&rates.features, &rates.network, &rates.logits}) *rate *= guarded;
    const size_t batch = std::min<size_t>(options_.batch, train_count_);
    if (next_ + batch > train_count_) next_ = 0;
    const bool good = trainer_.Step(samples_.data() + next_, static_cast<int>(batch), rates);
    next_ += batch;
    result_.samples += static_cast<double>(batch);
    if (good) {
      if (guard_.SaveIsDue(trainer_.step_loss(), trainer_.state_bytes())) trainer_.Save();
      return {};
    }
    trainer_.Rollback();
    return guard_.RolledBack(result_.samples);
  }

  FeatureRows Features() {
    return {trainer_.features().data(), static_cast<size_t>(trainer_.corners()),
            layout_.feature_stride};
  }

  // Draws the features together into as many groups as there will be codes: what is left of their
  // differences when they become codes costs little. Strongest at the end of the free steps.
  void PullToCodes(int step, int free_steps) {
    constexpr int kPulls = 16, kRounds = 4;
    const int first = free_steps / 3, every = std::max(1, (free_steps - first) / kPulls);
    if (!(options_.pull > 0) || step < first || (step - first) % every != 0) return;
    const size_t stride = layout_.feature_stride;
    std::vector<float> codes(static_cast<size_t>(Codes()) * stride);
    std::vector<int32_t> index(trainer_.corners());
    Rng rng(options_.seed, 5);
    KMeans(Features(), usage_, Codes(), kRounds, &rng, pool_, codes.data(), index);
    const float share = options_.pull * static_cast<float>(step - first) /
                        static_cast<float>(std::max(1, free_steps - first));
    for (size_t c = 0; c < index.size(); ++c) {
      if (!(usage_[c] > 0)) continue;
      float* feature = trainer_.features().data() + c * stride;
      const float* code = codes.data() + static_cast<size_t>(index[c]) * stride;
      for (size_t k = 0; k < stride; ++k) feature[k] += share * (code[k] - feature[k]);
    }
  }

  void StartCodebook() {
    std::vector<float> codes(static_cast<size_t>(Codes()) * layout_.feature_stride);
    std::vector<int32_t> index(trainer_.corners());
    Rng rng(options_.seed, 5);
    constexpr int kRounds = 25;
    KMeans(Features(), usage_, Codes(), kRounds, &rng, pool_, codes.data(), index);
    std::unique_ptr<SoftIndex> soft;
    if (options_.index_training == IndexTraining::kClustersThenSoftmax) {
      soft = MakeSoftIndex();
      constexpr float kSharpness = 4;
      soft->StartFromFeatures(trainer_.features().data(), codes.data(), kSharpness);
    }
    trainer_.UseCodebook(std::move(codes), std::move(index));
    if (soft) trainer_.UseSoftIndex(std::move(soft));
  }

  void StartCodesAtRandom() {
    std::vector<float> codes(static_cast<size_t>(Codes()) * layout_.feature_stride);
    Rng rng(options_.seed, 6);
    constexpr float kSpread = 0.1f;
    for (int code = 0; code < Codes(); ++code) {
      for (int k = 0; k < shape_.primitive_size; ++k)
        codes[static_cast<size_t>(code) * layout_.feature_stride + k] =
            (2 * rng.Uniform() - 1) * kSpread;
    }
    auto soft = MakeSoftIndex();
    soft->StartAtRandom(options_.seed);
    trainer_.UseCodebook(std::move(codes), std::vector<int32_t>(trainer_.corners()));
    trainer_.UseSoftIndex(std::move(soft));
  }

  std::unique_ptr<SoftIndex> MakeSoftIndex() {
    std::vector<int32_t> supervised;
    for (int c = 0; c < trainer_.corners(); ++c) {
      if (usage_[c] > 0) supervised.push_back(c);
    }
    return std::make_unique<SoftIndex>(std::move(supervised), Codes(), layout_.feature_stride,
                                       kernels_, pool_);
  }

  void ReportSimulation(double fraction) {
    if (SecondsSince(last_report_) < 0.2) return;
    last_report_ = Clock::now();
    ProgressEvent event;
    event.stage = "train";
    event.fraction = 0;
    event.elapsed_s = SecondsSince(start_);
    event.message = "simulating, " + std::to_string(static_cast<int>(100 * fraction)) + " %";
    progress_.OnProgress(event);
  }

  void Report(int step, int total) {
    if (SecondsSince(last_report_) < 0.2) return;
    last_report_ = Clock::now();
    ProgressEvent event;
    event.stage = "train";
    event.samples = result_.samples;
    event.fraction = static_cast<double>(step) / total;
    event.elapsed_s = SecondsSince(start_);
    event.samples_per_s = event.samples / std::max(1e-3, event.elapsed_s);
    event.eta_s =
        event.fraction > 0.01 ? event.elapsed_s * (1 - event.fraction) / event.fraction : -1;
    progress_.OnProgress(event);
  }

  // At even distances, and twice before the first, where most is learned.
  void RecordSometimes(int done, int total) {
    constexpr int kRecords = 16;
    const int every = std::max(1, total / kRecords);
    if (done % every == 0 || done == every / 2 || done == every / 4) Record();
  }

  // Once for a state.
  void Record() {
    if (!result_.curve.empty() && result_.curve.back().samples == result_.samples) return;
    const Clock::time_point begin = Clock::now();
    CurvePoint point;
    point.samples = result_.samples;
    point.wall_s = SecondsSince(start_);
    point.cpu_s = ProcessCpuSeconds() - start_cpu_;
    point.log1p_mae = HeldOut();
    result_.curve.push_back(point);
    result_.recording_s += SecondsSince(begin);
  }

  Result<std::vector<TrainedBrdf>> Finish() {
    result_.shape = shape_;
    PATINA_ASSIGN(result_.network, ExportNetwork(layout_, trainer_.parameters().data()));
    std::vector<TrainedBrdf> all(static_cast<size_t>(materials_), result_);
    std::vector<IndexPack> packs = ExportPacks(shape_, materials_, usage_, &trainer_);
    for (size_t m = 0; m < all.size(); ++m) all[m].pack = std::move(packs[m]);
    return all;
  }

  const ModelShape& shape_;
  const TrainOptions& options_;
  ThreadPool& pool_;
  ProgressSink& progress_;
  const BrdfKernels& kernels_;
  int materials_;
  NetworkLayout layout_;
  GridTrainer trainer_;
  RateGuard guard_;
  AlignedBuffer<PoolSample> samples_;
  size_t held_out_ = 0, train_count_ = 0, next_ = 0;
  std::vector<float> usage_;
  TrainedBrdf result_;
  Clock::time_point start_ = Clock::now();
  double start_cpu_ = ProcessCpuSeconds();
  Clock::time_point last_report_{};
};

}  // namespace

SourceKind KindOf(const Source& source) {
  return {source.isotropic, source.table == nullptr, source.simulated != nullptr};
}

ModelShape DefaultShape(const SourceKind& kind) {
  ModelShape shape;
  shape.grid.isotropic = kind.isotropic;
  if (kind.list) {
    shape.grid.nside = 4;
  } else if (!kind.isotropic) {
    shape.grid.nside = 12;
    shape.index_bits = 10;
    shape.hidden = 64;
  }
  shape.grid.half_vector_inputs = !kind.isotropic;
  return shape;
}

ModelShape PaperShape(const SourceKind& kind) {
  ModelShape shape;
  shape.grid.isotropic = kind.isotropic;
  shape.grid.nside = 64;
  shape.grid.angle_inputs = shape.grid.canonical_order = false;
  shape.hidden = 64;
  shape.hidden_layers = 2;
  return shape;
}

TrainOptions PaperTraining() {
  TrainOptions options;
  options.decay = 0;
  return options;
}

TrainOptions DefaultTraining(const SourceKind& kind) {
  TrainOptions options;
  if (kind.list) {
    options.pool = size_t{1} << 16;
    options.free_steps = 3000;
    options.codebook_steps = 1000;
    options.decay = 0.4f;
  } else if (!kind.isotropic) {
    options.half_angle_share = 0.7;
    options.free_steps = options.codebook_steps = 12000;
    options.decay = 0.2f;
  } else {
    options.batch = 1024;
    options.feature_rate = 0.01f;
    options.codebook_rate = 0.005f;
  }
  return options;
}

Status CheckShape(const ModelShape& shape) {
  if (shape.grid.nside < 1 || shape.grid.nside > 256 || shape.primitive_size < 1 ||
      shape.primitive_size > 64 || shape.index_bits < 1 || shape.index_bits > 12 ||
      shape.hidden < 4 || shape.hidden > 256 || shape.hidden_layers < 1 ||
      shape.hidden_layers > 4) {
    return Fail(ErrorCode::kInvalidArgument,
                "the model's shape is out of range: Nside 1 to 256, primitives of 1 to 64 numbers, "
                "1 to 12 index bits, 1 to 4 "
                "hidden layers of 4 to 256 units");
  }
  return {};
}

Result<TrainedBrdf> TrainBrdf(const Source& source, const ModelShape& shape,
                              const TrainOptions& options, ThreadPool& pool,
                              ProgressSink& progress) {
  const Source* const one = &source;
  PATINA_ASSIGN(std::vector<TrainedBrdf> trained,
                TrainShared(std::span(&one, 1), shape, options, pool, progress));
  return std::move(trained[0]);
}

Result<std::vector<TrainedBrdf>> TrainShared(std::span<const Source* const> sources,
                                             const ModelShape& shape, const TrainOptions& options,
                                             ThreadPool& pool, ProgressSink& progress) {
  PATINA_ASSIGN(const SimdTarget target, ActiveSimdTarget());
  PATINA_TRY(CheckShape(shape));
  return Session(sources, shape, options, pool, progress, KernelsFor(target)).Run();
}

}  // namespace patina::brdf
