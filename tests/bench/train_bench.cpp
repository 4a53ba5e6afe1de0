// Rates of the training kernels against the machine's own multiply-add peak; scalar against SIMD,
// AVX2 against AVX-512, one and two threads. Usage: patina_train_bench [--size N] [--channels N]
// [--seconds S] [--only network|step]
//
// Every measurement is repeated in turn with the peak of the same target and thread count, and the
// median of the ratios is printed: the machine's speed drifts, the ratio does not. Seconds are CPU
// seconds of the threads that work.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/base/cpu_time.h"
#include "pipeline/base/rng.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/material/channel_stats.h"
#include "pipeline/material/feature_init.h"
#include "pipeline/material/trainer.h"
#include "pipeline/material/window_kernels.h"
#include "tests/bench/fma_peak.h"

namespace patina {
namespace {

// Runs body until `seconds` of CPU time have passed; returns calls per CPU second of one core.
template <class Body>
double Rate(double seconds, Body&& body) {
  long calls = 0, batch = 1;
  const double start = ProcessCpuSeconds();
  double now = start;
  while (now - start < seconds) {
    for (long k = 0; k < batch; ++k) body();
    calls += batch;
    now = ProcessCpuSeconds();
    if (now - start < seconds / 20) batch *= 2;
  }
  return static_cast<double>(calls) / (now - start);
}

std::string CpuName() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  }
  return "unknown CPU";
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// A target with structure at every scale and some noise, so that features and branches behave as on
// real maps.
MaterialReference MakeTarget(int size, int channels) {
  MaterialReference reference;
  reference.pyramid.channels = channels;
  for (int c = 0; c < channels; ++c) {
    TargetChannel channel;
    channel.learned_index = c;
    reference.channels.push_back(channel);
  }
  Rng rng(5);
  for (int side = size; side >= 1; side /= 2) {
    TargetLevel level;
    level.Allocate(side, side, channels);
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const double u = (x + 0.5) / side, v = (y + 0.5) / side;
        for (int c = 0; c < channels; ++c) {
          const double wave = std::sin(40 * u + 3 * c) * std::cos(55 * v + c) +
                              0.4 * std::sin(400 * (u + 0.7 * v) + 2 * c);
          level.Set(x, y, c, static_cast<float>(0.5 + 0.2 * wave) + 0.1f * (rng.Uniform() - 0.5f));
        }
      }
    }
    level.FillPadding(AddressMode::kWrap);
    reference.pyramid.levels.push_back(std::move(level));
  }
  return reference;
}

double PeakGflops(SimdTarget target, int threads, ThreadPool& pool, double seconds) {
  const long iterations = 1'000'000;
  const double flop = 2.0 * kFmaChains *
                      (target == SimdTarget::kAvx512 ? kLanesAvx512 : kLanesAvx2) *
                      static_cast<double>(iterations);
  volatile double keep = 0;
  const double rate = Rate(seconds, [&] {
    pool.ParallelFor(threads, [&](int, int) {
      keep = target == SimdTarget::kAvx512 ? FmaLoopAvx512(iterations) : FmaLoopAvx2(iterations);
    });
  });
  return rate * threads * flop * 1e-9;  // per core: CPU seconds already count both
}

struct Row {
  std::string what;
  double samples_per_s = 0, gflops = 0, peak = 0, share = 0;
};

void Print(const Row& row) {
  std::printf("| %-44s | %8.2f | %8.1f | %8.1f | %5.1f %% |\n", row.what.c_str(),
              row.samples_per_s * 1e-6, row.gflops, row.peak, 100 * row.share);
  std::fflush(stdout);
}

// Interleaves the work with the peak; all figures are per core.
template <class Body>
Row Measure(const std::string& what, SimdTarget target, int threads, ThreadPool& pool,
            double seconds, double samples, double flop, Body&& body) {
  constexpr int kRounds = 7;
  std::vector<double> rates, peaks, shares;
  for (int round = 0; round < kRounds; ++round) {
    const double peak = PeakGflops(target, threads, pool, seconds / kRounds / 3);
    const double rate = Rate(seconds / kRounds, body);
    rates.push_back(rate * samples);
    peaks.push_back(peak);
    shares.push_back(rate * flop * 1e-9 / peak);
  }
  Row row{what, Median(rates), Median(rates) * flop / samples * 1e-9, Median(peaks),
          Median(shares)};
  Print(row);
  return row;
}

void MeasureScalarNetwork(int channels, ThreadPool& pool, double seconds) {
  std::vector<float> params(mlp::ParameterCount(channels));
  Rng rng(1);
  for (float& p : params) p = rng.Uniform() - 0.5f;
  float x[mlp::kInputs], y[mlp::kMaxOutputs];
  for (float& v : x) v = rng.Uniform();
  volatile float keep = 0;
  Measure("network forward, scalar reference", SimdTarget::kAvx2, 1, pool, seconds, 64,
          64 * 2.0 * mlp::ForwardMacs(channels), [&] {
            for (int k = 0; k < 64; ++k) {
              x[k % mlp::kInputs] += 1e-6f;
              mlp::ForwardReference(params.data(), channels, x, y);
              keep = y[0];
            }
          });
}

