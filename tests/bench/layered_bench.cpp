// What each effect of a layered material costs, and what an absent one does: nothing.
//
//   patina_layered_bench [--paths N]
//
// Times are processor time of one thread; programs that are compared take turns in one process.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/base/cpu_time.h"
#include "pipeline/layered/presets.h"
#include "pipeline/layered/simulator.h"

namespace patina::layered {
namespace {

constexpr int kRounds = 9;
// Where a few hundredths count: turns so short that what else the machine does meets all programs.
constexpr int kShortRounds = 181;

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// Processor seconds of each program in each round; programs take turns.
std::vector<std::vector<double>> Alternate(const std::vector<std::function<void()>>& programs,
                                           int rounds) {
  std::vector<std::vector<double>> times(programs.size());
  for (int round = 0; round < rounds; ++round) {
    for (size_t p = 0; p < programs.size(); ++p) {
      const double start = ThreadCpuSeconds();
      programs[p]();
      times[p].push_back(ThreadCpuSeconds() - start);
    }
  }
  return times;
}

// Median over the rounds.
double Ratio(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> ratios;
  for (size_t i = 0; i < a.size(); ++i) ratios.push_back(a[i] / b[i]);
  return Median(ratios);
}

const Vec kWi = Normalized({0.6, 0, 0.8});
const Vec kWo = Normalized({-0.36, 0.48, 0.8});

double Uniform(Rng* rng) { return static_cast<double>(rng->Next() >> 11) * 0x1p-53; }

// A rough dielectric over a grey diffuse base, and nothing else: written by hand for this one
// material, the same walk with the same random numbers as the simulator's kernel.
struct ByHand {
  Ggx ggx;
  double eta, albedo;

  Vec Facet(const Vec& w, double index, Rng* rng, double* cosine, double* cos_t,
            double* fresnel) const {
    const double u0 = Uniform(rng), u1 = Uniform(rng);
    const Vec m = ggx.SampleVisible(w, u0, u1);
    *cosine = std::clamp(Dot(w, m), 0.0, 1.0);
    *fresnel = FresnelDielectric(*cosine, index, cos_t);
    return m;
  }

  double Path(const Vec& wi, const Vec& wo, double mirrored, Rng* rng) const {
    double total = mirrored, cosine, cos_t, fresnel;
    // The way out.
    bool has_way_out = false;
    Vec out;
    double gain = 0, inverse_pdf = 0;
    Vec m = Facet(wo, eta, rng, &cosine, &cos_t, &fresnel);
    Vec t = (-1 / eta) * wo + (cosine / eta - cos_t) * m;
    if (cos_t > 0 && cosine > 0 && t.z < 0) {
      const FacetCrossing crossing = CrossingAt(ggx, wo, t, m, cosine, cos_t, fresnel, eta);
      if (crossing.pdf > 0) {
        has_way_out = true;
        out = -t;
        inverse_pdf = 1 / crossing.pdf;
        gain = 1 / wo.z * (crossing.value / crossing.pdf * wo.z / (eta * eta * out.z));
      }
    }
    // The way in.
    m = Facet(wi, eta, rng, &cosine, &cos_t, &fresnel);
    t = (-1 / eta) * wi + (cosine / eta - cos_t) * m;
    if (!(cos_t > 0 && cosine > 0 && t.z < 0)) return total;
    double light = (1 - fresnel) * ggx.Masking(t);
    for (int events = 1;;) {
      if (!(light > 0)) return total;
      if (events >= 4 && light < 0.25) {
        if (!(Uniform(rng) < light / 0.25)) return total;
        light = 0.25;
      }
      ++events;
      if (has_way_out) {
        const double lobe = out.z / kPi;
        total += light * (albedo * lobe) * gain / (1 + lobe * inverse_pdf);
      }
      const double u = Uniform(rng);
      double sine, cosine_phi;
      SinCosTurns(Uniform(rng), &sine, &cosine_phi);
      const double r = std::sqrt(u);
      const Vec w{-r * cosine_phi, -r * sine, std::sqrt(1 - u)};  // as if from above
      light *= albedo;
      // The surface from below.
      if (!(light > 0)) return total;
      if (events >= 4 && light < 0.25) {
        if (!(Uniform(rng) < light / 0.25)) return total;
        light = 0.25;
      }
      ++events;
      const double links = 1 / (w.z / kPi);
      const FacetCrossing crossing = EvaluateCrossing(ggx, w, {wo.x, wo.y, -wo.z}, 1 / eta);
      if (crossing.value > 0)
        total += light * (crossing.value / wo.z / (1 + links * crossing.reverse_pdf));
      m = Facet(w, 1 / eta, rng, &cosine, &cos_t, &fresnel);
      if (!(Uniform(rng) < fresnel)) return total;
      const Vec reflected = 2 * cosine * m + -w;
      if (!(reflected.z > 0)) return total;
      const double lambda = ggx.Lambda(w);
      light *= (1 + lambda) / (1 + lambda + ggx.Lambda(reflected));
    }
  }

