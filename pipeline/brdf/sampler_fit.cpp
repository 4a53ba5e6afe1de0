#include "pipeline/brdf/sampler_fit.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "pipeline/base/rng.h"

namespace patina::brdf {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kThetaPoints = 3;  // of the quadrature in a bin of theta_i
constexpr int kCellPoints = 2;   // in a cell, along theta_h
constexpr int kPhiPoints = 32;   // of the half vector's azimuth, all cells together
constexpr double kFloors[] = {0, 0.5, 0.9};
constexpr int kMixtureSteps = 20;
constexpr int kMostHalf = 18;  // of those, for the half vectors: the cosine keeps the rest

// One point of the quadrature: the light f cos(theta_o) and the measure of wo.
struct Point {
  size_t cell;
  double light;
  double cosine;    // of wo
  double measure;   // solid angle of wo; 0 where wo is below the horizon
  double jacobian;  // dh / dwo
};

// By sums and products only: the C library's functions differ between CPUs in the last bit, and
// what is computed here decides the bytes of a file. |x| < 8.
struct SineCosine {
  double sine;
  double cosine;
};
SineCosine SineCosineOf(double x) {
  const double y = x / 64;
  const double y2 = y * y;
  double s = y * (1 - y2 / 6 * (1 - y2 / 20 * (1 - y2 / 42 * (1 - y2 / 72))));
  double versine = y2 / 2 * (1 - y2 / 12 * (1 - y2 / 30 * (1 - y2 / 56 * (1 - y2 / 90))));
  for (int i = 0; i < 6; ++i) {
    const double doubled = 2 * s * (1 - versine);
    versine = 2 * s * s;
    s = doubled;
  }
  return {s, 1 - versine};
}

// The code whose MassOf is nearest to a share in (0, 1] on a logarithmic scale.
uint8_t CodeOf(double share) {
  int code = 255;
  while (code > 0) {
    const double next = code > 1 ? brdf_sampler_detail::MassOf(static_cast<uint8_t>(code - 1)) : 0;
    const double here = brdf_sampler_detail::MassOf(static_cast<uint8_t>(code));
    if (share * share >= here * next && share > 0) break;
    --code;
  }
  return static_cast<uint8_t>(code);
}

double Sane(double value) { return std::isfinite(value) && value > 0 ? value : 0; }

class BinFit {
 public:
  BinFit(const SamplerShape& shape, int bin, const Luminance& luminance) : shape_(shape) {
    const auto cells =
        static_cast<size_t>(shape.theta_h_cells) * static_cast<size_t>(shape.phi_cells);
    area_.resize(cells);
    const int azimuths = shape.isotropic ? 1 : 4;
    for (int i = 0; i < kThetaPoints; ++i) {
      const double theta = kPi / 2 * (bin + (i + 0.5) / kThetaPoints) / shape.theta_i_bins;
      for (int a = 0; a < azimuths; ++a)
        AddDirection(theta, 2 * kPi * (a + 0.25) / azimuths, luminance);
    }
  }

  // Sets the bin's codes and mixture.
  void Fit(uint8_t* mixture, uint8_t* codes) const {
    double best_second_moment = SecondMoment(std::vector<double>(area_.size(), 0), 0);
    *mixture = 0;
    std::fill_n(codes, area_.size(), uint8_t{0});
    const double floor = DiffuseFloor();
    for (const double part : kFloors) {
      std::vector<uint8_t> candidate(area_.size());
      const std::vector<double> density = Table(part * floor, candidate.data());
      if (density.empty()) continue;
      for (int step = 1; step <= kMostHalf; ++step) {
        const auto code = static_cast<uint8_t>((255 * step + kMixtureSteps / 2) / kMixtureSteps);
        const double moment = SecondMoment(density, code / 255.0);
        if (moment < best_second_moment) {
          best_second_moment = moment;
          *mixture = code;
          std::copy(candidate.begin(), candidate.end(), codes);
        }
      }
    }
  }

 private:
  void AddDirection(double theta_i, double phi_i, const Luminance& luminance) {
    const SineCosine theta = SineCosineOf(theta_i);
    const SineCosine azimuth = SineCosineOf(phi_i);
    const float wi[3] = {static_cast<float>(theta.sine * azimuth.cosine),
                         static_cast<float>(theta.sine * azimuth.sine),
                         static_cast<float>(theta.cosine)};
    const int in_cell = std::max(1, kPhiPoints / shape_.phi_cells);
    for (int t = 0; t < shape_.theta_h_cells; ++t) {
      const double low = HalfSineSquare(t);
      const double high = HalfSineSquare(t + 1);
      for (int p = 0; p < shape_.phi_cells; ++p) {
        const size_t cell =
            static_cast<size_t>(t) * static_cast<size_t>(shape_.phi_cells) + static_cast<size_t>(p);
        area_[cell] = 4 * kPi / shape_.phi_cells * (high - low);
        for (int i = 0; i < kCellPoints; ++i) {
          const double m = low + (high - low) * (i + 0.5) / kCellPoints;
          for (int j = 0; j < in_cell; ++j) {
            const double turn = (p + (j + 0.5) / in_cell) / shape_.phi_cells;
            // An isotropic material is the same on both sides of the plane of incidence.
            const double phi = shape_.isotropic ? phi_i + kPi * turn : 2 * kPi * turn;
            Add(cell, wi, m, phi, area_[cell] / (kCellPoints * in_cell), luminance);
          }
        }
      }
    }
  }

