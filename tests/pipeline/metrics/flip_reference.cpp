#include "tests/pipeline/metrics/flip_reference.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace patina::metrics {
namespace {

using Triple = std::array<double, 3>;
constexpr double kPi = 3.14159265358979323846;
constexpr double kPpd = 67;

struct Image {
  int width, height;
  std::vector<Triple> texels;
  const Triple& Clamped(int x, int y) const {
    return texels[static_cast<size_t>(std::clamp(y, 0, height - 1)) * width +
                  std::clamp(x, 0, width - 1)];
  }
};

// Columns: XYZ of the primaries red, green and blue of Rec. 709 (four digits more than the paper's
// text needs).
constexpr double kXyz[3][3] = {{0.4123865632529917, 0.35759149092062537, 0.18045049120356368},
                               {0.21263682167732384, 0.7151829818412507, 0.07218019648142547},
                               {0.019330620152483987, 0.11919716364020845, 0.9503725870054354}};

double Linear(double coded) {
  coded = std::clamp(coded, 0.0, 1.0);
  return coded <= 0.04045 ? coded / 12.92 : std::pow((coded + 0.055) / 1.055, 2.4);
}

Triple ToXyz(const Triple& rgb) {
  Triple xyz;
  for (int i = 0; i < 3; ++i)
    xyz[i] = kXyz[i][0] * rgb[0] + kXyz[i][1] * rgb[1] + kXyz[i][2] * rgb[2];
  return xyz;
}

const Triple kWhite = ToXyz({1, 1, 1});

// Gaussian elimination, so that nothing is shared with the inverse under test.
Triple ToRgb(const Triple& xyz) {
  double a[3][4];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) a[i][j] = kXyz[i][j];
    a[i][3] = xyz[i];
  }
  for (int pivot = 0; pivot < 3; ++pivot) {
    for (int i = 0; i < 3; ++i) {
      if (i == pivot) continue;
      const double f = a[i][pivot] / a[pivot][pivot];
      for (int j = 0; j < 4; ++j) a[i][j] -= f * a[pivot][j];
    }
  }
  return {a[0][3] / a[0][0], a[1][3] / a[1][1], a[2][3] / a[2][2]};
}

Triple ToOpponent(const Triple& rgb) {
  const Triple xyz = ToXyz(rgb);
  const double x = xyz[0] / kWhite[0], y = xyz[1] / kWhite[1], z = xyz[2] / kWhite[2];
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

Triple FromOpponent(const Triple& t) {
  const double y = (t[0] + 16) / 116;
  return ToRgb({(y + t[1] / 500) * kWhite[0], y * kWhite[1], (y - t[2] / 200) * kWhite[2]});
}

Triple HuntLab(const Triple& rgb) {
  const Triple xyz = ToXyz(rgb);
  Triple f;
  for (int i = 0; i < 3; ++i) {
    const double t = xyz[i] / kWhite[i], delta = 6.0 / 29.0;
    f[i] = t > delta * delta * delta ? std::cbrt(t) : t / (3 * delta * delta) + 4.0 / 29.0;
  }
  const double l = 116 * f[1] - 16;
  return {l, 0.01 * l * 500 * (f[0] - f[1]), 0.01 * l * 200 * (f[1] - f[2])};
}

double HyAb(const Triple& p, const Triple& q) {
  return std::abs(p[0] - q[0]) + std::hypot(p[1] - q[1], p[2] - q[2]);
}

using Kernel = std::function<double(int, int)>;

// Sum over the square of `radius` around a texel of kernel(dx, dy) * channel.
double Filter(const Image& image, int channel, int x, int y, int radius, const Kernel& kernel) {
  double sum = 0;
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx)
      sum += kernel(dx, dy) * image.Clamped(x + dx, y + dy)[channel];
  }
  return sum;
}

std::vector<double> Table(int radius, const Kernel& kernel) {
  std::vector<double> table;
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) table.push_back(kernel(dx, dy));
  }
  return table;
}

