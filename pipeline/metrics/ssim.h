// Structural similarity of two planes.
//
// Based on: Wang, Bovik, Sheikh, Simoncelli 2004, "Image Quality Assessment: From Error Visibility
// to Structural Similarity".
#pragma once

#include "pipeline/base/thread_pool.h"
#include "pipeline/metrics/plane.h"

namespace patina::metrics {

// Mean SSIM of two planes of the same size: Gaussian window of 11x11, sigma 1.5, K1 0.01, K2 0.03,
// over all windows that lie inside the image, as the authors' own program does. In (-1, 1], 1 for
// equal planes; 1 for an empty image. Differs from the paper: a side shorter than 11 has a window
// at every texel, cut at the border and renormalised, so that small mips have a value too. peak is
// the paper's L. The same bits for any number of threads.
double MeanSsim(const PlanarView& reference, const PlanarView& test, ThreadPool& pool,
                double peak = 1.0);

}  // namespace patina::metrics