  double HalfSineSquare(int edge) const {
    const double x = static_cast<double>(edge) / shape_.theta_h_cells;
    const double sine = SineCosineOf(kPi / 4 * x * x).sine;
    return sine * sine;
  }

  void Add(size_t cell, const float wi[3], double m, double phi, double half_measure,
           const Luminance& luminance) {
    const double sine = 2 * std::sqrt(m * (1 - m));
    const SineCosine azimuth = SineCosineOf(phi);
    const double h[3] = {sine * azimuth.cosine, sine * azimuth.sine, 1 - 2 * m};
    const double cosine = static_cast<double>(wi[0]) * h[0] + static_cast<double>(wi[1]) * h[1] +
                          static_cast<double>(wi[2]) * h[2];
    if (!(cosine > 0)) return;
    float wo[3];
    for (int d = 0; d < 3; ++d)
      wo[d] = static_cast<float>(2 * cosine * h[d] - static_cast<double>(wi[d]));
    if (!(wo[2] > 0)) return;
    const auto z = static_cast<double>(wo[2]);
    points_.push_back(
        {cell, Sane(luminance(wi, wo)) * z, z, half_measure * 4 * cosine, 1 / (4 * cosine)});
  }

  // A level of f that most of the hemisphere reaches: its lower quartile by cosine.
  double DiffuseFloor() const {
    std::vector<std::pair<double, double>> values;  // f, weight
    double total = 0;
    for (const Point& point : points_) {
      if (point.cosine < 1e-3) continue;
      values.emplace_back(point.light / point.cosine, point.cosine * point.measure);
      total += values.back().second;
    }
    std::sort(values.begin(), values.end());
    double sum = 0;
    for (const auto& [value, weight] : values) {
      sum += weight;
      if (sum >= total / 4) return value;
    }
    return 0;
  }

  // The codes of a table for the light above a floor of f, and the density of half vectors that
  // they decode to; empty if there is no such light.
  std::vector<double> Table(double floor, uint8_t* codes) const {
    std::vector<double> mass(area_.size(), 0);
    for (const Point& point : points_)
      mass[point.cell] += std::max(0.0, point.light - floor * point.cosine) * point.measure;
    const double most = *std::max_element(mass.begin(), mass.end());
    if (!(most > 0)) return {};
    double sum = 0;
    for (size_t c = 0; c < mass.size(); ++c) {
      codes[c] = CodeOf(mass[c] / most);
      mass[c] = brdf_sampler_detail::MassOf(codes[c]);
      sum += mass[c];
    }
    for (size_t c = 0; c < mass.size(); ++c) mass[c] /= sum * area_[c];
    return mass;
  }

  // Of f cos / pdf; the mean does not depend on the pdf.
  double SecondMoment(const std::vector<double>& density, double share) const {
    double sum = 0;
    for (const Point& point : points_) {
      const double pdf =
          (1 - share) * point.cosine / kPi + share * density[point.cell] * point.jacobian;
      if (pdf > 0) sum += point.light * point.light / pdf * point.measure;
    }
    return sum;
  }

  const SamplerShape& shape_;
  std::vector<double> area_;  // of each cell: solid angle of half vectors
  std::vector<Point> points_;
};

}  // namespace

BrdfSamplerTables FitSampler(const SamplerShape& shape, const Luminance& luminance) {
  BrdfSamplerTables tables;
  tables.theta_i_bins = shape.theta_i_bins;
  tables.theta_h_cells = shape.theta_h_cells;
  tables.phi_cells = shape.phi_cells;
  tables.relative_phi = shape.isotropic;
  const auto bins = static_cast<size_t>(shape.theta_i_bins);
  tables.mixture.resize(bins);
  tables.mass.resize(bins * tables.CellsInBin());
  for (size_t bin = 0; bin < bins; ++bin) {
    const BinFit fit(shape, static_cast<int>(bin), luminance);
    fit.Fit(&tables.mixture[bin], tables.mass.data() + bin * tables.CellsInBin());
  }
  return tables;
}

double RelativeVariance(const BrdfSampler& sampler, const Luminance& luminance, int directions,
                        int samples) {
  Rng rng(1);
  double total = 0;
  for (int i = 0; i < directions; ++i) {
    const double z = (i + 0.5) / directions;
    const float phi = static_cast<float>(2 * kPi) * rng.Uniform();
    const auto sine = static_cast<float>(std::sqrt(1 - z * z));
    const float wi[3] = {sine * std::cos(phi), sine * std::sin(phi), static_cast<float>(z)};
    double first = 0;
    double second = 0;
    for (int s = 0; s < samples; ++s) {
      const float u[3] = {rng.Uniform(), rng.Uniform(), rng.Uniform()};
      float wo[3];
      float pdf;
      if (!sampler.Sample(wi, u, wo, &pdf)) continue;
      const double value =
          Sane(luminance(wi, wo)) * static_cast<double>(wo[2]) / static_cast<double>(pdf);
      first += value;
      second += value * value;
    }
    first /= samples;
    second /= samples;
    if (first > 0) total += (second - first * first) / (first * first);
  }
  return total / directions;
}

}  // namespace patina::brdf
