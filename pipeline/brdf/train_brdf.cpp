#include "pipeline/brdf/train_brdf.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

#include "formats/half.h"
#include "pipeline/brdf/grid_trainer.h"
#include "pipeline/brdf/quantiser.h"

namespace patina::brdf {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kHeldOut = 16384;
constexpr int kWarmUpSteps = 100;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// A sixteenth of the indices stays free: rare codes bring least, and the default model stays below
// 25 KB.
int CodesOf(const ModelShape& shape) {
  const int indices = 1 << shape.index_bits;
  return indices - indices / 16;
}

float CosineRate(int step, int steps) {
  const double warm = std::min(1.0, (step + 1.0) / kWarmUpSteps);
  return static_cast<float>(warm * 0.5 * (1 + std::cos(std::numbers::pi * step / steps)));
}

// Mean |log1p(f c) - log1p(f* c)| of samples; negative values as zero.
double HeldOutLoss(GridTrainer* trainer, const PoolSample* samples, size_t count) {
  std::vector<float> y(count * kOutputs);
  trainer->Evaluate(samples, count, y.data());
  double sum = 0;
  for (size_t s = 0; s < count; ++s) {
    for (int c = 0; c < kOutputs; ++c) {
      const double f = std::max(
          0.0, std::expm1(static_cast<double>(std::min(y[s * kOutputs + c], kMaxLogValue))));
      const double wanted = std::max(0.0, static_cast<double>(samples[s].value[c]));
      const double cosine = static_cast<double>(samples[s].cosine);
      sum += std::abs(std::log1p(f * cosine) - std::log1p(wanted * cosine));
    }
  }
  return sum / static_cast<double>(count * kOutputs);
}

class Session {
 public:
  Session(const Source& source, const ModelShape& shape, const TrainOptions& options,
          ThreadPool& pool, ProgressSink& progress, const BrdfKernels& kernels)
      : shape_(shape),
        options_(options),
        pool_(pool),
        progress_(progress),
        layout_(shape.primitive_size, shape.grid.extra_inputs(), shape.hidden, shape.hidden_layers),
        trainer_(layout_, 2 * shape.grid.corners(), kernels, pool, options.seed) {
    PoolOptions pool_options;
    pool_options.count = options.pool + kHeldOut;
    pool_options.half_angle_share = options.half_angle_share;
    pool_options.seed = options.seed;
    samples_ = DrawPool(source, shape.grid, pool_options, pool);
  }

  Result<TrainedBrdf> Run() {
    if (samples_.size() < 64)
      return Fail(ErrorCode::kCorruptData, "too few directions have valid data to train on");
    held_out_ = std::min(kHeldOut, samples_.size() / 8);
    train_count_ = samples_.size() - held_out_;
    CountUsage();
    const int total = options_.free_steps + options_.codebook_steps;
    for (int step = 0; step < options_.free_steps; ++step) {
      if (Cancelled()) return Fail(ErrorCode::kCancelled, "training was interrupted");
      const float factor = CosineRate(step, options_.free_steps);
      Step({options_.feature_rate * factor, options_.network_rate * factor});
      Report(step, total);
    }
    result_.free_loss = HeldOut();
    Record();
    StartCodebook();
    for (int step = 0; step < options_.codebook_steps; ++step) {
      if (Cancelled()) return Fail(ErrorCode::kCancelled, "training was interrupted");
      const float factor = CosineRate(step, options_.codebook_steps);
      Step({options_.codebook_rate * factor, options_.codebook_network_rate * factor});
      Report(options_.free_steps + step, total);
    }
    result_.used_codes = UsagePerplexity(trainer_.index(), usage_, Codes());
    result_.final_loss = HeldOut();
    Record();
    return Finish();
  }

 private:
  bool Cancelled() const { return options_.cancel && options_.cancel->cancelled(); }
  int Codes() const { return CodesOf(shape_); }
  double HeldOut() { return HeldOutLoss(&trainer_, samples_.data() + train_count_, held_out_); }

  void CountUsage() {
    usage_.assign(static_cast<size_t>(trainer_.corners()), 0.0f);
    for (size_t s = 0; s < train_count_; ++s) {
      for (int c = 0; c < 8; ++c) usage_[samples_[s].corner[c]] += samples_[s].weight[c];
    }
    for (float& u : usage_) u = std::sqrt(u);
  }

  void Step(const StepRates& rates) {
    const size_t batch = std::min<size_t>(options_.batch, train_count_);
    if (next_ + batch > train_count_) next_ = 0;
    if (!trainer_.Step(samples_.data() + next_, static_cast<int>(batch), rates))
      ++result_.rollbacks;
    next_ += batch;
    result_.samples += static_cast<double>(batch);
  }

  FeatureRows Features() {
    return {trainer_.features().data(), static_cast<size_t>(trainer_.corners()),
            layout_.feature_stride};
  }

