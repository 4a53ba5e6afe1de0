// Enlarging an image to the size of the largest map of its set.
#pragma once

#include "pipeline/base/thread_pool.h"
#include "pipeline/image/image.h"

namespace patina {

// Catmull-Rom weights of the taps at -1, 0, 1, 2 for a position `t` in [0, 1) after tap 0 (Catmull
// and Rom 1974; cubic convolution with a = -1/2, Keys 1981). They sum to 1.
template <class S>
void CatmullRomWeights(S t, S weights[4]) {
  const S t2 = t * t, t3 = t2 * t;
  weights[0] = S(0.5) * (-t3 + S(2) * t2 - t);
  weights[1] = S(0.5) * (S(3) * t3 - S(5) * t2 + S(2));
  weights[2] = S(0.5) * (S(-3) * t3 + S(4) * t2 + t);
  weights[3] = S(0.5) * (t3 - t2);
}

// The image at width x height as float samples (integers divided by their maximum), by bicubic
// (Catmull-Rom) interpolation of the stored samples, texel centres at half integers. Overshoots are
// cut at the range of the channel in `image`, so a constant channel stays exactly constant. `wrap`:
// what is beyond an edge is the opposite edge, else the edge itself. `image` must be finite; width
// and height at least 1.
Image ResizeBicubic(const Image& image, const ImageStats& stats, int width, int height, bool wrap,
                    ThreadPool& pool);

}  // namespace patina