void MeasureNetwork(SimdTarget target, int threads, int channels, double seconds) {
  ThreadPool pool(threads);
  const MaterialKernels& kernels = KernelsFor(target);
  AlignedBuffer<float> params(mlp::ParameterCount(channels) + 16);
  Rng rng(1);
  for (int k = 0; k < mlp::ParameterCount(channels); ++k) params[k] = rng.Uniform() - 0.5f;
  std::vector<std::unique_ptr<mlp::Chunk>> chunks;
  std::vector<std::unique_ptr<mlp::GradientLanes>> lanes;
  for (int t = 0; t < threads; ++t) {
    chunks.push_back(std::make_unique<mlp::Chunk>());
    lanes.push_back(std::make_unique<mlp::GradientLanes>());
    for (float& v : chunks.back()->x) v = rng.Uniform();
    std::memset(lanes.back().get(), 0, sizeof(mlp::GradientLanes));
  }
  constexpr int kChunks = 256;
  const std::string name = std::string(SimdTargetName(target)) + ", " + std::to_string(threads) +
                           (threads == 1 ? " thread" : " threads");
  const double samples = static_cast<double>(kChunks) * threads * mlp::kChunkSamples;
  Measure("network forward, " + name, target, threads, pool, seconds, samples,
          samples * 2 * mlp::ForwardMacs(channels), [&] {
            pool.ParallelFor(threads, [&](int t, int) {
              for (int k = 0; k < kChunks; ++k)
                kernels.mlp_forward(params.data(), channels, chunks[t].get());
            });
          });
  Measure("network forward and backward, " + name, target, threads, pool, seconds, samples,
          samples * 2 * mlp::TrainMacs(channels), [&] {
            pool.ParallelFor(threads, [&](int t, int) {
              for (int k = 0; k < kChunks; ++k) {
                kernels.mlp_forward(params.data(), channels, chunks[t].get());
                kernels.mlp_backward(params.data(), channels, chunks[t].get(), lanes[t]->sum);
              }
            });
          });
}

void MeasureFullStep(SimdTarget target, int threads, const MaterialReference& reference,
                     double seconds) {
  ThreadPool pool(threads);
  const TargetLevel& base = reference.pyramid.levels[0];
  const ModelShape shape = ShapeForProfile(Profile::kBcf1k, base.width, base.height);
  const ChannelStats stats = MeasureChannels(reference, 1, pool);
  Network network(stats.mean, stats.deviation);
  Rng rng(1);
  InitNetworkFromComponents(stats, stats.deviation, &rng, &network);
  FeatureStore store;
  store.Allocate(shape, BlockForm::kSegments, StoreUse::kAdam);
  InitFeaturesFromComponents(reference, shape, stats, pool, &store);
  for (const bool on_grid : {false, true}) {
    WindowDraw draw;
    if (on_grid) draw.off_grid_share = 0;
    Trainer trainer(reference, shape, &store, &network, KernelsFor(target), pool, 1, draw,
                    WindowsPerStep(base.width, base.height));
    AdamRates features{
        .endpoint = 0.01f, .index = 0.01f, .beta1 = 0.8f, .beta2 = 0.99f, .epsilon = 1e-7f};
    AdamRates net{.endpoint = 1e-4f};
    // Windows of small mips hold fewer samples: count what was drawn.
    double before = 0, steps = 0;
    const auto count = [&] {
      for (int k = 0; k < 200; ++k) trainer.Step(features, net, false);
      steps = 200;
      return trainer.samples() - before;
    };
    const double per_step = count() / steps;
    const std::string name = std::string(SimdTargetName(target)) + ", " + std::to_string(threads) +
                             (threads == 1 ? " thread" : " threads");
    Measure((on_grid ? "full training step, texel centres, " : "full training step, ") + name,
            target, threads, pool, seconds, per_step,
            per_step * 2 * mlp::TrainMacs(reference.pyramid.channels),
            [&] { trainer.Step(features, net, false); });
  }
}

}  // namespace
}  // namespace patina

int main(int argc, char** argv) {
  int size = 2048, channels = 9;
  double seconds = 3;
  std::string only;
  for (int k = 1; k + 1 < argc; k += 2) {
    if (!std::strcmp(argv[k], "--size"))
      size = std::atoi(argv[k + 1]);
    else if (!std::strcmp(argv[k], "--channels"))
      channels = std::atoi(argv[k + 1]);
    else if (!std::strcmp(argv[k], "--seconds"))
      seconds = std::atof(argv[k + 1]);
    else if (!std::strcmp(argv[k], "--only"))
      only = argv[k + 1];
    else
      return std::fprintf(stderr,
                          "usage: patina_train_bench [--size N] [--channels N] [--seconds S] "
                          "[--only network|step]\n"),
             2;
  }
  using namespace patina;
  std::printf("%s; bcf-1k, %d x %d, %d channels; figures per core and CPU second\n\n",
              CpuName().c_str(), size, size, channels);
  std::printf("| %-44s | %8s | %8s | %8s | %7s |\n|---|---|---|---|---|\n", "work", "M sample/s",
              "GFLOP/s", "peak", "share");
  ThreadPool one(1);
  if (only != "step") MeasureScalarNetwork(channels, one, seconds);
  const MaterialReference reference = MakeTarget(size, channels);
  for (const SimdTarget target : {SimdTarget::kAvx2, SimdTarget::kAvx512}) {
    if (!SimdTargetSupported(target)) {
      std::printf("| %s: not on this CPU | | | | |\n", SimdTargetName(target));
      continue;
    }
    for (const int threads : {1, 2}) {
      if (only != "step") MeasureNetwork(target, threads, channels, seconds);
      if (only != "network") MeasureFullStep(target, threads, reference, seconds);
    }
  }
  std::printf(
      "\nFLOPs counted: two for each multiply-add of the network (forward, backward to inputs and "
      "weights) only; decoding,\n"
      "interpolation, filtering and the optimiser are overhead.\n");
  return 0;
}