// The kernel as a table with its positive and its negative weights summing to 1 and -1.
Kernel Normalised(int radius, const Kernel& kernel) {
  auto table = Table(radius, kernel);
  double positive = 0, negative = 0;
  for (const double v : table) (v > 0 ? positive : negative) += std::abs(v);
  for (double& v : table) v /= v > 0 ? positive : (negative > 0 ? negative : 1);
  return [table, radius](int dx, int dy) {
    return table[static_cast<size_t>(dy + radius) * (2 * radius + 1) + dx + radius];
  };
}

struct CsfParameters {
  double a1, b1, a2, b2;
};
constexpr CsfParameters kCsf[3] = {
    {1, 0.0047, 0, 1e-5}, {1, 0.0053, 0, 1e-5}, {34.1, 0.04, 13.5, 0.025}};

struct Features {
  double edge, point;
};

}  // namespace

std::vector<double> SlowFlip(const std::array<TestPlane, 3>& reference,
                             const std::array<TestPlane, 3>& test) {
  const int width = reference[0].width(), height = reference[0].height();
  const int color_radius =
      static_cast<int>(std::ceil(3 * std::sqrt(0.04 / (2 * kPi * kPi)) * kPpd));
  Kernel color_kernel[3];
  for (int c = 0; c < 3; ++c) {
    color_kernel[c] = Normalised(color_radius, [c](int dx, int dy) {
      const double d2 = (dx * dx + dy * dy) / (kPpd * kPpd);
      const CsfParameters& p = kCsf[c];
      return p.a1 * std::sqrt(kPi / p.b1) * std::exp(-kPi * kPi * d2 / p.b1) +
             p.a2 * std::sqrt(kPi / p.b2) * std::exp(-kPi * kPi * d2 / p.b2);
    });
  }
  const double sigma = 0.5 * 0.082 * kPpd;
  const int feature_radius = static_cast<int>(std::ceil(3 * sigma));
  const auto g = [sigma](int dx, int dy) {
    return std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
  };
  const Kernel edge_x = Normalised(feature_radius, [&](int dx, int dy) { return -dx * g(dx, dy); });
  const Kernel edge_y = Normalised(feature_radius, [&](int dx, int dy) { return -dy * g(dx, dy); });
  const Kernel point_x = Normalised(
      feature_radius, [&](int dx, int dy) { return (dx * dx / (sigma * sigma) - 1) * g(dx, dy); });
  const Kernel point_y = Normalised(
      feature_radius, [&](int dx, int dy) { return (dy * dy / (sigma * sigma) - 1) * g(dx, dy); });

  Image images[2];
  for (int i = 0; i < 2; ++i) {
    const auto& planes = i == 0 ? reference : test;
    images[i] = {width, height, {}};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        images[i].texels.push_back(ToOpponent(
            {Linear(planes[0].At(x, y)), Linear(planes[1].At(x, y)), Linear(planes[2].At(x, y))}));
      }
    }
  }
  const double largest = std::pow(HyAb(HuntLab({0, 1, 0}), HuntLab({0, 0, 1})), 0.7);

  std::vector<double> errors;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Triple lab[2];
      Features features[2];
      for (int i = 0; i < 2; ++i) {
        Triple filtered;
        for (int c = 0; c < 3; ++c)
          filtered[c] = Filter(images[i], c, x, y, color_radius, color_kernel[c]);
        Triple rgb = FromOpponent(filtered);
        for (double& v : rgb) v = std::clamp(v, 0.0, 1.0);
        lab[i] = HuntLab(rgb);
        const auto strength = [&](const Kernel& kx, const Kernel& ky) {
          return std::hypot(Filter(images[i], 0, x, y, feature_radius, kx) / 116,
                            Filter(images[i], 0, x, y, feature_radius, ky) / 116);
        };
        features[i] = {strength(edge_x, edge_y), strength(point_x, point_y)};
      }
      double color = std::pow(HyAb(lab[0], lab[1]), 0.7);
      const double knee = 0.4 * largest;
      color = color < knee ? 0.95 / knee * color : 0.95 + (color - knee) / (largest - knee) * 0.05;
      const double difference = std::max(std::abs(features[0].edge - features[1].edge),
                                         std::abs(features[0].point - features[1].point));
      const double feature = std::sqrt(difference / std::sqrt(2.0));
      errors.push_back(std::pow(color, 1 - feature));
    }
  }
  return errors;
}

}  // namespace patina::metrics
