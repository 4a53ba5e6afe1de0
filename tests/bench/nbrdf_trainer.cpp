#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "pipeline/base/rng.h"
#include "tests/bench/nbrdf.h"

namespace patina::bench {
namespace {

constexpr size_t kHeldOut = 16384;
constexpr int kBatchTiles = 32;  // 512 samples
constexpr int kWarmUpSteps = 100;

// log1p, and a straight line below zero, as our trainer takes noise.
float Log1p(float x) { return x > 0 ? std::log1p(x) : x; }

class Start {
 public:
  Start(const NbrdfTrainOptions& options, const PeerKernels& kernels, size_t number)
      : options_(options),
        rate_(options.rates[number]),
        kernels_(kernels),
        gradient_(kNbrdfPadded),
        moment1_(kNbrdfPadded),
        moment2_(kNbrdfPadded) {
    Rng rng(options.seed, number);
    for (int l = 0; l < kNbrdfLayers; ++l) {
      // He's uniform range for the rectified layers, Glorot's for the last.
      const float range = std::sqrt(6.0f / static_cast<float>(l < 2 ? kNbrdfInputs[l] : 24));
      for (int i = 0; i < kNbrdfInputs[l]; ++i) {
        for (int o = 0; o < kNbrdfOutputs[l]; ++o)
          network.weight(l, i, o) = range * (2 * rng.Uniform() - 1);
      }
    }
  }

  void Train(const NbrdfTile* tiles, size_t count) {
    const size_t batch = std::min<size_t>(kBatchTiles, count);
    size_t next = 0;
    for (int step = 0; step < options_.steps; ++step) {
      if (next + batch > count) next = 0;
      for (size_t t = 0; t < batch; t += kNbrdfChunkTiles) {
        kernels_.nbrdf_train(network.parameters.data(), tiles + next + t, &scratch_,
                             gradient_.data());
      }
      next += batch;
      const double warm = std::min(1.0, (step + 1.0) / kWarmUpSteps);
      const double fall = 0.5 * (1 + std::cos(std::numbers::pi * step / options_.steps));
      Adam(step, rate_ * static_cast<float>(warm * fall), 1 / static_cast<float>(16 * batch));
    }
  }

  double Loss(const NbrdfTile* tiles, size_t count) {
    double loss = 0, samples = 0;
    for (size_t t = 0; t < count; t += kNbrdfChunkTiles) {
      loss +=
          kernels_.nbrdf_train(network.parameters.data(), tiles + t, &scratch_, gradient_.data());
    }
    std::fill_n(gradient_.data(), gradient_.size(), 0.0f);
    for (size_t t = 0; t < count; ++t) {
      for (const float importance : tiles[t].importance) samples += static_cast<double>(importance);
    }
    return loss / (3 * samples);
  }

  NbrdfNetwork network;

 private:
  void Adam(int step, float rate, float scale) {
    constexpr float kBeta1 = 0.9f, kBeta2 = 0.999f;
    const float correction1 = 1 / (1 - std::pow(kBeta1, static_cast<float>(step + 1)));
    const float correction2 = 1 / (1 - std::pow(kBeta2, static_cast<float>(step + 1)));
    for (size_t i = 0; i < kNbrdfPadded; ++i) {
      const float g = gradient_[i] * scale;
      gradient_[i] = 0;
      moment1_[i] = kBeta1 * moment1_[i] + (1 - kBeta1) * g;
      moment2_[i] = kBeta2 * moment2_[i] + (1 - kBeta2) * g * g;
      network.parameters[i] -=
          rate * correction1 * moment1_[i] / (std::sqrt(moment2_[i] * correction2) + 1e-8f);
    }
  }

