// How the metrics see an image: one plane for each channel.
#pragma once

#include <cstddef>

namespace patina::metrics {

// One channel, not owned. Element (x, y) is data[y * row_stride + x]. Values must be finite.
struct PlanarView {
  const float* data = nullptr;
  int width = 0;
  int height = 0;
  size_t row_stride = 0;  // elements from one row to the next, >= width

  const float* Row(int y) const { return data + static_cast<size_t>(y) * row_stride; }
};

// A view of `width * height` values without gaps between rows.
inline PlanarView DensePlane(const float* data, int width, int height) {
  return {data, width, height, static_cast<size_t>(width)};
}

}  // namespace patina::metrics
