// What hard cases cost: the CPU time of each against an ordinary material of the same size,
// alternated seven times in one process, as the median of the ratios. One thread. Usage:
// patina_hard_cases_bench [NAME...]; without names all of them.
//
// Denormals are flushed to zero in every loop of the thread pool, on whichever thread it runs
// (pipeline/base/thread_pool.h), so a result depends on that nowhere; the updates of the network,
// which run between the loops, do not flush them, and always on the calling thread.

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "pipeline/base/cpu_time.h"
#include "tests/hard_cases/brdf_cases.h"
#include "tests/hard_cases/map_cases.h"
#include "tests/hard_cases/material_runs.h"

namespace patina {
namespace {

constexpr int kRounds = 7;

template <class Body>
double SecondsOf(Body&& body) {
  const double start = ProcessCpuSeconds();
  body();
  return ProcessCpuSeconds() - start;
}

template <class Hard, class Ordinary>
void Compare(const std::string& name, Hard&& hard, Ordinary&& ordinary) {
  std::vector<double> ratios;
  for (int round = 0; round < kRounds; ++round) {
    const double base = SecondsOf(ordinary);
    ratios.push_back(SecondsOf(hard) / base);
  }
  std::sort(ratios.begin(), ratios.end());
  std::printf("%-36s %5.2f   %5.2f to %5.2f\n", name.c_str(), ratios[kRounds / 2], ratios.front(),
              ratios.back());
  std::fflush(stdout);
}

int Main(const std::vector<std::string>& wanted) {
  const auto skipped = [&](const std::string& name) {
    return !wanted.empty() && std::find(wanted.begin(), wanted.end(), name) == wanted.end();
  };
  std::printf("%-36s %5s   %s\n", "case", "ratio", "least to most");
  for (const test::MapCase& map : test::MapCases()) {
    if (skipped(map.name)) continue;
    const MaterialReference hard = test::ReferenceOf(map);
    const MaterialReference ordinary =
        test::ReferenceOf(test::OrdinaryMap(map.width, map.height, map.channels));
    TrainOptions options;
    options.samples = 4e5;
    Compare(
        map.name, [&] { test::MustTrain(hard, options, 1); },
        [&] { test::MustTrain(ordinary, options, 1); });
  }
  const brdf::Source ordinary = test::OrdinaryBrdf();
  for (const test::BrdfCase& hard : test::BrdfCases()) {
    if (skipped(hard.name)) continue;
    // As many steps for each sample that is drawn as the default training has: drawing is what
    // holes in the data slow down.
    brdf::TrainOptions options = test::QuickBrdfTraining();
    options.free_steps = options.codebook_steps = 560;
    Compare(
        hard.name, [&] { test::MustTrainBrdf(hard.source, options, 1); },
        [&] { test::MustTrainBrdf(ordinary, options, 1); });
  }
  return 0;
}

}  // namespace
}  // namespace patina

int main(int argc, char** argv) { return patina::Main({argv + 1, argv + argc}); }
