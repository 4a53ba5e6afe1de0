#include "tests/bench/ggx_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace patina::bench {
namespace {

constexpr int kParameters = 8;
constexpr int kRounds = 60;
constexpr double kMinAlpha = 0.001, kMaxAlpha = 1.5;

// log alpha, logit f0, log of the diffuse and of the specular colours.
using Point = std::array<double, kParameters>;
constexpr int kAlpha = 0, kF0 = 1, kDiffuse = 2, kSpecular = 5;

// What a pair contributes, whatever the material.
struct Geometry {
  double sin2_h, cos2_h;  // of the half vector's colatitude
  double sin2_i, sin2_o, cos_i, cos_o;
  double edge;  // (1 - cos theta_d)^5
};

struct Term {
  Geometry at;
  double wanted[3];  // log1p(f* c)
  double cosine, importance;
};

Geometry GeometryOf(const brdf::Direction& wi, const brdf::Direction& wo) {
  const double i[3] = {static_cast<double>(wi.x), static_cast<double>(wi.y),
                       static_cast<double>(wi.z)};
  const double o[3] = {static_cast<double>(wo.x), static_cast<double>(wo.y),
                       static_cast<double>(wo.z)};
  const double s[3] = {i[0] + o[0], i[1] + o[1], i[2] + o[2]};
  const double across2 = s[0] * s[0] + s[1] * s[1];
  const double sum2 = std::max(across2 + s[2] * s[2], 1e-24);
  Geometry g{};
  g.sin2_h = across2 / sum2;
  g.cos2_h = s[2] * s[2] / sum2;
  g.sin2_i = i[0] * i[0] + i[1] * i[1];
  g.sin2_o = o[0] * o[0] + o[1] * o[1];
  g.cos_i = i[2];
  g.cos_o = o[2];
  g.edge = std::pow(std::max(0.0, 1 - std::sqrt(sum2) / 2), 5);
  return g;
}

// D V of GGX and the derivative of its logarithm by log alpha.
double Lobe(const Geometry& g, double alpha, double* slope) {
  const double a2 = alpha * alpha;
  const double q = g.sin2_h + a2 * g.cos2_h;
  const double masked_i = std::sqrt(g.cos_i * g.cos_i + a2 * g.sin2_i);
  const double masked_o = std::sqrt(g.cos_o * g.cos_o + a2 * g.sin2_o);
  const double shadow = g.cos_o * masked_i + g.cos_i * masked_o;
  *slope = 2 - 4 * a2 * g.cos2_h / q -
           a2 * (g.cos_o * g.sin2_i / masked_i + g.cos_i * g.sin2_o / masked_o) / shadow;
  return a2 / (2 * std::numbers::pi * q * q * shadow);
}

double Logistic(double x) { return 1 / (1 + std::exp(-x)); }

GgxMaterial MaterialAt(const Point& p) {
  GgxMaterial material;
  material.alpha = static_cast<float>(std::exp(p[kAlpha]));
  material.f0 = static_cast<float>(Logistic(p[kF0]));
  for (int c = 0; c < 3; ++c) {
    material.diffuse[c] = static_cast<float>(std::exp(p[kDiffuse + c]));
    material.specular[c] = static_cast<float>(std::exp(p[kSpecular + c]));
  }
  return material;
}

double Penalty(FitNorm norm, double residual) {
  return norm == FitNorm::kL1 ? std::abs(residual) : residual * residual;
}

struct Normal {
  double loss = 0;
  std::array<std::array<double, kParameters>, kParameters> matrix{};
  Point right{};
};

// Loss at a point, and, if wanted, the normal equations of the (weighted) least squares there.
Normal Accumulate(const std::vector<Term>& terms, FitNorm norm, const Point& p, bool equations) {
  const double alpha = std::exp(p[kAlpha]), f0 = Logistic(p[kF0]);
  double diffuse[3], specular[3];
  for (int c = 0; c < 3; ++c) {
    diffuse[c] = std::exp(p[kDiffuse + c]) / std::numbers::pi;
    specular[c] = std::exp(p[kSpecular + c]);
  }
  Normal normal;
  double total = 0;
  for (const Term& term : terms) {
    double slope = 0;
    const double lobe = Lobe(term.at, alpha, &slope);
    const double fresnel = f0 + (1 - f0) * term.at.edge;
    for (int c = 0; c < 3; ++c) {
      const double shine = specular[c] * lobe * fresnel;
      const double inside = 1 + (diffuse[c] + shine) * term.cosine;
      const double residual = std::log(inside) - term.wanted[c];
      normal.loss += term.importance * Penalty(norm, residual);
      total += term.importance;
      if (!equations) continue;
      // Below a thousandth of log1p a residual counts as its square.
      const double weight =
          term.importance * (norm == FitNorm::kL1 ? 1 / std::max(std::abs(residual), 1e-3) : 1);
      const double outer = term.cosine / inside;
      const int index[4] = {kAlpha, kF0, kDiffuse + c, kSpecular + c};
      const double by[4] = {outer * shine * slope,
                            outer * specular[c] * lobe * (1 - term.at.edge) * f0 * (1 - f0),
                            outer * diffuse[c], outer * shine};
      for (int j = 0; j < 4; ++j) {
        normal.right[index[j]] -= weight * by[j] * residual;
        for (int k = 0; k < 4; ++k) normal.matrix[index[j]][index[k]] += weight * by[j] * by[k];
      }
    }
  }
  normal.loss /= std::max(total, 1e-300);
  return normal;
}

// Solves (matrix + damping * diagonal) x = right by Gauss and Jordan; the matrix is positive.
Point Solve(const Normal& normal, double damping) {
  auto m = normal.matrix;
  Point x = normal.right;
  double largest = 0;
  for (int i = 0; i < kParameters; ++i) largest = std::max(largest, m[i][i]);
  for (int i = 0; i < kParameters; ++i) m[i][i] += damping * m[i][i] + 1e-9 * largest + 1e-300;
  for (int i = 0; i < kParameters; ++i) {
    const double pivot = 1 / m[i][i];
    for (int k = 0; k < kParameters; ++k) m[i][k] *= pivot;
    x[i] *= pivot;
    for (int j = 0; j < kParameters; ++j) {
      if (j == i) continue;
      const double factor = m[j][i];
      for (int k = 0; k < kParameters; ++k) m[j][k] -= factor * m[i][k];
      x[j] -= factor * x[i];
    }
  }
  return x;
}

Point Moved(const Point& from, const Point& by) {
  Point to;
  for (int i = 0; i < kParameters; ++i)
    to[i] = std::clamp(from[i] + std::clamp(by[i], -2.0, 2.0), -30.0, 15.0);
  to[kAlpha] = std::clamp(to[kAlpha], std::log(kMinAlpha), std::log(kMaxAlpha));
  to[kF0] = std::clamp(to[kF0], -12.0, 12.0);
  return to;
}

double Descend(const std::vector<Term>& terms, FitNorm norm, Point* p) {
  double damping = 1e-2;
  Normal here = Accumulate(terms, norm, *p, true);
  for (int round = 0, quiet = 0; round < kRounds && quiet < 4; ++round) {
    const Point next = Moved(*p, Solve(here, damping));
    const double loss = Accumulate(terms, norm, next, false).loss;
    if (loss < here.loss) {
      quiet = here.loss - loss < 1e-5 * here.loss ? quiet + 1 : 0;
      *p = next;
      here = Accumulate(terms, norm, *p, true);
      damping = std::max(1e-6, damping / 4);
    } else {
      damping *= 8;
      if (damping > 1e8) break;
    }
  }
  return here.loss;
}

// The mean colour of the pairs away from highlights and grazing angles, for the starts.
void MeanDiffuse(const std::vector<TrainingPair>& pairs, double colour[3]) {
  double count = 0;
  colour[0] = colour[1] = colour[2] = 0;
  for (const TrainingPair& pair : pairs) {
    const Geometry g = GeometryOf(pair.wi, pair.wo);
    if (g.sin2_h < 0.25 || g.edge > 0.01) continue;
    for (int c = 0; c < 3; ++c) colour[c] += std::max(0.0, static_cast<double>(pair.value[c]));
    ++count;
  }
  for (int c = 0; c < 3; ++c)
    colour[c] = std::max(1e-3, std::numbers::pi * colour[c] / std::max(count, 1.0));
}

}  // namespace

