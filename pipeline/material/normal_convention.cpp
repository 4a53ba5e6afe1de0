#include "pipeline/material/normal_convention.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace patina {
namespace {

// Sums for one correlation coefficient.
struct Moments {
  double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  void Add(double x, double y) {
    n += 1;
    a += x;
    b += y;
    aa += x * x;
    bb += y * y;
    ab += x * y;
  }
  void Add(const Moments& other) {
    n += other.n;
    a += other.a;
    b += other.b;
    aa += other.aa;
    bb += other.bb;
    ab += other.ab;
  }
  double Correlation() const {
    if (n < 2) return 0;
    const double va = aa - a * a / n, vb = bb - b * b / n;
    const double floor = 1e-12 * n;
    return va > floor && vb > floor ? (ab - a * b / n) / std::sqrt(va * vb) : 0;
  }
};

struct Sums {
  Moments height_x, height_y, curl;
};

// Slopes of three neighbouring rows.
struct Rows {
  std::vector<float> p[3], q[3], h[3], z;
};

void LoadSlopes(const Image& normal, int y, std::vector<float>* p, std::vector<float>* q,
                std::vector<float>* z) {
  const int width = normal.width();
  LoadRow(normal, y, 0, p->data());
  LoadRow(normal, y, 1, q->data());
  if (normal.channels() >= 3) LoadRow(normal, y, 2, z->data());
  for (int x = 0; x < width; ++x) {
    const float nx = 2 * (*p)[x] - 1, ny = 2 * (*q)[x] - 1;
    const float nz =
        normal.channels() >= 3 ? 2 * (*z)[x] - 1 : std::sqrt(std::max(0.0f, 1 - nx * nx - ny * ny));
    // Steep normals would outweigh all others.
    const float divisor = std::max(nz, 0.2f);
    (*p)[x] = -nx / divisor;
    (*q)[x] = ny / divisor;
  }
}

}  // namespace

NormalEvidence MeasureNormals(const Image& normal, const Image* height, int height_channel,
                              ThreadPool& pool) {
  const int width = normal.width();
  // Every row of a map up to about 1024 rows, evenly spread ones of a larger map.
  const int step = std::max(1, normal.height() / 1024);
  const int rows = (normal.height() - 2) / step;
  if (rows < 1 || width < 3) return {};
  std::vector<Sums> sums(rows);
  std::vector<Rows> scratch(pool.threads());
  for (Rows& r : scratch) {
    for (int i = 0; i < 3; ++i) {
      r.p[i].resize(width);
      r.q[i].resize(width);
      r.h[i].resize(width);
    }
    r.z.resize(width);
  }
  pool.ParallelFor(rows, [&](int row, int worker) {
    Rows& r = scratch[worker];
    const int y = 1 + row * step;
    for (int i = 0; i < 3; ++i) {
      LoadSlopes(normal, y - 1 + i, &r.p[i], &r.q[i], &r.z);
      if (height != nullptr) LoadRow(*height, y - 1 + i, height_channel, r.h[i].data());
    }
    Sums& sum = sums[row];
    for (int x = 1; x + 1 < width; ++x) {
      sum.curl.Add(r.p[2][x] - r.p[0][x], r.q[1][x + 1] - r.q[1][x - 1]);
      if (height == nullptr) continue;
      sum.height_x.Add(r.p[1][x], r.h[1][x + 1] - r.h[1][x - 1]);
      sum.height_y.Add(r.q[1][x], r.h[2][x] - r.h[0][x]);
    }
  });
  Sums total;
  for (const Sums& sum : sums) {
    total.height_x.Add(sum.height_x);
    total.height_y.Add(sum.height_y);
    total.curl.Add(sum.curl);
  }
  return {total.height_x.Correlation(), total.height_y.Correlation(), total.curl.Correlation()};
}

}  // namespace patina
