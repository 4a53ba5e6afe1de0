// What the accuracy of a simulation costs in time, on this machine.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/layered/simulator.h"

namespace patina::layered {

struct AccuracyPoint {
  int paths = 0;              // for each pair of directions
  double standard_error = 0;  // root mean square over the pairs, as Accuracy counts it
  double seconds = 0;         // of one thread, for a pair
};

// Some pairs of directions, the same for the same seed, at growing numbers of paths: a quarter of a
// second at the most for all but the thickest media.
std::vector<AccuracyPoint> MeasureAccuracy(const Simulator& simulator, uint64_t seed);

}  // namespace patina::layered
