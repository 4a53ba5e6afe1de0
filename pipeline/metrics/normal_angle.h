// The angle between two tangent-space normal maps.
#pragma once

#include "pipeline/base/thread_pool.h"
#include "pipeline/metrics/plane.h"

namespace patina::metrics {

// z of a unit normal with the coded components x and y (coded = 0.5 + 0.5 * component), coded as
// well: in [0.5, 1]; 0.5 where x and y alone are longer than one.
float CodedNormalZ(float coded_x, float coded_y);

// Mean angle in degrees between the normals of two maps given as coded x and y planes of the same
// size. z is reconstructed, non-negative; a vector whose x and y are longer than one is scaled to
// one, with z = 0. 0 for an empty image. The same bits for any number of threads.
double MeanNormalAngleDeg(const PlanarView& reference_x, const PlanarView& reference_y,
                          const PlanarView& test_x, const PlanarView& test_y, ThreadPool& pool);

}  // namespace patina::metrics
