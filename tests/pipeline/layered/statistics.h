// Comparisons of estimates, in standard errors.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "pipeline/layered/simulator.h"

namespace patina::layered::test {

inline double Unit(Rng* rng) { return static_cast<double>(rng->Next() >> 11) * 0x1p-53; }
inline double Between(Rng* rng, double low, double high) { return low + (high - low) * Unit(rng); }
// Even in the logarithm.
inline double Magnitude(Rng* rng, double low, double high) {
  return low * std::pow(high / low, Unit(rng));
}
// Even in the cosine, which is at least `min_z`.
inline brdf::Direction Above(Rng* rng, double min_z = 0.05) {
  const double z = Between(rng, min_z, 1), phi = Between(rng, 0, 2 * kPi), s = std::sqrt(1 - z * z);
  return {static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)),
          static_cast<float>(z)};
}

// A running mean.
struct Tally {
  double sum = 0, squares = 0;
  int count = 0;

  void Add(double x) {
    sum += x;
    squares += x * x;
    ++count;
  }
  double mean() const { return sum / count; }
  double variance() const {  // of the mean
    return std::max(0.0, squares / count - mean() * mean()) / (count - 1);
  }
};

// A family of comparisons. Each is a normal deviate if the two sides agree; the family fails a
// sound program with a chance of 1e-6, divided evenly among the comparisons (Bonferroni). The
// deviates' mean square must be near 1, too: errors that are stated too large would hide others.
class Comparisons {
 public:
  explicit Comparisons(int count) : count_(count) {
    // The two-sided quantile of the normal distribution at 1e-6 / count, by bisection.
    double low = 0, high = 20;
    for (int i = 0; i < 60; ++i) {
      const double middle = (low + high) / 2;
      (std::erfc(middle / std::sqrt(2.0)) > 1e-6 / count ? low : high) = middle;
    }
    limit_ = high;
  }
  ~Comparisons() {
    EXPECT_EQ(done_, count_) << "the correction is for another number of comparisons";
    if (deviates_ < 50) return;
    // The mean square of n deviates is 1 with a standard error of sqrt(2 / n); heavy tails of
    // single paths widen that, hence the factor.
    const double mean = squares_ / deviates_;
    EXPECT_NEAR(mean, 1, 5 * 2 * std::sqrt(2.0 / deviates_)) << deviates_ << " deviates";
  }
  // floor: what rounding may do.
  void Compare(double value, double variance, double expected, double floor,
               const std::string& what) {
    ++done_;
    ASSERT_TRUE(std::isfinite(value) && std::isfinite(variance)) << what;
    const double error = std::sqrt(variance);
    EXPECT_LE(std::abs(value - expected), limit_ * error + floor)
        << what << ": " << value << " +- " << error << ", expected " << expected;
    if (error > 10 * floor) {
      squares_ += (value - expected) * (value - expected) / variance;
      ++deviates_;
    }
  }

 private:
  int count_, done_ = 0, deviates_ = 0;
  double limit_ = 0, squares_ = 0;
};

inline BasePart Diffuse(double albedo) {
  BasePart part;
  part.albedo = {albedo, albedo, albedo};
  return part;
}
inline BasePart Conductor(Rgb eta, Rgb k, Roughness roughness) {
  BasePart part;
  part.kind = BaseKind::kConductor;
  part.eta = eta;
  part.k = k;
  part.roughness = roughness;
  return part;
}
inline std::string Name(const Stack& stack) {
  std::string name;
  for (const Layer& layer : stack.layers) {
    char text[200];
    std::snprintf(text, sizeof text, "[ior %g alpha %g %g d %g a %g s %g g %g] ", layer.ior,
                  layer.roughness.x, layer.roughness.y, layer.thickness, layer.absorption[1],
                  layer.scattering[1], layer.asymmetry);
    name += text;
  }
  return name + std::to_string(stack.parts.size()) + " parts";
}

// One layer and, maybe, a second; media of all kinds, bases of all kinds.
inline Stack RandomStack(Rng* rng, double min_alpha) {
  Stack stack;
  const int layers = 1 + static_cast<int>(rng->Below(3));
  for (int i = 0; i < layers; ++i) {
    Layer layer;
    layer.ior = Between(rng, 1.05, 2.2);
    const double alpha = Magnitude(rng, min_alpha, 1);
    if (rng->Below(4) > 0) layer.roughness = {alpha, alpha, 0};
    if (rng->Below(4) == 0)
      layer.roughness = {Magnitude(rng, min_alpha, 1), Magnitude(rng, min_alpha, 1),
                         Between(rng, 0, 3)};
    layer.thickness = Magnitude(rng, 0.1, 1);
    const uint32_t medium = rng->Below(4);
    for (size_t c = 0; c < 3; ++c) {
      if (medium % 2 == 1) layer.absorption[c] = Magnitude(rng, 0.05, 3);
      if (medium >= 2) layer.scattering[c] = Magnitude(rng, 0.1, 5);
    }
    layer.asymmetry = Between(rng, -0.7, 0.8);
    stack.layers.push_back(layer);
  }
  const double alpha = Magnitude(rng, min_alpha, 1);
  const BasePart metal = Conductor({0.2, 0.9, 1.3}, {3.9, 2.5, 2.2}, {alpha, alpha, 0});
  const uint32_t base = rng->Below(4);
  if (base != 1) stack.parts.push_back(Diffuse(Between(rng, 0, 1)));
  if (base == 1 || base == 2) stack.parts.push_back(metal);
  for (BasePart& part : stack.parts) part.weight = 1.0 / static_cast<double>(stack.parts.size());
  return stack;
}

}  // namespace patina::layered::test