void EvaluateGgx(const GgxMaterial& material, const brdf::Direction& wi, const brdf::Direction& wo,
                 double rgb[3]) {
  rgb[0] = rgb[1] = rgb[2] = 0;
  if (!(wi.z > 0 && wo.z > 0)) return;
  const Geometry g = GeometryOf(wi, wo);
  const auto f0 = static_cast<double>(material.f0);
  double slope = 0;
  const double shine =
      Lobe(g, static_cast<double>(material.alpha), &slope) * (f0 + (1 - f0) * g.edge);
  for (int c = 0; c < 3; ++c)
    rgb[c] = static_cast<double>(material.diffuse[c]) / std::numbers::pi +
             static_cast<double>(material.specular[c]) * shine;
}

Result<GgxFit> FitGgx(const brdf::Source& source, const GgxFitOptions& options, ThreadPool& pool) {
  brdf::PoolOptions draw;
  draw.count = options.pairs;
  draw.half_angle_share = options.half_angle_share;
  draw.seed = options.seed;
  const std::vector<TrainingPair> pairs = DrawTrainingPairs(source, draw, pool);
  if (pairs.size() < 64)
    return Fail(ErrorCode::kCorruptData, "too few directions have valid data to fit to");
  std::vector<Term> terms(pairs.size());
  for (size_t n = 0; n < pairs.size(); ++n) {
    const TrainingPair& pair = pairs[n];
    terms[n].at = GeometryOf(pair.wi, pair.wo);
    terms[n].cosine = static_cast<double>(pair.cosine);
    terms[n].importance = static_cast<double>(pair.importance);
    for (int c = 0; c < 3; ++c) {
      const double wanted = std::max(0.0, static_cast<double>(pair.value[c]));
      terms[n].wanted[c] = std::log1p(wanted * terms[n].cosine);
    }
  }
  double diffuse[3];
  MeanDiffuse(pairs, diffuse);
  constexpr double kAlphas[] = {0.01, 0.04, 0.12, 0.3, 0.7}, kReflectances[] = {0.05, 0.6};
  constexpr int kStarts = 10;
  std::vector<Point> points(kStarts);
  std::vector<double> losses(kStarts);
  pool.ParallelFor(kStarts, [&](int s, int) {
    Point& p = points[s];
    const double f0 = kReflectances[s % 2];
    p[kAlpha] = std::log(kAlphas[s / 2]);
    p[kF0] = std::log(f0 / (1 - f0));
    for (int c = 0; c < 3; ++c) {
      p[kDiffuse + c] = std::log(diffuse[c]);
      p[kSpecular + c] = std::log(0.5);
    }
    losses[s] = Descend(terms, options.norm, &p);
  });
  size_t best = 0;
  for (size_t s = 1; s < losses.size(); ++s) {
    if (losses[s] < losses[best]) best = s;
  }
  return GgxFit{MaterialAt(points[best]), losses[best]};
}

}  // namespace patina::bench
