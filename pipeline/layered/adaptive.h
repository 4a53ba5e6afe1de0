// Means of random estimates, as many as an error asks for.
#pragma once

#include <algorithm>

#include "pipeline/layered/simulator.h"

namespace patina::layered {

// The mean of `paths` estimates, two or more, whose sums and sums of squares these are.
inline Estimate MeanOf(const double sum[3], const double squares[3], int paths) {
  Estimate estimate;
  estimate.paths = estimate.spent = paths;
  for (size_t c = 0; c < 3; ++c) {
    const double mean = sum[c] / paths;
    estimate.f[c] = mean;
    estimate.variance[c] = std::max(0.0, squares[c] / paths - mean * mean) / (paths - 1);
  }
  return estimate;
}

// As many estimates as the accuracy asks for, from add(count, &rng, sum, squares), which adds up
// estimates and their squares. The number follows from a pilot, of a quarter as many at the least,
// which are not used again, so that the mean stays unbiased.
template <class Add>
Estimate EstimateTo(const Accuracy& accuracy, const brdf::Direction& wi, const brdf::Direction& wo,
                    Rng pilot_rng, Rng rng, Add&& add) {
  constexpr double kMostOverPilot = 4;
  double sum[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
  int pilot = accuracy.pilot_paths;
  add(pilot, &pilot_rng, sum, squares);
  double wanted = 0;
  for (;;) {
    const double ratio =
        Simulator::StandardError(MeanOf(sum, squares, pilot), wi, wo) / accuracy.standard_error;
    wanted = std::clamp(pilot * ratio * ratio, static_cast<double>(accuracy.min_paths),
                        static_cast<double>(accuracy.max_paths));
    // Few paths say little of the variance of many: rare bright ones are missing among them.
    if (wanted <= kMostOverPilot * pilot) break;
    add(pilot, &pilot_rng, sum, squares);
    pilot *= 2;
  }
  double used[3] = {0, 0, 0}, used_squares[3] = {0, 0, 0};
  const int paths = static_cast<int>(wanted);
  add(paths, &rng, used, used_squares);
  Estimate estimate = MeanOf(used, used_squares, paths);
  estimate.spent += pilot;
  return estimate;
}

}  // namespace patina::layered
