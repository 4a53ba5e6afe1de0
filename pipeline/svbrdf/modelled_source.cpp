#include "pipeline/svbrdf/modelled_source.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>
#include <utility>

#include "pipeline/brdf/sample_pool.h"
#include "pipeline/layered/adaptive.h"
#include "pipeline/layered/simulated_source.h"
#include "pipeline/material/mip_filter.h"
#include "pipeline/svbrdf/neural_texture.h"
#include "pipeline/svbrdf/place_drawer.h"

namespace patina::svbrdf {
namespace {

// Places that share a pair of directions: what a pair looks up takes four times a sample's memory.
constexpr size_t kPlacesOfPair = 4;
constexpr size_t kPairsPerTask = 64;
constexpr size_t kTexelsPerTask = 64;
// Of an exact model: up to so many texels of a footprint are summed, beyond they are drawn.
constexpr size_t kMostSummed = 64;
constexpr int kMeasuredPairs = 64;
constexpr uint64_t kMeasuredSeed = 20232;
constexpr float kLowestMeasured = 0.25f;  // z of their directions

// Degrees: light and view from the normal, azimuth between them. From above, beside the mirror's
// direction, and flat across.
struct ShownAngles {
  double light, view, azimuth;
};
constexpr ShownAngles kShown[] = {{30, 5, 90}, {45, 30, 165}, {65, 60, 100}};

brdf::Direction Towards(double theta_deg, double phi_deg) {
  const double theta = theta_deg * std::numbers::pi / 180, phi = phi_deg * std::numbers::pi / 180;
  return {static_cast<float>(std::sin(theta) * std::cos(phi)),
          static_cast<float>(std::sin(theta) * std::sin(phi)), static_cast<float>(std::cos(theta))};
}

uint64_t Mixed(size_t pair, const TexelPlace& place) {
  return (uint64_t{pair} << 48) ^ (static_cast<uint64_t>(place.y) << 24) ^
         static_cast<uint64_t>(place.x);
}

}  // namespace

ModelledSource::ModelledSource(std::shared_ptr<const TexelModel> model,
                               const ModelledOptions& options)
    : model_(std::move(model)), options_(options) {
  while (std::max(width(), height()) > kMaxModelledSide) ++first_mip_;
  for (const ShownAngles& angles : kShown) {
    pairs_.push_back({Towards(angles.light, 0), Towards(angles.view, angles.azimuth),
                      "pair " + std::to_string(pairs_.size())});
  }
  for (int i = static_cast<int>(pairs_.size()); i < kMeasuredPairs; ++i) {
    Rng rng(kMeasuredSeed, static_cast<uint64_t>(i));
    DirectionPair pair;
    do {
      brdf::DrawPair(i % 2 == 0 ? brdf::Draw::kHalfAngles : brdf::Draw::kDirections, &rng,
                     &pair.light, &pair.view);
    } while (pair.light.z < kLowestMeasured || pair.view.z < kLowestMeasured);
    pair.name = "pair " + std::to_string(i);
    pairs_.push_back(std::move(pair));
  }
}

size_t ModelledSource::SamplesWorth(size_t trained, size_t texels) const {
  constexpr size_t kLeast = size_t{1} << 15, kOfATexel = 128;
  return std::min({trained, options_.samples, std::max(kLeast, kOfATexel * texels)});
}

layered::Estimate ModelledSource::Estimate(const FootprintFinder& finder,
                                           const Footprint& footprint, const brdf::Direction& wi,
                                           const brdf::Direction& wo,
                                           const layered::Accuracy& accuracy, Rng* rng) const {
  if (model_->exact() && finder.MostTexels(footprint) <= kMostSummed) {
    layered::Estimate estimate;
    finder.ForEach(footprint, [&](size_t texel, double weight) {
      double sum[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
      model_->AddDraws(texel, wi, wo, 1, rng, sum, squares);
      for (size_t c = 0; c < 3; ++c) estimate.f[c] += weight * sum[c];
    });
    return estimate;
  }
  const bool is_texel = footprint.count == 1 && footprint.taps[0].level == 0;
  const auto add = [&](int draws, Rng* from, double sum[3], double squares[3]) {
    if (is_texel) {
      return model_->AddDraws(finder.Draw(footprint, from), wi, wo, draws, from, sum, squares);
    }
    for (int i = 0; i < draws; ++i)
      model_->AddDraws(finder.Draw(footprint, from), wi, wo, 1, from, sum, squares);
  };
  const Rng pilot(rng->Next()), main(rng->Next());
  return layered::EstimateTo(accuracy, wi, wo, pilot, main, add);
}

Result<TexelPool> ModelledSource::Draw(const TexelPoolOptions& options, ThreadPool& pool) const {
  const size_t pairs = std::max<size_t>(1, (options.count + kPlacesOfPair - 1) / kPlacesOfPair);
  TexelPool drawn;
  drawn.lookups.Reset(pairs);
  drawn.samples.resize(kPlacesOfPair * pairs);
  const PlaceDrawer places(width(), height(), options.levels);
  const FootprintFinder finder = Finder(options.levels);
  std::atomic<size_t> done{0};
  std::atomic<uint64_t> paths{0}, squares{0};
  const size_t tasks = (pairs + kPairsPerTask - 1) / kPairsPerTask;
  pool.ParallelFor(static_cast<int>(tasks), [&](int task, int worker) {
    if (options.cancel != nullptr && options.cancel->cancelled()) return;
    const size_t begin = static_cast<size_t>(task) * kPairsPerTask,
                 end = std::min(pairs, begin + kPairsPerTask);
    uint64_t task_paths = 0, task_squares = 0;
    for (size_t pair = begin; pair < end; ++pair) {
      Rng rng(options.seed, pair + 1);
      brdf::Direction wi, wo;
      brdf::DrawPair(rng.Uniform() < 0.5f ? brdf::Draw::kHalfAngles : brdf::Draw::kDirections, &rng,
                     &wi, &wo);
      brdf::PoolSample& lookup = drawn.lookups[pair];
      brdf::LookUpPair(options.grid, wi, wo, &lookup);
      lookup.cosine = options.grid.canonical_order ? std::max(wi.z, wo.z) : wi.z;
      for (size_t k = 0; k < kPlacesOfPair; ++k) {
        TexelSample& sample = drawn.samples[kPlacesOfPair * pair + k];
        sample.pair = static_cast<uint32_t>(pair);
        places.Draw(&rng, &sample.u, &sample.v, &sample.s);
        const layered::Estimate estimate =
            Estimate(finder, FootprintAt(finder, sample.u, sample.v, sample.s), wi, wo,
                     options_.learned, &rng);
        for (size_t c = 0; c < 3; ++c)
          sample.value[c] =
              static_cast<float>(std::min(estimate.f[c], static_cast<double>(brdf::kMaxValue)));
        const double error = layered::Simulator::StandardError(estimate, wi, wo);
        sample.importance = static_cast<float>(layered::TrustOf(error));
        task_paths += static_cast<uint64_t>(estimate.spent);
        task_squares += layered::CountedSquare(error);
      }
    }
    paths.fetch_add(task_paths, std::memory_order_relaxed);
    squares.fetch_add(task_squares, std::memory_order_relaxed);
    const size_t count = done.fetch_add(1, std::memory_order_relaxed) + 1;
    if (worker == 0 && options.on_progress)
      options.on_progress(static_cast<double>(count) / static_cast<double>(tasks));
  });
  if (options.cancel != nullptr && options.cancel->cancelled())
    return Fail(ErrorCode::kCancelled, "interrupted");
  if (!model_->exact()) {
    drawn.cost.pairs = drawn.samples.size();
    drawn.cost.paths = paths.load();
    drawn.cost.standard_error = layered::MeanOfCounted(squares.load(), drawn.cost.pairs);
  }
  Shuffle(options.seed, &drawn.samples);
  if (options.features > 0) drawn.start = StartOf(options.levels, options.features, pool);
  return drawn;
}

// The numbers of the texels, of mean 0 and deviation 1, those that vary; on coarser levels means.
std::vector<float> ModelledSource::StartOf(int levels, int features, ThreadPool& pool) const {
  const int numbers = model_->numbers();
  const auto columns = static_cast<size_t>(model_->width());
  PlaneLevel level;
  level.Allocate(model_->width(), model_->height(), numbers);
  pool.ParallelFor(model_->height(), [&](int y, int) {
    std::vector<float> row(static_cast<size_t>(numbers));
    for (size_t x = 0; x < columns; ++x) {
      model_->Numbers(static_cast<size_t>(y) * columns + x, row.data());
      for (int n = 0; n < numbers; ++n) level.Row(n, y)[x] = row[static_cast<size_t>(n)];
    }
  });
  for (int l = 0; l < first_mip_; ++l) level = NextLevel(level, pool);
  struct Used {
    int number;
    double mean, deviation;
  };
  std::vector<Used> used;
  const size_t texels = static_cast<size_t>(level.width) * static_cast<size_t>(level.height);
  for (int n = 0; n < numbers && used.size() < static_cast<size_t>(features); ++n) {
    const float* plane = level.Row(n, 0);
    double sum = 0, squares = 0;
    for (size_t i = 0; i < texels; ++i) sum += static_cast<double>(plane[i]);
    const double mean = sum / static_cast<double>(texels);
    for (size_t i = 0; i < texels; ++i) {
      const double d = static_cast<double>(plane[i]) - mean;
      squares += d * d;
    }
    const double deviation = std::sqrt(squares / static_cast<double>(texels));
    if (deviation > 1e-6 * std::max(1.0, std::abs(mean))) used.push_back({n, mean, deviation});
  }
  std::vector<float> start;
  for (int l = 0; l < levels; ++l) {
    if (l > 0) level = NextLevel(level, pool);
    const size_t first = start.size();
    const size_t count = static_cast<size_t>(level.width) * static_cast<size_t>(level.height);
    start.resize(first + count * kRowFloats);
    for (size_t u = 0; u < used.size(); ++u) {
      const float* plane = level.Row(used[u].number, 0);
      for (size_t i = 0; i < count; ++i) {
        start[first + i * kRowFloats + u] =
            static_cast<float>((static_cast<double>(plane[i]) - used[u].mean) / used[u].deviation);
      }
    }
  }
  return start;
}

Result<std::vector<float>> ModelledSource::Values(size_t pair, std::span<const TexelPlace> texels,
                                                  ThreadPool& pool) const {
  const FootprintFinder finder = Finder(1);
  std::vector<float> values(3 * texels.size());
  const DirectionPair& directions = pairs_[pair];
  const size_t tasks = (texels.size() + kTexelsPerTask - 1) / kTexelsPerTask;
  pool.ParallelFor(static_cast<int>(tasks), [&](int task, int) {
    const size_t begin = static_cast<size_t>(task) * kTexelsPerTask,
                 end = std::min(texels.size(), begin + kTexelsPerTask);
    for (size_t i = begin; i < end; ++i) {
      Rng rng(options_.seed ^ kMeasuredSeed, Mixed(pair, texels[i]));
      Footprint footprint;
      footprint.count = 1;
      footprint.taps[0] = {first_mip_, texels[i].x, texels[i].y, 1};
      const layered::Estimate estimate =
          Estimate(finder, footprint, directions.light, directions.view, options_.measured, &rng);
      for (size_t c = 0; c < 3; ++c) values[3 * i + c] = static_cast<float>(estimate.f[c]);
    }
  });
  return values;
}

}  // namespace patina::svbrdf
