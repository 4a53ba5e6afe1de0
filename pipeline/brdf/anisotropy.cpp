#include "pipeline/brdf/anisotropy.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace patina::brdf {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
// Steps of 15 degrees lie on the azimuths of UTIA: there its own interpolation adds nothing.
constexpr int kTurns = 24, kAzimuths = 7;

Direction FromAngles(double theta, double phi) {
  const double sine = std::sin(theta);
  return {static_cast<float>(sine * std::cos(phi)), static_cast<float>(sine * std::sin(phi)),
          static_cast<float>(std::cos(theta))};
}

// Sums over the turns of one pair.
class Turned {
 public:
  void Add(const float rgb[3]) {
    for (int c = 0; c < 3; ++c)
      values_[c][count_] = std::log1p(std::max(0.0, static_cast<double>(rgb[c])));
    ++count_;
  }
  double Sum() const {
    double sum = 0;
    for (const auto& channel : values_) {
      for (int k = 0; k < count_; ++k) sum += channel[k];
    }
    return sum;
  }
  double Deviation() const {
    double deviation = 0;
    for (const auto& channel : values_) {
      double mean = 0;
      for (int k = 0; k < count_; ++k) mean += channel[k] / count_;
      for (int k = 0; k < count_; ++k) deviation += std::abs(channel[k] - mean);
    }
    return deviation;
  }

 private:
  double values_[3][kTurns] = {};
  int count_ = 0;
};

}  // namespace

double MeasureAnisotropy(const Table& table, double max_theta_rad) {
  // Close to the normal narrow lobes turn fast.
  constexpr double kThetas[] = {2, 6, 12, 20, 30, 45, 60, 75};
  double sum = 0, deviation = 0;
  for (const double theta_i : kThetas) {
    for (const double theta_o : kThetas) {
      if (std::max(theta_i, theta_o) * kDegree > max_theta_rad + 1e-6) continue;
      for (int azimuth = 0; azimuth < kAzimuths; ++azimuth) {
        Turned turned;
        for (int turn = 0; turn < kTurns; ++turn) {
          const double phi = 360.0 / kTurns * turn * kDegree;
          float rgb[3];
          if (table.Evaluate(FromAngles(theta_i * kDegree, phi),
                             FromAngles(theta_o * kDegree, phi + 30 * azimuth * kDegree), rgb))
            turned.Add(rgb);
        }
        sum += turned.Sum();
        deviation += turned.Deviation();
      }
    }
  }
  return sum > 0 ? deviation / sum : 0;
}

}  // namespace patina::brdf
