// The parameterisation of RGL files: the unit square, warped by the density of visible normals.
//
// Based on: Dupuy and Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition
// and Rendering".
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "formats/brdf/angles.h"

namespace patina::brdf {

// A place in the unit square; x runs along the rows of a tensor (its last axis), y across them.
struct UnitPoint {
  float x = 0, y = 0;
};

// Colatitude and azimuth to [0, 1], as the files have them: theta = u^2 pi/2, phi = (2u - 1) pi.
inline float ThetaToUnit(float theta) { return std::sqrt(theta * (1 / kHalfPi)); }
inline float PhiToUnit(float phi) {
  const float u = (phi + kPi) * (1 / kTwoPi);
  return u - std::floor(u);
}

// A density over the unit square, bilinear between width x height nodes at its corners and between,
// for each of `slices` light directions; each slice is normalised. A mixture of slices is linear in
// their densities and cumulative functions.
class UnitWarp {
 public:
  // `density`: slices x height x width, finite, not negative, each slice with a positive integral.
  // width, height >= 2.
  UnitWarp(std::vector<float> density, int slices, int height, int width);

  // Whether each slice has an integral that can be divided by; else the first that has none.
  static int FirstEmptySlice(const std::vector<float>& density, int slices, int height, int width);

  // Where the density has put `point`: (fraction of the row at y below x, fraction of the square
  // below y). Mixture of `count` slices with weights of sum 1.
  UnitPoint Invert(UnitPoint point, const int* slices, const float* weights, int count) const;

  // The point that Invert takes to `uniform`, for one slice.
  UnitPoint Sample(UnitPoint uniform, int slice) const;

  int width() const { return width_; }
  int height() const { return height_; }

 private:
  struct Node {
    float density, below;  // `below`: of the row, left of the node
  };
  struct Row {
    float mass, below;  // of the row; of the square, above (at smaller y than) the row
  };
  const Node* NodesOf(int slice, int row) const {
    return nodes_.data() + (static_cast<size_t>(slice) * height_ + row) * width_;
  }
  const Row* RowsOf(int slice) const { return rows_.data() + static_cast<size_t>(slice) * height_; }

  int height_, width_;
  std::vector<Node> nodes_;
  std::vector<Row> rows_;
};

// A plain bilinear function on width x height nodes of the unit square.
class UnitGrid {
 public:
  UnitGrid(std::vector<float> values, int height, int width)
      : height_(height), width_(width), values_(std::move(values)) {}

  float At(UnitPoint point) const {
    const Place x = PlaceOnRow(point.x * static_cast<float>(width_ - 1), width_);
    const Place y = PlaceOnRow(point.y * static_cast<float>(height_ - 1), height_);
    const float* low = values_.data() + static_cast<size_t>(y.low) * width_;
    const float* high = values_.data() + static_cast<size_t>(y.high) * width_;
    const float a = low[x.low] * (1 - x.t) + low[x.high] * x.t;
    const float b = high[x.low] * (1 - x.t) + high[x.high] * x.t;
    return a * (1 - y.t) + b * y.t;
  }

 private:
  int height_, width_;
  std::vector<float> values_;
};

}  // namespace patina::brdf
