// FLIP for images of low dynamic range: how visible a difference is to somebody who flips between
// two images.
//
// Based on: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild 2020, "FLIP: A
// Difference Evaluator for Alternating Images", with the separable filters that its authors
// published later.
#pragma once

#include <array>

#include "pipeline/base/thread_pool.h"
#include "pipeline/metrics/plane.h"

namespace patina::metrics {

// Red, green and blue of one size, coded with the sRGB curve (Rec. 709 primaries). Values are
// clamped to [0, 1].
using RgbView = std::array<PlanarView, 3>;

// Mean of the FLIP error map, in [0, 1]: 0 for equal images; symmetric. Viewing distance: 67 pixels
// per degree, a 0.7 m wide monitor of 3840 pixels seen from 0.7 m. Images are extended by their
// border texels. 0 for an empty image. error_map: null, or width * height floats that receive the
// error of each texel, row-major. Differs from the publication: taps below 1e-8 of a filter's sum
// are left out. The same bits for any number of threads.
double MeanFlip(const RgbView& reference, const RgbView& test, ThreadPool& pool,
                float* error_map = nullptr);

}  // namespace patina::metrics
