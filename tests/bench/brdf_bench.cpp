// Speed of the BRDF kernels: training steps against the machine's own multiply-add peak, evaluation
// against a trilinear table of MERL's size. Usage: patina_brdf_bench [--seconds S]
//
// As in patina_train_bench, a measurement alternates with what it is compared with, and medians of
// ratios are printed. Seconds are CPU seconds of one core. FLOPs counted: two for each multiply-add
// of the network that does work (padding, lookups, loss and optimiser are overhead).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "formats/brdf/merl.h"
#include "formats/brdf/write_brdf.h"
#include "pipeline/base/cpu_time.h"
#include "pipeline/base/rng.h"
#include "pipeline/brdf/batch_evaluator.h"
#include "pipeline/brdf/grid_trainer.h"
#include "pipeline/brdf/train_brdf.h"
#include "tests/bench/fma_peak.h"

namespace patina::brdf {
namespace {

constexpr int kRounds = 7;

// Calls per CPU second.
double Rate(double seconds, const std::function<void()>& body) {
  long calls = 0;
  const double start = ProcessCpuSeconds();
  double now = start;
  while (now - start < seconds) {
    for (int k = 0; k < 4; ++k) body();
    calls += 4;
    now = ProcessCpuSeconds();
  }
  return static_cast<double>(calls) / (now - start);
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// Of one core while all threads of the pool work.
double PeakGflops(SimdTarget target, ThreadPool& pool, double seconds) {
  constexpr long kIterations = 200000;
  volatile double keep = 0;
  const bool wide = target == SimdTarget::kAvx512;
  const double rate = Rate(seconds, [&] {
    pool.ParallelFor(pool.threads(), [&](int, int) {
      keep = wide ? FmaLoopAvx512(kIterations) : FmaLoopAvx2(kIterations);
    });
  });
  return rate * pool.threads() * kIterations * kFmaChains * (wide ? kLanesAvx512 : kLanesAvx2) * 2 *
         1e-9;
}

// A glossy reciprocal material.
void Glossy(const Direction& wi, const Direction& wo, float rgb[3]) {
  const float hx = wi.x + wo.x, hy = wi.y + wo.y, hz = wi.z + wo.z;
  const float tangent = (hx * hx + hy * hy) / std::max(hz * hz, 1e-6f);
  const float peak = 20 * std::exp(-tangent / 0.02f);
  rgb[0] = 0.10f + peak;
  rgb[1] = 0.06f + peak;
  rgb[2] = 0.03f + peak;
}

class GlossyTable : public Table {
 public:
  bool Evaluate(const Direction& wi, const Direction& wo, float rgb[3]) const override {
    Glossy(wi, wo, rgb);
    return true;
  }
};

struct Row {
  const char* name;
  int nside, hidden, hidden_layers;
  bool angles;
  healpix::Interpolation rule;
};

constexpr Row kRows[] = {
    {"default: Nside 16, 32 x 3, bilinear", 16, 32, 3, true, healpix::Interpolation::kBilinear},
    {"inverse distance", 16, 32, 3, true, healpix::Interpolation::kInverseDistance},
    {"uniform", 16, 32, 3, true, healpix::Interpolation::kUniform},
    {"16 x 2", 16, 16, 2, true, healpix::Interpolation::kBilinear},
    {"32 x 2", 16, 32, 2, true, healpix::Interpolation::kBilinear},
    {"64 x 2", 16, 64, 2, true, healpix::Interpolation::kBilinear},
    {"64 x 3", 16, 64, 3, true, healpix::Interpolation::kBilinear},
    {"Nside 32", 32, 32, 3, true, healpix::Interpolation::kBilinear},
    {"Nside 64", 64, 32, 3, true, healpix::Interpolation::kBilinear},
    {"no scalar inputs", 16, 32, 3, false, healpix::Interpolation::kBilinear},
    {"the paper's: Nside 64, 64 x 2, plain", 64, 64, 2, false, healpix::Interpolation::kBilinear},
};

Source GlossySource() {
  Source source;
  source.table = std::make_shared<GlossyTable>();
  return source;
}

int TrainingTable(double seconds) {
  const int batch = DefaultTraining({}).batch;
  std::printf(
      "Training, batches of %d samples\n\n| model | target | threads | M sample/s | GFLOP/s | "
      "peak | share |\n|---|---|---|---|---|---|---|\n",
      batch);
  const Source source = GlossySource();
  for (const SimdTarget target : {SimdTarget::kAvx2, SimdTarget::kAvx512}) {
    if (!SimdTargetSupported(target)) continue;
    for (const int threads : {1, 2}) {
      for (const Row& row : {kRows[0], kRows[4], kRows[6]}) {
        ThreadPool pool(threads);
        GridShape grid;
        grid.nside = row.nside;
        PoolOptions options;
        options.count = size_t{1} << 18;
        const AlignedBuffer<PoolSample> samples = DrawPool(source, grid, options, pool);
        const NetworkLayout layout(16, 3, row.hidden, row.hidden_layers);
        GridTrainer trainer(layout, 2 * grid.corners(), KernelsFor(target), pool, 1);
        size_t next = 0;
        std::vector<double> rates, peaks, shares;
        for (int round = 0; round < kRounds; ++round) {
          peaks.push_back(PeakGflops(target, pool, seconds / 2));
          const double steps = Rate(seconds, [&] {
            trainer.Step(samples.data() + next, batch, {1e-4f, 1e-4f});
            next = (next + batch) % (samples.size() - batch);
          });
          rates.push_back(steps * batch);
          shares.push_back(rates.back() * 6 * layout.ForwardMacs() * 1e-9 / peaks.back());
        }
        const double rate = Median(rates);
        std::printf("| %d x %d | %s | %d | %.2f | %.1f | %.1f | %.1f %% |\n", row.hidden,
                    row.hidden_layers, SimdTargetName(target), threads, rate * 1e-6,
                    rate * 6 * layout.ForwardMacs() * 1e-9, Median(peaks), 100 * Median(shares));
        std::fflush(stdout);
      }
    }
  }
  return 0;
}

int EvaluationTable(double seconds) {
  ThreadPool pool(1);
  auto table = ParseMerl(EncodeMerl(Glossy), "the table");
  if (!table) {
    std::fprintf(stderr, "%s\n", table.error().message.c_str());
    return 1;
  }
  constexpr int kBatch = 4096;
  std::vector<Direction> wi(kBatch), wo(kBatch);
  Rng rng(3);
  for (int n = 0; n < kBatch; ++n) DrawPair(Draw::kDirections, &rng, &wi[n], &wo[n]);
  std::vector<float> rgb(3 * kBatch);
  const auto table_ns = [&] {
    return 1e9 / kBatch / Rate(seconds, [&] {
             for (int n = 0; n < kBatch; ++n)
               table->table->Evaluate(wi[n], wo[n], rgb.data() + 3 * n);
           });
  };
  std::printf(
      "\nEvaluation, one core, batches of %d random pairs; the trilinear table of MERL's size (33 "
      "MB as doubles) in the same run\n\n"
      "| model | ns | table, ns | ratio |\n|---|---|---|---|\n",
      kBatch);
  TrainOptions options;
  options.pool = 20000;
  options.free_steps = options.codebook_steps = 50;
  for (const Row& row : kRows) {
    ModelShape shape;
    shape.grid.nside = row.nside;
    shape.grid.interpolation = row.rule;
    shape.grid.angle_inputs = shape.grid.canonical_order = row.angles;
    shape.hidden = row.hidden;
    shape.hidden_layers = row.hidden_layers;
    auto trained = TrainBrdf(GlossySource(), shape, options, pool, NoProgress());
    auto features = trained ? ExpandCorners(trained->pack,
                                            {trained->pack.primitive_size, trained->pack.codebook})
                            : Fail(trained.error());
    auto evaluator = features ? BatchEvaluator::Create(trained->pack, *features, trained->network)
                              : Fail(features.error());
    if (!evaluator) {
      std::fprintf(stderr, "%s\n", evaluator.error().message.c_str());
      return 1;
    }
    BatchEvaluator::Scratch scratch(*evaluator);
    std::vector<double> ours, theirs, ratios;
    for (int round = 0; round < kRounds; ++round) {
      theirs.push_back(table_ns());
      ours.push_back(1e9 / kBatch / Rate(seconds, [&] {
                       evaluator->Evaluate(&scratch, kBatch, wi.data(), wo.data(), rgb.data());
                     }));
      ratios.push_back(ours.back() / theirs.back());
    }
    std::printf("| %s | %.0f | %.0f | %.2f |\n", row.name, Median(ours), Median(theirs),
                Median(ratios));
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace patina::brdf

int main(int argc, char** argv) {
  double seconds = 0.2;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--seconds") == 0 && i + 1 < argc) {
      seconds = std::atof(argv[++i]);
    } else {
      std::fprintf(stderr, "usage: patina_brdf_bench [--seconds S]\n");
      return 2;
    }
  }
  if (!(seconds > 0)) {
    std::fprintf(stderr, "patina_brdf_bench: --seconds must be above 0\n");
    return 2;
  }
  const int status = patina::brdf::TrainingTable(seconds);
  return status != 0 ? status : patina::brdf::EvaluationTable(seconds);
}
