// FLIP as the paper writes it, in double precision and with two-dimensional filters: slow, for
// comparison.
#pragma once

#include <array>
#include <vector>

#include "tests/pipeline/metrics/test_planes.h"

namespace patina::metrics {

// The error map, row-major, of two sRGB-coded images.
std::vector<double> SlowFlip(const std::array<TestPlane, 3>& reference,
                             const std::array<TestPlane, 3>& test);

}  // namespace patina::metrics
