// Tells OpenGL from DirectX normal maps by their pixels.
#pragma once

#include "pipeline/base/thread_pool.h"
#include "pipeline/image/image.h"

namespace patina {

// Correlation coefficients in [-1, 1]; 0 where nothing varies. Rows count downwards.
struct NormalEvidence {
  // Of the slope -x/z with the height's difference along a row, and of y/z with that down a column.
  // For a normal map that belongs to the height map the first is positive, and the second positive
  // for OpenGL (Y up), negative for DirectX.
  double height_x = 0;
  double height_y = 0;
  // Of the derivative of -x/z down a column with that of y/z along a row. Both are the mixed
  // derivative of the height that the normals were made from: equal for OpenGL, opposite for
  // DirectX. Needs no height map.
  double curl = 0;
};

// Measures `normal` (channels 0 and 1 are x and y, 2 is z if there is one; integers and floats in
// [0, 1] stand for [-1, 1]) against `height` (channel `height_channel`; nullptr without one), which
// must have the same size. Edges are left out.
NormalEvidence MeasureNormals(const Image& normal, const Image* height, int height_channel,
                              ThreadPool& pool);

}  // namespace patina
