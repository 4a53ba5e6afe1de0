// How much faster a baked BRDF is than the simulation that it was learned from, at equal error of
// an image, and after how many evaluations learning it has paid.
//
//   patina_layered_speedup [--side N] [--reference PATHS] [--quality preview|standard|reference]
//                          [--threads N] FILE.layers.json ...
//
// The image is the sphere of the previews (StudioEnvironment of 32 x 16 lights): linear, clamped to
// [0, 1]. Its error is the mean square over the sphere's pixels against the converged simulation.
// That of a simulation with n paths for each pair of directions falls as a / n; a is measured, and
// the share of the reference's own noise, a / PATHS, is taken off what is measured. Times are
// processor seconds of one thread for the same pairs of directions.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "formats/index_pack.h"
#include "formats/layered/layered_file.h"
#include "pipeline/base/cpu_time.h"
#include "pipeline/brdf/batch_evaluator.h"
#include "pipeline/brdf/sphere_render.h"
#include "pipeline/brdf/train_brdf.h"
#include "pipeline/jobs/brdf_job.h"
#include "pipeline/layered/simulated_source.h"

namespace patina {
namespace {

using brdf::Direction;

constexpr float kExposure = 2;
constexpr uint64_t kReferenceSeed = 1001;

struct Options {
  int side = 64;
  int reference_paths = 256;
  int threads = 0;
  Quality quality = Quality::kStandard;
  std::vector<std::string> files;
};

brdf::EvaluatePairs Simulated(const layered::Simulator& simulator, int paths, uint64_t seed) {
  return [&simulator, paths, seed](int, size_t count, const Direction* wi, const Direction* wo,
                                   float* rgb) {
    for (size_t i = 0; i < count; ++i) {
      // A stream of its own for each pair and seed; one path has no variance to state.
      Rng rng(seed * 1000003 + i, std::bit_cast<uint32_t>(wi[i].x) ^
                                      (uint64_t{std::bit_cast<uint32_t>(wo[i].x)} << 32) ^
                                      (uint64_t{std::bit_cast<uint32_t>(wi[i].y)} << 16));
      double sum[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
      simulator.AddPaths(wi[i], wo[i], paths, &rng, sum, squares);
      for (size_t c = 0; c < 3; ++c) rgb[3 * i + c] = static_cast<float>(sum[c] / paths);
    }
  };
}

// Mean square over channels and pixels of the sphere, clamped to [0, 1].
double MeanSquare(const brdf::SphereImage& a, const brdf::SphereImage& b) {
  double sum = 0, count = 0;
  for (size_t p = 0; p < a.inside.size(); ++p) {
    if (a.inside[p] == 0) continue;
    for (size_t c = 0; c < 3; ++c) {
      const double d = static_cast<double>(std::clamp(a.rgb[3 * p + c], 0.0f, 1.0f)) -
                       static_cast<double>(std::clamp(b.rgb[3 * p + c], 0.0f, 1.0f));
      sum += d * d;
      ++count;
    }
  }
  return sum / count;
}

// Pairs in the order of the image, for timing.
struct Pairs {
  std::vector<Direction> wi, wo;
};
Pairs SomePairs(const brdf::Environment& lights, int side, ThreadPool& one_thread) {
  Pairs pairs;
  const auto collect = [&pairs](int, size_t count, const Direction* wi, const Direction* wo,
                                float* rgb) {
    for (size_t i = 0; i < count; ++i) {
      if (i % 7 == 0) {
        pairs.wi.push_back(wi[i]);
        pairs.wo.push_back(wo[i]);
      }
    }
    std::fill(rgb, rgb + 3 * count, 0.0f);
  };
  brdf::RenderSphere(collect, lights, side, kExposure, one_thread);
  return pairs;
}

Status Measure(const std::string& file, const Options& options, ThreadPool& pool) {
  PATINA_ASSIGN(const layered::Stack stack, layered::ReadStack(file));
  Job job;
  job.quality = options.quality;
  const double start_cpu = ProcessCpuSeconds();
  PATINA_ASSIGN(const brdf::Source source, layered::SimulatedSource(stack, EffortOfJob(job)));
  const brdf::SourceKind kind = brdf::KindOf(source);
  PATINA_ASSIGN(
      const brdf::TrainedBrdf trained,
      brdf::TrainBrdf(source, ModelOfJob(job, kind), TrainingOfJob(job, kind), pool, NoProgress()));
  const double learning_s = ProcessCpuSeconds() - start_cpu;
  PATINA_ASSIGN(const std::vector<float> features,
                ExpandCorners(trained.pack, {trained.pack.primitive_size, trained.pack.codebook}));
  PATINA_ASSIGN(const brdf::BatchEvaluator evaluator,
                brdf::BatchEvaluator::Create(trained.pack, features, trained.network));
  std::vector<std::unique_ptr<brdf::BatchEvaluator::Scratch>> scratch;
  for (int t = 0; t < pool.threads(); ++t)
    scratch.push_back(std::make_unique<brdf::BatchEvaluator::Scratch>(evaluator));
  const brdf::EvaluatePairs neural = [&](int worker, size_t count, const Direction* wi,
                                         const Direction* wo, float* rgb) {
    evaluator.Evaluate(scratch[static_cast<size_t>(worker)].get(), count, wi, wo, rgb);
  };

  const layered::Simulator simulator(stack);
  const brdf::Environment lights = brdf::StudioEnvironment(32, 16);
  const auto render = [&](const brdf::EvaluatePairs& evaluate) {
    return brdf::RenderSphere(evaluate, lights, options.side, kExposure, pool);
  };
  const brdf::SphereImage reference =
      render(Simulated(simulator, options.reference_paths, kReferenceSeed));
  const brdf::SphereImage learned = render(neural);
  // a of a / n, from images of one path for each pair: (1 + 1 / PATHS) a is what they differ by.
  constexpr int kImages = 4;
  double noise = 0;
  for (uint64_t image = 1; image <= kImages; ++image)
    noise += MeanSquare(render(Simulated(simulator, 1, image)), reference) / kImages;
  noise /= 1 + 1.0 / options.reference_paths;
  const double measured = MeanSquare(learned, reference);
  const double own = measured - noise / options.reference_paths;
  const double ssim = brdf::CompareSpheres(reference, learned, pool).ssim;

  ThreadPool one_thread(1);
  const Pairs pairs = SomePairs(lights, 24, one_thread);
  std::vector<float> rgb(3 * pairs.wi.size());
  std::vector<double> ratios, path_ns, neural_ns;
  for (int round = 0; round < 7; ++round) {
    double start = ThreadCpuSeconds();
    Simulated(simulator, 1, 1)(0, pairs.wi.size(), pairs.wi.data(), pairs.wo.data(), rgb.data());
    const double simulated_s = ThreadCpuSeconds() - start;
    constexpr int kRepeats = 8;
    start = ThreadCpuSeconds();
    for (int repeat = 0; repeat < kRepeats; ++repeat)
      neural(0, pairs.wi.size(), pairs.wi.data(), pairs.wo.data(), rgb.data());
    const double neural_s = (ThreadCpuSeconds() - start) / kRepeats;
    ratios.push_back(simulated_s / neural_s);
    path_ns.push_back(1e9 * simulated_s / static_cast<double>(pairs.wi.size()));
    neural_ns.push_back(1e9 * neural_s / static_cast<double>(pairs.wi.size()));
  }
  const auto median = [](std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v[v.size() / 2];
  };
  const std::string name = std::filesystem::path(file).filename().string();
  if (!(own > 0)) {
    std::printf("%-28s SSIM %.4f; the error is below the noise of the reference: give more paths\n",
                name.c_str(), ssim);
    return {};
  }
  const double paths = noise / own;
  const double saved_ns = paths * median(path_ns) - median(neural_ns);
  const brdf::SimulationCost cost = source.simulated->Spent();
  std::printf("%-28s %7.4f %9.2e %8.0f %8.0f %8.0f %9.1f %9.1f %9.2f %9.4f\n", name.c_str(), ssim,
              own, paths, median(path_ns), median(neural_ns), paths * median(ratios), learning_s,
              learning_s / (1e-9 * saved_ns) * 1e-6, cost.standard_error);
  std::fflush(stdout);
  return {};
}

bool Read(int argc, char** argv, Options* options) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool has_value = i + 1 < argc;
    if (word == "--side" && has_value) {
      options->side = std::atoi(argv[++i]);
    } else if (word == "--reference" && has_value) {
      options->reference_paths = std::atoi(argv[++i]);
    } else if (word == "--threads" && has_value) {
      options->threads = std::atoi(argv[++i]);
    } else if (word == "--quality" && has_value) {
      const std::string quality = argv[++i];
      options->quality = quality == "preview"     ? Quality::kPreview
                         : quality == "reference" ? Quality::kReference
                                                  : Quality::kStandard;
    } else if (word.rfind("--", 0) == 0) {
      return false;
    } else {
      options->files.push_back(word);
    }
  }
  return !options->files.empty() && options->side >= 8 && options->side <= 1024 &&
         options->reference_paths >= 2 && options->threads >= 0;
}

int Main(int argc, char** argv) {
  Options options;
  if (!Read(argc, argv, &options)) {
    std::fprintf(stderr,
                 "usage: patina_layered_speedup [--side N] [--reference PATHS] [--threads N]\n"
                 "         [--quality preview|standard|reference] FILE.layers.json ...\n");
    return 2;
  }
  ThreadPool pool(options.threads);
  std::printf("%-28s %7s %9s %8s %8s %8s %9s %9s %9s %9s\n", "material", "SSIM", "MSE", "paths",
              "ns/path", "ns/eval", "speed-up", "learn, s", "pays at,M", "std.error");
  for (const std::string& file : options.files) {
    if (const Status status = Measure(file, options, pool); !status) {
      std::fprintf(stderr, "%s\n", status.error().message.c_str());
      return 1;
    }
  }
  std::printf(
      "paths: for each pair of directions, until the image is as good as the learned one; "
      "speed-up: their time over that of one evaluation, on one core; pays at: millions of "
      "evaluations after which learning has paid\n");
  return 0;
}

}  // namespace
}  // namespace patina

int main(int argc, char** argv) { return patina::Main(argc, argv); }
