#include "pipeline/svbrdf/train_svbrdf.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "formats/dds.h"
#include "pipeline/base/cpu_time.h"
#include "pipeline/brdf/grid_trainer.h"
#include "pipeline/brdf/model_export.h"
#include "pipeline/brdf/quantiser.h"
#include "pipeline/brdf/schedule.h"

namespace patina::svbrdf {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kHeldOut = 8192;
constexpr size_t kSensitivitySamples = size_t{1} << 19;
constexpr int kSamplesPerTask = 256;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Samples as the kernels take them.
struct Batch {
  explicit Batch(size_t count) : samples(count), taps(count) {}
  AlignedBuffer<brdf::PoolSample> samples;
  AlignedBuffer<brdf::TexelTaps> taps;
};

class Session {
 public:
  Session(const TexelPool& pool, const SvbrdfShape& shape, const SvbrdfOptions& options,
          ThreadPool& threads, ProgressSink& progress, SimdTarget target)
      : pool_(pool),
        shape_(shape),
        options_(options),
        threads_(threads),
        progress_(progress),
        layout_(shape.model.primitive_size, shape.model.grid.extra_inputs(), shape.model.hidden,
                shape.model.hidden_layers, shape.texture.features()),
        texture_(shape.texture, layout_, brdf::KernelsFor(target), TextureKernelsFor(target)),
        trainer_(layout_, 2 * shape.model.grid.corners(), brdf::KernelsFor(target), threads,
                 options.seed),
        guard_(options.rate_fault),
        held_out_count_(std::min(kHeldOut, std::max<size_t>(1, pool.samples.size() / 8))),
        train_count_(std::max<size_t>(1, pool.samples.size() - held_out_count_)),
        batch_(std::min<size_t>(options.batch, train_count_)),
        held_out_(held_out_count_) {
    trainer_.UseTexture(&texture_);
    if (!pool.start.empty()) texture_.Start(pool.start, threads);
    // Of so few samples that none can be held back the same ones.
    Fill(pool.samples.size() - held_out_count_, &held_out_);
  }

  Result<TrainedSvbrdf> Run() {
    CountUsage();
    trainer_.Save();
    PATINA_TRY(Steps(options_.free_steps, [&](float factor) {
      texture_.SetRates(options_.texel_rate * factor, 0);
      return brdf::StepRates{options_.feature_rate * factor, options_.network_rate * factor,
                             options_.decay};
    }));
    result_.free_loss = HeldOut();
    Record();
    StartCodebook();
    if (options_.form == TextureForm::kBlocks) StartBlocks();
    trainer_.Save();
    PATINA_TRY(Steps(options_.block_steps, [&](float factor) {
      const bool blocks = options_.form == TextureForm::kBlocks;
      texture_.SetRates((blocks ? options_.block_rate : options_.texel_rate / 2) * factor,
                        options_.index_rate * factor);
      return brdf::StepRates{options_.feature_rate / 2 * factor, options_.network_rate / 2 * factor,
                             options_.decay};
    }));
    result_.block_loss = HeldOut();
    Record();
    FixTexture();
    trainer_.ForgetMoments();
    trainer_.Save();
    PATINA_TRY(Steps(options_.final_steps, [&](float factor) {
      return brdf::StepRates{options_.feature_rate / 4 * factor, options_.network_rate / 4 * factor,
                             options_.decay};
    }));
    result_.final_loss = HeldOut();
    Record();
    return Finish();
  }

 private:
  bool Cancelled() const { return options_.cancel != nullptr && options_.cancel->cancelled(); }
  int TotalSteps() const {
    return options_.free_steps + options_.block_steps + options_.final_steps;
  }

  // Samples `first` and following of the pool.
  void Fill(size_t first, Batch* batch) {
    const size_t count = batch->samples.size();
    const int tasks = static_cast<int>((count + kSamplesPerTask - 1) / kSamplesPerTask);
    threads_.ParallelFor(tasks, [&](int task, int) {
      const size_t begin = static_cast<size_t>(task) * kSamplesPerTask,
                   end = std::min(count, begin + kSamplesPerTask);
      for (size_t i = begin; i < end; ++i) {
        const TexelSample& from = pool_.samples[first + i];
        brdf::PoolSample& to = batch->samples[i];
        to = pool_.lookups[from.pair];
        std::copy_n(from.value, 3, to.value);
        to.importance = from.importance;
        batch->taps[i] = texture_.LookUp(from.u, from.v, from.s);
      }
    });
  }

  // The square root of how much each corner is looked up: pairs weigh alike.
  void CountUsage() {
    usage_.assign(static_cast<size_t>(trainer_.corners()), 0.0f);
    for (size_t i = 0; i < pool_.lookups.size(); ++i) {
      for (int c = 0; c < 8; ++c) usage_[pool_.lookups[i].corner[c]] += pool_.lookups[i].weight[c];
    }
    for (float& u : usage_) u = std::sqrt(u);
  }

