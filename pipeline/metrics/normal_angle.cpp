#include "pipeline/metrics/normal_angle.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/metrics/row_sums.h"

namespace patina::metrics {
namespace {

struct Normal {
  double x, y, z;
};

Normal Decode(float coded_x, float coded_y) {
  const double x = 2.0 * coded_x - 1.0;
  const double y = 2.0 * coded_y - 1.0;
  const double rest = 1.0 - x * x - y * y;
  if (rest >= 0) return {x, y, std::sqrt(rest)};
  const double length = std::sqrt(x * x + y * y);
  return {x / length, y / length, 0};
}

// atan2 of the cross and the dot product: acos alone loses all digits near zero, where good maps
// are.
double AngleRad(const Normal& a, const Normal& b) {
  const double cx = a.y * b.z - a.z * b.y;
  const double cy = a.z * b.x - a.x * b.z;
  const double cz = a.x * b.y - a.y * b.x;
  return std::atan2(std::sqrt(cx * cx + cy * cy + cz * cz), a.x * b.x + a.y * b.y + a.z * b.z);
}

}  // namespace

float CodedNormalZ(float coded_x, float coded_y) {
  const float x = 2.0f * coded_x - 1.0f;
  const float y = 2.0f * coded_y - 1.0f;
  return 0.5f + 0.5f * std::sqrt(std::max(0.0f, 1.0f - x * x - y * y));
}

double MeanNormalAngleDeg(const PlanarView& reference_x, const PlanarView& reference_y,
                          const PlanarView& test_x, const PlanarView& test_y, ThreadPool& pool) {
  const int width = reference_x.width;
  const int height = reference_x.height;
  if (width <= 0 || height <= 0) return 0;
  const double sum_rad = SumOverRows(
      height,
      [&](int y) {
        const float *rx = reference_x.Row(y), *ry = reference_y.Row(y), *tx = test_x.Row(y),
                    *ty = test_y.Row(y);
        double sum = 0;
        for (int x = 0; x < width; ++x) sum += AngleRad(Decode(rx[x], ry[x]), Decode(tx[x], ty[x]));
        return sum;
      },
      pool);
  return sum_rad / (static_cast<double>(width) * height) * (180.0 / std::numbers::pi);
}

}  // namespace patina::metrics
