#include "formats/brdf/rgl_warp.h"

namespace patina::brdf {
namespace {

// Integral of a bilinear function over the square, in units of one patch.
double Integral(const float* density, int height, int width) {
  double sum = 0;
  for (int y = 0; y < height; ++y) {
    double row = 0;
    for (int x = 0; x < width; ++x) {
      const double value = static_cast<double>(density[static_cast<size_t>(y) * width + x]);
      row += x == 0 || x == width - 1 ? 0.5 * value : value;
    }
    sum += y == 0 || y == height - 1 ? 0.5 * row : row;
  }
  return sum;
}

// Like PlaceOnRow, but the last node is the end of the last patch.
Place PatchOnRow(float unit, int count) {
  const Place place = PlaceOnRow(unit * static_cast<float>(count - 1), count);
  if (place.low < count - 1) return place;
  return {count - 2, count - 1, 1};
}

// The t in [0, 1] with a t + (b - a) t^2 / 2 = mass, for densities a, b >= 0.
float SolveLinear(double a, double b, double mass) {
  if (!(mass > 0)) return 0;
  const double root = std::sqrt(std::max(0.0, a * a + 2 * (b - a) * mass));
  return 2 * mass < a + root ? static_cast<float>(2 * mass / (a + root)) : 1;
}

}  // namespace

int UnitWarp::FirstEmptySlice(const std::vector<float>& density, int slices, int height,
                              int width) {
  const size_t size = static_cast<size_t>(height) * width;
  for (int s = 0; s < slices; ++s) {
    const double total = Integral(density.data() + s * size, height, width);
    if (!(total > 1e-30 && total < 1e30)) return s;
  }
  return -1;
}

UnitWarp::UnitWarp(std::vector<float> density, int slices, int height, int width)
    : height_(height), width_(width) {
  const size_t size = static_cast<size_t>(height) * width;
  nodes_.resize(density.size());
  rows_.resize(static_cast<size_t>(slices) * height);
  for (int s = 0; s < slices; ++s) {
    const double scale = 1 / Integral(density.data() + s * size, height, width);
    double above = 0;
    double previous_mass = 0;
    for (int y = 0; y < height; ++y) {
      const size_t first = s * size + static_cast<size_t>(y) * width;
      double below = 0;
      double previous = 0;
      for (int x = 0; x < width; ++x) {
        const double value = static_cast<double>(density[first + x]) * scale;
        if (x > 0) below += 0.5 * (previous + value);
        nodes_[first + x] = {static_cast<float>(value), static_cast<float>(below)};
        previous = value;
      }
      if (y > 0) above += 0.5 * (previous_mass + below);
      rows_[static_cast<size_t>(s) * height + y] = {static_cast<float>(below),
                                                    static_cast<float>(above)};
      previous_mass = below;
    }
  }
}

UnitPoint UnitWarp::Invert(UnitPoint point, const int* slices, const float* weights,
                           int count) const {
  const Place x = PatchOnRow(point.x, width_);
  const Place y = PatchOnRow(point.y, height_);
  float left = 0;         // of the row at y, below x
  float row_mass = 0;     // of the row at y
  float square_mass = 0;  // of the square, below y
  for (int i = 0; i < count; ++i) {
    const Node* low = NodesOf(slices[i], y.low);
    const Node* high = NodesOf(slices[i], y.high);
    const auto at_y = [&](float a, float b) { return a * (1 - y.t) + b * y.t; };
    const float a = at_y(low[x.low].density, high[x.low].density);
    const float b = at_y(low[x.high].density, high[x.high].density);
    const float below = at_y(low[x.low].below, high[x.low].below);
    const Row* rows = RowsOf(slices[i]);
    left += weights[i] * (below + x.t * (a + 0.5f * x.t * (b - a)));
    row_mass += weights[i] * at_y(rows[y.low].mass, rows[y.high].mass);
    square_mass += weights[i] *
                   (rows[y.low].below +
                    y.t * (rows[y.low].mass + 0.5f * y.t * (rows[y.high].mass - rows[y.low].mass)));
  }
  return {row_mass > 0 ? std::min(left / row_mass, 1.0f) : point.x, std::min(square_mass, 1.0f)};
}

UnitPoint UnitWarp::Sample(UnitPoint uniform, int slice) const {
  const Row* rows = RowsOf(slice);
  int row = 0;
  while (row < height_ - 2 && rows[row + 1].below <= uniform.y) ++row;
  const float ty = SolveLinear(rows[row].mass, rows[row + 1].mass, uniform.y - rows[row].below);
  const Node* low = NodesOf(slice, row);
  const Node* high = NodesOf(slice, row + 1);
  const auto at_y = [&](float a, float b) {
    return static_cast<double>(a) * (1 - ty) + static_cast<double>(b) * ty;
  };
  const double wanted = static_cast<double>(uniform.x) * at_y(rows[row].mass, rows[row + 1].mass);
  int column = 0;
  while (column < width_ - 2 && at_y(low[column + 1].below, high[column + 1].below) <= wanted) {
    ++column;
  }
  const float tx = SolveLinear(at_y(low[column].density, high[column].density),
                               at_y(low[column + 1].density, high[column + 1].density),
                               wanted - at_y(low[column].below, high[column].below));
  return {(static_cast<float>(column) + tx) / static_cast<float>(width_ - 1),
          (static_cast<float>(row) + ty) / static_cast<float>(height_ - 1)};
}

}  // namespace patina::brdf
