// Small images for the tests of the metrics.
#pragma once

#include <vector>

#include "pipeline/base/rng.h"
#include "pipeline/metrics/plane.h"

namespace patina::metrics {

// An owned plane whose rows have `gap` unused elements (filled with 1e30) after them.
class TestPlane {
 public:
  TestPlane(int width, int height, float value = 0, int gap = 0)
      : width_(width),
        height_(height),
        stride_(width + gap),
        values_(static_cast<size_t>(stride_) * height, 1e30f) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) At(x, y) = value;
    }
  }

  static TestPlane Random(int width, int height, uint64_t seed, int gap = 0) {
    TestPlane plane(width, height, 0, gap);
    Rng rng(seed);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) plane.At(x, y) = rng.Uniform();
    }
    return plane;
  }

  float& At(int x, int y) { return values_[static_cast<size_t>(y) * stride_ + x]; }
  float At(int x, int y) const { return values_[static_cast<size_t>(y) * stride_ + x]; }
  int width() const { return width_; }
  int height() const { return height_; }
  PlanarView View() const {
    return {values_.data(), width_, height_, static_cast<size_t>(stride_)};
  }

 private:
  int width_, height_, stride_;
  std::vector<float> values_;
};

}  // namespace patina::metrics