  // Called like a kernel, and summed up as there: directions that the compiler knows, or stores
  // that it must fear, would make it another comparison.
  [[gnu::noinline]] void Run(const Vec& wi, const Vec& wo, int paths, Rng* rng, double sum[3],
                             double squares[3]) const {
    const FacetReflection top = EvaluateReflection(ggx, wi, wo);
    double cos_t;
    const double mirrored = top.value / wo.z * FresnelDielectric(top.cosine, eta, &cos_t);
    double sums[3], sums_of_squares[3];
    std::copy_n(sum, 3, sums);
    std::copy_n(squares, 3, sums_of_squares);
    Rng own = *rng;
    for (int path = 0; path < paths; ++path) {
      const double f = Path(wi, wo, mirrored, &own);
      for (int c = 0; c < 3; ++c) {
        sums[c] += f;
        sums_of_squares[c] += f * f;
      }
    }
    std::copy_n(sums, 3, sum);
    std::copy_n(sums_of_squares, 3, squares);
    *rng = own;
  }
};

Layer Coat(double alpha) {
  Layer layer;
  layer.roughness = {alpha, alpha, 0};
  return layer;
}
BasePart Grey() {
  BasePart part;
  part.albedo = {0.5, 0.5, 0.5};
  return part;
}

// The sums of a run; printed, so that none of it can be left out.
struct Sums {
  double sum[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
};

int CompareByHand(int paths_in_all) {
  const int paths = std::max(100, paths_in_all / 20);
  Stack stack;
  stack.layers = {Coat(0.15)};
  stack.parts = {Grey()};
  const PreparedStack prepared = Prepare(stack);
  const EstimateKernel kernel = KernelFor(prepared.effects);
  const Effects all{true, true, true, true, true, true};
  const EstimateKernel everything = KernelFor(all);
  const ByHand by_hand{prepared.interfaces[0].surface.ggx, prepared.interfaces[0].eta, 0.5};
  Sums own, hand, full;
  const auto reset = [](Sums* sums) { *sums = Sums(); };
  const std::vector<std::function<void()>> programs = {
      [&] {
        reset(&own);
        Rng rng(1);
        kernel(prepared, kWi, kWo, paths, &rng, own.sum, own.squares);
      },
      [&] {
        reset(&hand);
        Rng rng(1);
        by_hand.Run(kWi, kWo, paths, &rng, hand.sum, hand.squares);
      },
      [&] {
        reset(&full);
        Rng rng(1);
        everything(prepared, kWi, kWo, paths, &rng, full.sum, full.squares);
      },
  };
  const std::vector<std::vector<double>> times = Alternate(programs, kShortRounds);
  const auto ns_per_path = [&](size_t program) { return 1e9 * Median(times[program]) / paths; };
  std::printf("\nRough dielectric over grey diffuse, %d paths, medians of %d turns:\n", paths,
              kShortRounds);
  std::printf("  kernel of these effects   %7.1f ns a path, f %.5f\n", ns_per_path(0),
              own.sum[0] / paths);
  std::printf("  written by hand           %7.1f ns a path, f %.5f\n", ns_per_path(1),
              hand.sum[0] / paths);
  std::printf("  kernel of all effects     %7.1f ns a path, f %.5f\n", ns_per_path(2),
              full.sum[0] / paths);
  std::printf("  kernel over hand-written %.3f; all effects over kernel %.2f\n",
              Ratio(times[0], times[1]), Ratio(times[2], times[0]));
  if (std::abs(own.sum[0] - hand.sum[0]) > 1e-6 * hand.sum[0]) {
    std::printf("  THE TWO DIFFER\n");
    return 1;
  }
  return 0;
}

void PrintEffects(int paths) {
  struct Row {
    const char* name;
    Stack stack;
  };
  std::vector<Row> rows;
  const auto add = [&](const char* name, const std::function<void(Stack*)>& change) {
    Stack stack;
    stack.layers = {Coat(0.15)};
    stack.parts = {Grey()};
    change(&stack);
    rows.push_back({name, stack});
  };
  add("smooth over diffuse", [](Stack* s) { s->layers = {Coat(0)}; });
  add("rough over diffuse (base line)", [](Stack*) {});
  add("+ colour", [](Stack* s) { s->parts[0].albedo = {0.6, 0.5, 0.4}; });
  add("+ anisotropy", [](Stack* s) { s->layers[0].roughness = {0.3, 0.1, 0.5}; });
  add("+ a conductor as the base", [](Stack* s) {
    s->parts[0].kind = BaseKind::kConductor;
    s->parts[0].eta = s->parts[0].k = {2, 2, 2};
    s->parts[0].roughness = {0.2, 0.2, 0};
  });
  add("+ a second rough layer", [](Stack* s) {
    s->layers.push_back(Coat(0.2));
    s->layers[1].ior = 1.33;
  });
  add("+ absorption", [](Stack* s) {
    s->layers[0].thickness = 1;
    s->layers[0].absorption = {0.2, 0.2, 0.2};
  });
  add("+ scattering", [](Stack* s) {
    s->layers[0].thickness = 1;
    s->layers[0].scattering = {0.5, 0.5, 0.5};
  });
  for (const Preset& preset : Presets()) rows.push_back({preset.name.c_str(), preset.stack});
  std::vector<std::function<void()>> programs;
  std::vector<Sums> sums(rows.size());
  std::vector<PreparedStack> stacks;
  for (const Row& row : rows) stacks.push_back(Prepare(row.stack));
  for (size_t r = 0; r < rows.size(); ++r) {
    programs.emplace_back([&, r] {
      sums[r] = Sums();
      Rng rng(1);
      KernelFor(stacks[r].effects)(stacks[r], kWi, kWo, paths, &rng, sums[r].sum, sums[r].squares);
    });
  }
  std::vector<double> times;
  for (const std::vector<double>& all : Alternate(programs, kRounds)) times.push_back(Median(all));
  std::printf("%-34s %9s %12s %10s %10s  %s\n", "material", "ns/path", "M paths/s", "against",
              "spread", "f (green)");
  for (size_t r = 0; r < rows.size(); ++r) {
    const double mean = sums[r].sum[1] / paths;
    // Of one path, against its mean: what more paths have to fight.
    const double spread = std::sqrt(std::max(0.0, sums[r].squares[1] / paths - mean * mean)) / mean;
    std::printf("%-34s %9.1f %12.2f %9.2fx %10.2f  %.5f\n", rows[r].name, 1e9 * times[r] / paths,
                1e-6 * paths / times[r], times[r] / times[1], spread, mean);
  }
}

// The error that one pair in twenty exceeds.
double Worst(std::vector<double> errors) {
  std::sort(errors.begin(), errors.end());
  return errors[errors.size() * 19 / 20];
}

double RootMeanSquare(const std::vector<double>& errors) {
  double sum = 0;
  for (double error : errors) sum += error * error;
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

double ShareWithin(const std::vector<double>& errors, double bound) {
  const auto within = [&](double error) { return error <= bound; };
  return static_cast<double>(std::count_if(errors.begin(), errors.end(), within)) /
         static_cast<double>(errors.size());
}

struct Pairs {
  std::vector<brdf::Direction> wi, wo;
};

Pairs RandomPairs(int count) {
  Pairs pairs;
  Rng rng(7);
  for (int i = 0; i < count; ++i) {
    for (std::vector<brdf::Direction>* all : {&pairs.wi, &pairs.wo}) {
      const double z = 0.05 + 0.95 * Uniform(&rng), s = std::sqrt(1 - z * z);
      double sine, cosine;
      SinCosTurns(Uniform(&rng), &sine, &cosine);
      all->push_back(
          {static_cast<float>(s * cosine), static_cast<float>(s * sine), static_cast<float>(z)});
    }
  }
  return pairs;
}

// What estimates of all pairs took, and the standard error that each one's own paths tell.
struct Estimates {
  std::vector<double> errors;
  double paths_each = 0;
  double seconds = 0;
};

template <class EstimatePair>
Estimates EstimateAll(const Pairs& pairs, EstimatePair&& estimate_pair) {
  Estimates all;
  const double start = ThreadCpuSeconds();
  for (size_t i = 0; i < pairs.wi.size(); ++i) {
    const Estimate estimate = estimate_pair(pairs.wi[i], pairs.wo[i]);
    all.errors.push_back(Simulator::StandardError(estimate, pairs.wi[i], pairs.wo[i]));
    all.paths_each += estimate.spent;
  }
  all.seconds = ThreadCpuSeconds() - start;
  all.paths_each /= static_cast<double>(pairs.wi.size());
  return all;
}

// least: paths of a pair, and of its pilot.
Estimates EstimateAllTo(const Simulator& simulator, const Pairs& pairs, double standard_error,
                        int least) {
  Accuracy accuracy;
  accuracy.standard_error = standard_error;
  accuracy.pilot_paths = accuracy.min_paths = least;
  accuracy.max_paths = 1 << 20;
  return EstimateAll(pairs, [&](const brdf::Direction& wi, const brdf::Direction& wo) {
    return simulator.Evaluate(wi, wo, accuracy, 1);
  });
}

// Accuracy against time: paths go to the pairs of directions that need them.
void PrintAccuracy(const Simulator& simulator, const Pairs& pairs) {
  std::printf(
      "\nAccuracy against time, %zu random pairs of coated_metal: standard error of "
      "log(1 + f c), over all pairs (root mean square), the share of pairs within the one asked "
      "for, and the one that a pair in twenty exceeds\n",
      pairs.wi.size());
  std::printf("%10s %14s %10s %8s %10s %14s %22s\n", "asked for", "paths a pair", "RMS", "within",
              "1 in 20", "ms, adaptive", "ms, as many for each");
  for (const double target : {0.01, 0.005, 0.0025, 0.00125}) {
    const Estimates adaptive = EstimateAllTo(simulator, pairs, target, Accuracy().min_paths);
    const int each = static_cast<int>(adaptive.paths_each);
    const Estimates even =
        EstimateAll(pairs, [&](const brdf::Direction& wi, const brdf::Direction& wo) {
          return simulator.Average(wi, wo, each, 1);
        });
    // Errors fall with the square root of the time.
    const double ratio = Worst(even.errors) / Worst(adaptive.errors);
    std::printf("%10.5f %14.0f %10.5f %7.1f%% %10.5f %14.1f %22.1f\n", target,
                adaptive.paths_each, RootMeanSquare(adaptive.errors),
                100 * ShareWithin(adaptive.errors, target), Worst(adaptive.errors),
                1e3 * adaptive.seconds, 1e3 * even.seconds * ratio * ratio);
  }
}

// What it takes for the pairs to keep to an error: asking for less than that, or more paths at the
// least.
void PrintMargins(const Simulator& simulator, const Pairs& pairs) {
  std::printf("\nShare of pairs within an error:\n");
  std::printf("%10s %12s %14s %14s %8s\n", "error", "asked for", "paths at least", "paths a pair",
              "within");
  for (const double bound : {0.01, 0.005}) {
    for (const int least : {32, 128}) {
      for (const double margin : {1.0, 1.5, 2.0, 3.0}) {
        const Estimates all = EstimateAllTo(simulator, pairs, bound / margin, least);
        std::printf("%10.5f %12.5f %14d %14.0f %7.1f%%\n", bound, bound / margin, least,
                    all.paths_each, 100 * ShareWithin(all.errors, bound));
      }
    }
  }
}

int Main(int argc, char** argv) {
  int paths = 100000;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--paths") == 0 && i + 1 < argc) {
      paths = std::atoi(argv[++i]);
    } else {
      paths = 0;
    }
  }
  if (paths < 100) {
    std::fprintf(stderr, "usage: patina_layered_bench [--paths N], N at least 100\n");
    return 2;
  }
  PrintEffects(paths);
  const int failed = CompareByHand(paths);
  const Simulator simulator(Presets()[2].stack);
  const Pairs pairs = RandomPairs(400);
  PrintAccuracy(simulator, pairs);
  PrintMargins(simulator, pairs);
  return failed;
}

}  // namespace
}  // namespace patina::layered

int main(int argc, char** argv) { return patina::layered::Main(argc, argv); }