  const NbrdfTrainOptions& options_;
  float rate_;
  const PeerKernels& kernels_;
  NbrdfScratch scratch_;
  AlignedBuffer<float> gradient_, moment1_, moment2_;
};

}  // namespace

AlignedBuffer<NbrdfTile> MakeNbrdfTiles(const TrainingPair* pairs, size_t count, bool isotropic) {
  constexpr size_t kChunk = size_t{16} * kNbrdfChunkTiles;
  AlignedBuffer<NbrdfTile> tiles((count + kChunk - 1) / kChunk * kNbrdfChunkTiles);
  for (size_t n = 0; n < count; ++n) {
    const TrainingPair& pair = pairs[n];
    NbrdfTile& tile = tiles[n / 16];
    const size_t l = n % 16;
    const auto put = [&](int i, double x) { tile.x[i][l] = static_cast<float>(x); };
    // In doubles, as written in the paper: the kernel that evaluates is another program.
    const double s[3] = {static_cast<double>(pair.wi.x) + static_cast<double>(pair.wo.x),
                         static_cast<double>(pair.wi.y) + static_cast<double>(pair.wo.y),
                         static_cast<double>(pair.wi.z) + static_cast<double>(pair.wo.z)};
    const double length = std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
    const double theta_h = std::atan2(std::hypot(s[0], s[1]), s[2]);
    const double phi_h = std::atan2(s[1], s[0]);
    const double x = std::cos(phi_h) * static_cast<double>(pair.wi.x) +
                     std::sin(phi_h) * static_cast<double>(pair.wi.y);
    const double y = std::cos(phi_h) * static_cast<double>(pair.wi.y) -
                     std::sin(phi_h) * static_cast<double>(pair.wi.x);
    const double z = static_cast<double>(pair.wi.z);
    put(0, isotropic ? std::sin(theta_h) : s[0] / length);
    put(1, isotropic ? 0 : s[1] / length);
    put(2, std::cos(theta_h));
    put(3, std::cos(theta_h) * x - std::sin(theta_h) * z);
    put(4, y);
    put(5, std::sin(theta_h) * x + std::cos(theta_h) * z);
    for (int c = 0; c < 3; ++c) {
      // Its outputs have the same cap as ours, and the same must not be asked of them.
      const float value = std::min(pair.value[c], brdf::kMaxValue);
      tile.wanted_g[c][l] = Log1p(value * pair.cosine);
      tile.wanted_y[c][l] = Log1p(value);
    }
    tile.cosine[l] = pair.cosine;
    tile.importance[l] = pair.importance;
  }
  return tiles;
}

Result<TrainedNbrdf> TrainNbrdf(const brdf::Source& source, const NbrdfTrainOptions& options,
                                ThreadPool& pool) {
  PATINA_ASSIGN(const SimdTarget target, ActiveSimdTarget());
  brdf::PoolOptions draw;
  draw.count = options.pool + kHeldOut;
  draw.half_angle_share = options.half_angle_share;
  draw.seed = options.seed;
  const std::vector<TrainingPair> pairs = DrawTrainingPairs(source, draw, pool);
  if (pairs.size() < 64)
    return Fail(ErrorCode::kCorruptData, "too few directions have valid data to train on");
  const size_t held_out = std::min(kHeldOut, pairs.size() / 8);
  const size_t count = pairs.size() - held_out;
  const auto train = MakeNbrdfTiles(pairs.data(), count, source.isotropic);
  const auto test = MakeNbrdfTiles(pairs.data() + count, held_out, source.isotropic);
  std::vector<std::unique_ptr<Start>> starts;
  std::vector<double> losses(options.rates.size());
  for (size_t s = 0; s < losses.size(); ++s)
    starts.push_back(std::make_unique<Start>(options, PeerKernelsFor(target), s));
  pool.ParallelFor(static_cast<int>(losses.size()), [&](int s, int) {
    starts[s]->Train(train.data(), train.size());
    losses[s] = starts[s]->Loss(test.data(), test.size());
  });
  // NaN, of a start that came to nothing, is never the least.
  size_t best = 0;
  for (size_t s = 1; s < losses.size(); ++s) {
    if (losses[s] < losses[best] || std::isnan(losses[best])) best = s;
  }
  TrainedNbrdf trained;
  trained.network = std::move(starts[best]->network);
  trained.network.isotropic = source.isotropic;
  trained.held_out_loss = losses[best];
  return trained;
}

}  // namespace patina::bench