  template <class Rates>
  Status Steps(int steps, Rates&& rates_at) {
    for (int step = 0; step < steps; ++step) {
      if (Cancelled()) return Fail(ErrorCode::kCancelled, "training was interrupted");
      const auto guarded = static_cast<float>(guard_.NextFactor());
      const brdf::StepRates rates = rates_at(guarded * brdf::CosineRate(step, steps));
      const size_t count = batch_.samples.size();
      if (next_ + count > train_count_) next_ = 0;
      Fill(next_, &batch_);
      next_ += count;
      result_.samples += static_cast<double>(count);
      const bool good =
          trainer_.Step(batch_.samples.data(), static_cast<int>(count), rates, batch_.taps.data());
      if (!good) {
        trainer_.Rollback();
        PATINA_TRY(guard_.RolledBack(result_.samples));
      } else if (guard_.SaveIsDue(trainer_.step_loss(), trainer_.state_bytes())) {
        trainer_.Save();
      }
      ++steps_done_;
      Report();
      RecordSometimes();
    }
    return {};
  }

  void StartCodebook() {
    std::vector<float> codes(static_cast<size_t>(brdf::CodesOf(shape_.model)) *
                             layout_.feature_stride);
    std::vector<int32_t> index(trainer_.corners());
    Rng rng(options_.seed, 5);
    constexpr int kRounds = 25;
    const brdf::FeatureRows features = {trainer_.features().data(),
                                        static_cast<size_t>(trainer_.corners()),
                                        layout_.feature_stride};
    brdf::KMeans(features, usage_, brdf::CodesOf(shape_.model), kRounds, &rng, threads_,
                 codes.data(), index);
    trainer_.UseCodebook(std::move(codes), std::move(index));
  }

  // The gradients of many samples; what is trained stays.
  template <class Visit>
  void VisitManyGradients(Visit&& visit) {
    const size_t count = std::min(kSensitivitySamples, train_count_);
    const size_t piece = batch_.samples.size();
    for (size_t first = 0; first + piece <= count; first += piece) {
      Fill(first, &batch_);
      trainer_.VisitGradients(batch_.samples.data(), piece, batch_.taps.data(), visit);
    }
  }

  // The texture becomes blocks of what BC6H can hold, and the first layer reads it as before.
  void StartBlocks() {
    const auto n = static_cast<size_t>(shape_.texture.features());
    const size_t first = 2 * static_cast<size_t>(layout_.feature_stride);
    std::vector<double> importance(n * n);
    double samples = 0;
    VisitManyGradients([&](size_t, int rows, const brdf::ChunkResult& result) {
      for (int s = 0; s < rows; ++s) {
        const float* g = result.feature_gradient.data() +
                         static_cast<size_t>(s) * layout_.feature_columns() + first;
        for (size_t i = 0; i < n; ++i) {
          for (size_t j = 0; j < n; ++j)
            importance[i * n + j] += static_cast<double>(g[i]) * static_cast<double>(g[j]);
        }
      }
      samples += rows;
    });
    for (double& product : importance) product /= samples;
    TexelMoments moments = texture_.Moments();
    const FeatureBasis basis =
        PrincipalBasis(std::move(moments.mean), moments.covariance, importance);
    texture_.Rebase(basis, threads_);
    ReadThrough(basis);
    trainer_.ForgetMoments();
    texture_.UseBlocks(threads_);
  }

  // Makes the first layer take the places of the basis for the features that they stand for.
  void ReadThrough(const FeatureBasis& basis) {
    const size_t n = basis.mean.size();
    const brdf::DenseLayer& layer = layout_.layers[0];
    const auto outputs = static_cast<size_t>(layer.outputs);
    float* weights = trainer_.parameters().data() + layer.weights;
    float* bias = weights + static_cast<size_t>(layer.inputs) * outputs;
    float* rows = weights + 2 * static_cast<size_t>(layout_.feature_stride) * outputs;
    std::vector<double> of_place(n);
    for (size_t o = 0; o < outputs; ++o) {
      double offset = 0;
      of_place.assign(n, 0);
      for (size_t f = 0; f < n; ++f) {
        const auto weight = static_cast<double>(rows[f * outputs + o]);
        offset += weight * basis.mean[f];
        for (size_t place = 0; place < n; ++place)
          of_place[place] += weight * basis.backward[f * n + place];
      }
      for (size_t place = 0; place < n; ++place) {
        rows[place * outputs + o] = static_cast<float>(of_place[place]);
        offset -= of_place[place];
      }
      bias[o] += static_cast<float>(offset);
    }
    trainer_.ParametersChanged();
  }

  void FixTexture() {
    if (options_.form == TextureForm::kHalves) return texture_.RoundToHalves();
    std::vector<float> sums = texture_.MakeSensitivity();
    VisitManyGradients([&](size_t at, int rows, const brdf::ChunkResult& result) {
      texture_.AddSensitivity(batch_.taps.data() + at, rows, result, sums);
    });
    texture_.Encode(sums, threads_);
    for (int t = 0; t < shape_.texture.textures; ++t) result_.blocks[t] = texture_.blocks()[t];
  }

  double HeldOut() {
    std::vector<float> y(held_out_count_ * brdf::kOutputs);
    trainer_.Evaluate(held_out_.samples.data(), held_out_count_, y.data(), held_out_.taps.data());
    return brdf::MeanLogError(y, held_out_.samples.data());
  }