  void StartCodebook() {
    std::vector<float> codes(static_cast<size_t>(Codes()) * layout_.feature_stride);
    std::vector<int32_t> index(trainer_.corners());
    Rng rng(options_.seed, 5);
    constexpr int kRounds = 25;
    KMeans(Features(), usage_, Codes(), kRounds, &rng, pool_, codes.data(), index);
    trainer_.UseCodebook(std::move(codes), std::move(index));
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

  void Record() {
    CurvePoint point;
    point.samples = result_.samples;
    point.wall_s = SecondsSince(start_);
    point.log1p_mae = HeldOut();
    result_.curve.push_back(point);
  }

  Result<TrainedBrdf> Finish() {
    result_.shape = shape_;
    MakePack();
    PATINA_TRY(MakeNetwork());
    return std::move(result_);
  }

  void MakePack() {
    IndexPack& pack = result_.pack;
    pack.nside = shape_.grid.nside;
    pack.primitive_size = shape_.primitive_size;
    pack.index_bits = shape_.index_bits;
    pack.interpolation = shape_.grid.interpolation;
    pack.isotropic = shape_.grid.isotropic;
    pack.canonical_order = shape_.grid.canonical_order;
    pack.angle_inputs = shape_.grid.angle_inputs;
    const int corners = shape_.grid.corners();
    for (int side = 0; side < 2; ++side) {
      pack.stored[side].resize(corners);
      for (int c = 0; c < corners; ++c) {
        const int corner = side * corners + c;
        pack.stored[side][c] = usage_[corner] > 0 ? 1 : 0;
        if (usage_[corner] > 0)
          pack.indices.push_back(static_cast<uint16_t>(trainer_.index()[corner]));
      }
    }
    for (int code = 0; code < Codes(); ++code) {
      for (int k = 0; k < shape_.primitive_size; ++k) {
        pack.codebook.push_back(FloatToHalf(
            trainer_.codebook()[static_cast<size_t>(code) * layout_.feature_stride + k]));
      }
    }
  }

  // Padding of features and hidden units goes; the weights become halves.
  Status MakeNetwork() {
    for (size_t l = 0; l < layout_.layers.size(); ++l) {
      const DenseLayer& layer = layout_.layers[l];
      const bool last = l + 1 == layout_.layers.size();
      const int outputs = last ? kOutputs : shape_.hidden;
      std::vector<int> columns;
      if (l == 0) {
        for (int side = 0; side < 2; ++side) {
          for (int k = 0; k < shape_.primitive_size; ++k)
            columns.push_back(side * layout_.feature_stride + k);
        }
        for (int e = 0; e < layout_.extra_inputs; ++e)
          columns.push_back(2 * layout_.feature_stride + e);
      } else {
        for (int i = 0; i < shape_.hidden; ++i) columns.push_back(i);
      }
      WeightTensor weight, bias;
      weight.name = "layer" + std::to_string(l) + ".weight";
      weight.shape = {static_cast<uint32_t>(outputs), static_cast<uint32_t>(columns.size())};
      bias.name = "layer" + std::to_string(l) + ".bias";
      bias.shape = {static_cast<uint32_t>(outputs)};
      const float* w = trainer_.parameters().data() + layer.weights;
      for (int o = 0; o < outputs; ++o) {
        for (const int i : columns)
          weight.elements.push_back(FloatToHalf(w[static_cast<size_t>(i) * layer.outputs + o]));
        bias.elements.push_back(
            FloatToHalf(w[static_cast<size_t>(layer.inputs) * layer.outputs + o]));
      }
      for (const auto* elements : {&weight.elements, &bias.elements}) {
        for (const uint16_t half : *elements) {
          if ((half & 0x7C00) == 0x7C00)
            return Fail(ErrorCode::kOutOfRange,
                        "a weight of the network does not fit half precision");
        }
      }
      result_.network.tensors.push_back(std::move(weight));
      result_.network.tensors.push_back(std::move(bias));
    }
    return {};
  }

  const ModelShape& shape_;
  const TrainOptions& options_;
  ThreadPool& pool_;
  ProgressSink& progress_;
  NetworkLayout layout_;
  GridTrainer trainer_;
  AlignedBuffer<PoolSample> samples_;
  size_t held_out_ = 0, train_count_ = 0, next_ = 0;
  std::vector<float> usage_;
  TrainedBrdf result_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_report_{};
};

}  // namespace

Result<TrainedBrdf> TrainBrdf(const Source& source, const ModelShape& shape,
                              const TrainOptions& options, ThreadPool& pool,
                              ProgressSink& progress) {
  PATINA_ASSIGN(const SimdTarget target, ActiveSimdTarget());
  if (shape.grid.nside < 1 || shape.grid.nside > 256 || shape.primitive_size < 1 ||
      shape.primitive_size > 64 || shape.index_bits < 1 || shape.index_bits > 12 ||
      shape.hidden < 4 || shape.hidden > 256 || shape.hidden_layers < 1 ||
      shape.hidden_layers > 4) {
    return Fail(ErrorCode::kInvalidArgument,
                "the model's shape is out of range: Nside 1 to 256, primitives of 1 to 64 numbers, "
                "1 to 12 index bits, 1 to 4 "
                "hidden layers of 4 to 256 units");
  }
  return Session(source, shape, options, pool, progress, KernelsFor(target)).Run();
}

}  // namespace patina::brdf
