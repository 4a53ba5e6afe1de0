// Whether BrdfSampler draws what its pdf says.
#pragma once

#include <cmath>
#include <vector>

#include "formats/decoder/patina_brdf_sampler.h"
#include "tests/formats/test_support.h"

namespace patina::test {

struct SamplerCheck {
  double integral = 0;  // of the pdf over the hemisphere
  double kept = 0;      // share of samples that were not lost
  double chi_square = 0;
  int degrees = 0;
  double probability_z = 0;  // chi_square as a standard normal deviate (Wilson and Hilferty)
};

// Bins are cells of the half vector: theta_h in 16 parts with edges at pi/2 (i/16)^2, and 8 parts
// of the azimuth against wi. Tables with a multiple of 16 cells have their edges among these.
inline SamplerCheck CheckSampler(const BrdfSampler& sampler, const float wi[3], int samples,
                                 uint64_t seed) {
  constexpr int kThetaBins = 16;
  constexpr int kPhiBins = 8;
  constexpr int kThetaPoints = 16;
  constexpr int kPhiPoints = 128;
  const auto edge = [](double x) {
    const double s = std::sin(M_PI / 4 * x * x);
    return s * s;
  };
  const double phi_i = std::atan2(static_cast<double>(wi[1]), static_cast<double>(wi[0]));
  SamplerCheck check;
  std::vector<double> expected(kThetaBins * kPhiBins, 0.0);
  for (int t = 0; t < kThetaBins * kThetaPoints; ++t) {
    const double low = edge(static_cast<double>(t) / (kThetaBins * kThetaPoints));
    const double high = edge((t + 1.0) / (kThetaBins * kThetaPoints));
    const double m = (low + high) / 2;
    const double sine = 2 * std::sqrt(m * (1 - m));
    for (int p = 0; p < kPhiBins * kPhiPoints; ++p) {
      const double phi = phi_i + 2 * M_PI * (p + 0.5) / (kPhiBins * kPhiPoints);
      const double h[3] = {sine * std::cos(phi), sine * std::sin(phi), 1 - 2 * m};
      double cosine = 0;
      for (int d = 0; d < 3; ++d) cosine += static_cast<double>(wi[d]) * h[d];
      if (cosine <= 0) continue;
      float wo[3];
      for (int d = 0; d < 3; ++d)
        wo[d] = static_cast<float>(2 * cosine * h[d] - static_cast<double>(wi[d]));
      const double half_measure = 2 * (high - low) * 2 * M_PI / (kPhiBins * kPhiPoints);
      expected[static_cast<size_t>(t / kThetaPoints * kPhiBins + p / kPhiPoints)] +=
          static_cast<double>(sampler.Pdf(wi, wo)) * 4 * cosine * half_measure;
    }
  }
  std::vector<int> counts(expected.size(), 0);
  Random random(seed);
  int kept = 0;
  for (int s = 0; s < samples; ++s) {
    float u[3];
    for (float& value : u) value = static_cast<float>(random.Next() >> 40) * 0x1p-24f;
    float wo[3];
    float pdf;
    if (!sampler.Sample(wi, u, wo, &pdf)) continue;
    ++kept;
    EXPECT_EQ(pdf, sampler.Pdf(wi, wo));
    double h[3];
    double length = 0;
    for (int d = 0; d < 3; ++d) {
      h[d] = static_cast<double>(wi[d]) + static_cast<double>(wo[d]);
      length += h[d] * h[d];
    }
    length = std::sqrt(length);
    const double theta = std::atan2(std::hypot(h[0], h[1]), h[2]);
    const int t =
        std::min(kThetaBins - 1, static_cast<int>(std::sqrt(theta / (M_PI / 2)) * kThetaBins));
    double turn = (std::atan2(h[1], h[0]) - phi_i) / (2 * M_PI);
    turn -= std::floor(turn);
    const int p = std::min(kPhiBins - 1, static_cast<int>(turn * kPhiBins));
    ++counts[static_cast<size_t>(t * kPhiBins + p)];
  }
  check.kept = static_cast<double>(kept) / samples;
  // Bins of few samples, and what was lost, go together.
  double rest_expected = 1;
  int rest_count = samples;
  for (size_t bin = 0; bin < expected.size(); ++bin) {
    check.integral += expected[bin];
    if (expected[bin] * samples < 20) continue;
    rest_expected -= expected[bin];
    rest_count -= counts[bin];
    const double difference = counts[bin] - expected[bin] * samples;
    check.chi_square += difference * difference / (expected[bin] * samples);
    ++check.degrees;
  }
  if (rest_expected * samples >= 20) {
    const double difference = rest_count - rest_expected * samples;
    check.chi_square += difference * difference / (rest_expected * samples);
  } else {
    --check.degrees;
  }
  const double k = std::max(1, check.degrees);
  check.probability_z =
      (std::cbrt(check.chi_square / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
  return check;
}

}  // namespace patina::test