  void Report() {
    if (SecondsSince(last_report_) < 0.2) return;
    last_report_ = Clock::now();
    ProgressEvent event;
    event.stage = "train";
    event.samples = result_.samples;
    event.fraction = static_cast<double>(steps_done_) / TotalSteps();
    event.elapsed_s = SecondsSince(start_);
    event.samples_per_s = event.samples / std::max(1e-3, event.elapsed_s);
    event.eta_s =
        event.fraction > 0.01 ? event.elapsed_s * (1 - event.fraction) / event.fraction : -1;
    progress_.OnProgress(event);
  }

  void RecordSometimes() {
    constexpr int kRecords = 16;
    const int every = std::max(1, TotalSteps() / kRecords);
    if (steps_done_ % every == 0 || steps_done_ == every / 2 || steps_done_ == every / 4) Record();
  }

  // Once for a state.
  void Record() {
    if (!result_.curve.empty() && result_.curve.back().samples == result_.samples) return;
    const Clock::time_point begin = Clock::now();
    brdf::CurvePoint point;
    point.samples = result_.samples;
    point.wall_s = SecondsSince(start_);
    point.cpu_s = ProcessCpuSeconds() - start_cpu_;
    point.log1p_mae = HeldOut();
    result_.curve.push_back(point);
    result_.recording_s += SecondsSince(begin);
  }

  Result<TrainedSvbrdf> Finish() {
    result_.shape = shape_;
    result_.used_codes =
        brdf::UsagePerplexity(trainer_.index(), usage_, brdf::CodesOf(shape_.model));
    result_.rollbacks = guard_.rollbacks();
    PATINA_ASSIGN(result_.network, brdf::ExportNetwork(layout_, trainer_.parameters().data()));
    result_.pack = std::move(brdf::ExportPacks(shape_.model, 1, usage_, &trainer_)[0]);
    if (options_.form == TextureForm::kHalves) {
      const size_t floats = static_cast<size_t>(shape_.texture.texels()) * kRowFloats;
      result_.texels.assign(texture_.rows(), texture_.rows() + floats);
    }
    return std::move(result_);
  }

  const TexelPool& pool_;
  const SvbrdfShape& shape_;
  const SvbrdfOptions& options_;
  ThreadPool& threads_;
  ProgressSink& progress_;
  brdf::NetworkLayout layout_;
  NeuralTexture texture_;
  brdf::GridTrainer trainer_;
  RateGuard guard_;
  size_t held_out_count_, train_count_, next_ = 0;
  int steps_done_ = 0;
  Batch batch_, held_out_;
  std::vector<float> usage_;
  TrainedSvbrdf result_;
  Clock::time_point start_ = Clock::now();
  double start_cpu_ = ProcessCpuSeconds();
  Clock::time_point last_report_{};
};

}  // namespace

SvbrdfShape DefaultSvbrdfShape(int width, int height, AddressMode address, bool isotropic) {
  SvbrdfShape shape;
  shape.model.grid.nside = 8;
  shape.model.grid.isotropic = isotropic;
  shape.model.grid.canonical_order = isotropic;
  shape.model.grid.half_vector_inputs = !isotropic;
  shape.model.index_bits = 8;
  shape.model.hidden = 64;
  shape.model.hidden_layers = 2;
  shape.texture.width = width;
  shape.texture.height = height;
  shape.texture.levels = DdsFullChainLevels(width, height);
  shape.texture.address = address;
  return shape;
}

size_t WantedSamples(const SvbrdfOptions& options, const TextureShape& texture,
                     const VaryingSource& source) {
  constexpr size_t kMost = 9586980;  // 300 MB
  const size_t trained = static_cast<size_t>(options.batch) *
                         static_cast<size_t>(options.free_steps + options.block_steps);
  return std::min(source.SamplesWorth(trained + kHeldOut, static_cast<size_t>(texture.texels())),
                  kMost);
}

uint64_t TrainedSvbrdf::texture_bytes() const {
  uint64_t bytes = 0;
  for (const auto& texture : blocks) {
    for (const auto& level : texture) bytes += level.size() * bc6h::kBlockBytes;
  }
  if (!texels.empty()) {
    bytes += uint64_t{2} * static_cast<uint64_t>(shape.texture.features()) *
             static_cast<uint64_t>(shape.texture.texels());
  }
  return bytes;
}

Result<TrainedSvbrdf> TrainSvbrdf(const TexelPool& pool, const SvbrdfShape& shape,
                                  const SvbrdfOptions& options, ThreadPool& threads,
                                  ProgressSink& progress) {
  PATINA_ASSIGN(const SimdTarget target, ActiveSimdTarget());
  PATINA_TRY(brdf::CheckShape(shape.model));
  if (shape.texture.textures < 1 || shape.texture.textures > kFeatureTextures)
    return Fail(ErrorCode::kInvalidArgument, "a neural texture has 1 to 4 textures");
  return Session(pool, shape, options, threads, progress, target).Run();
}

}  // namespace patina::svbrdf
