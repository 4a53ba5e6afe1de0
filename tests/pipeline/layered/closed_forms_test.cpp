// The simulator against what can be calculated. All seeds are fixed.
#include <complex>

#include "tests/pipeline/layered/statistics.h"

namespace patina::layered::test {
namespace {

using brdf::Direction;

// Fresnel's equations as they stand in textbooks.
double TextbookFresnel(double cosine, std::complex<double> index) {
  const std::complex<double> sine2 = 1 - cosine * cosine;
  const std::complex<double> cos_t = std::sqrt(1.0 - sine2 / (index * index));
  const auto s = (cosine - index * cos_t) / (cosine + index * cos_t);
  const auto p = (index * cosine - cos_t) / (index * cosine + cos_t);
  return (std::norm(s) + std::norm(p)) / 2;
}

// The GGX lobe by slopes instead of directions: P22(x, y) = 1 / (pi ax ay (1 + x2/ax2 + y2/ay2)^2).
double TextbookLobe(const Direction& a, const Direction& b, double ax, double ay, double* cosine) {
  const double hx = static_cast<double>(a.x) + static_cast<double>(b.x),
               hy = static_cast<double>(a.y) + static_cast<double>(b.y),
               hz = static_cast<double>(a.z) + static_cast<double>(b.z);
  const double length = std::sqrt(hx * hx + hy * hy + hz * hz);
  const double sx = hx / hz / ax, sy = hy / hz / ay, cos_h = hz / length;
  const double slopes = 1 / (kPi * ax * ay * std::pow(1 + sx * sx + sy * sy, 2));
  const auto lambda = [&](const Direction& w) {
    const double x = ax * static_cast<double>(w.x), y = ay * static_cast<double>(w.y),
                 z = static_cast<double>(w.z);
    return (-1 + std::sqrt(1 + (x * x + y * y) / (z * z))) / 2;
  };
  *cosine = length / 2;
  return slopes / std::pow(cos_h, 4) / (1 + lambda(a) + lambda(b)) /
         (4 * static_cast<double>(a.z) * static_cast<double>(b.z));
}

double One(const Simulator& simulator, const Direction& wi, const Direction& wo) {
  Rng rng(1);
  double sum[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
  simulator.AddPaths(wi, wo, 1, &rng, sum, squares);
  return sum[0];
}

TEST(LayeredClosedForms, OneSurfaceIsItsMicrofacetLobe) {
  Rng rng(1);
  for (int i = 0; i < 2000; ++i) {
    const double ax = Magnitude(&rng, 1e-4, 1),
                 ay = rng.Below(2) == 0 ? ax : Magnitude(&rng, 1e-4, 1);
    Direction wi = Above(&rng, 1e-3), wo = Above(&rng, 1e-3);
    // Half of the pairs about the mirror direction, where narrow lobes are.
    if (rng.Below(2) == 0) wo = {-wi.x, -wi.y, wi.z};
    Stack stack;
    double cosine, fresnel;
    if (rng.Below(2) == 0) {
      Layer layer;
      layer.ior = 1 + Magnitude(&rng, 1e-4, 3);
      layer.roughness = {ax, ay, 0};
      stack.layers.push_back(layer);
      TextbookLobe(wi, wo, ax, ay, &cosine);
      fresnel = TextbookFresnel(cosine, layer.ior);
    } else {
      const double eta = Magnitude(&rng, 0.1, 4), k = Magnitude(&rng, 0.1, 8);
      stack.parts.push_back(Conductor({eta, eta, eta}, {k, k, k}, {ax, ay, 0}));
      TextbookLobe(wi, wo, ax, ay, &cosine);
      fresnel = TextbookFresnel(cosine, {eta, k});
    }
    const double expected = TextbookLobe(wi, wo, ax, ay, &cosine) * fresnel;
    // Lengths of single-precision directions are off by 1e-7, which a lobe of 1e-4 feels.
    const double bound = 1e-5 + 1e-6 / std::min(ax, ay);
    EXPECT_NEAR(One(Simulator(stack), wi, wo), expected, bound * expected + 1e-12)
        << Name(stack) << wi.z << " " << wo.z;
  }
}

TEST(LayeredClosedForms, BeersLawOverADiffuseBase) {
  Rng rng(2);
  for (int i = 0; i < 500; ++i) {
    const double depth = Magnitude(&rng, 1e-6, 1e3), albedo = Unit(&rng);
    Stack stack;
    Layer layer;
    layer.ior = 1;  // no surface
    layer.thickness = Magnitude(&rng, 0.01, 100);
    for (double& a : layer.absorption) a = depth / layer.thickness;
    stack.layers.push_back(layer);
    stack.parts.push_back(Diffuse(albedo));
    const Direction wi = Above(&rng), wo = Above(&rng);
    const double expected =
        albedo / kPi *
        std::exp(-depth / static_cast<double>(wi.z) - depth / static_cast<double>(wo.z));
    EXPECT_NEAR(One(Simulator(stack), wi, wo), expected, 1e-6 * expected * (1 + 100 * depth))
        << depth;
  }
}

TEST(LayeredClosedForms, SmoothDielectricOverDiffuse) {
  constexpr int kCount = 1000;
  Comparisons comparisons(kCount);
  Rng rng(3);
  for (int i = 0; i < kCount; ++i) {
    const double ior = 1 + Magnitude(&rng, 1e-4, 3), albedo = Unit(&rng);
    Stack stack;
    stack.layers.push_back({});
    stack.layers[0].ior = ior;
    stack.parts.push_back(Diffuse(albedo));
    const Direction wi = Above(&rng), wo = Above(&rng);
    // The share of diffuse light that is reflected inside: the critical angle is an edge of panels.
    double inside = 0;
    const double critical = 1 - 1 / (ior * ior);  // of the cosine's square
    for (int panel = 0; panel < 2; ++panel) {
      const double low = panel == 0 ? 0 : std::sqrt(critical),
                   high = panel == 0 ? std::sqrt(critical) : 1;
      constexpr int kSteps = 4000;
      for (int s = 0; s < kSteps; ++s) {
        const double c = low + (high - low) * (s + 0.5) / kSteps;
        const double reflected = panel == 0 ? 1 : TextbookFresnel(c, 1 / ior);
        inside += 2 * c * reflected * (high - low) / kSteps;
      }
    }
    const double ti = 1 - TextbookFresnel(static_cast<double>(wi.z), ior),
                 to = 1 - TextbookFresnel(static_cast<double>(wo.z), ior);
    const double expected = ti * to / (ior * ior) * albedo / kPi / (1 - albedo * inside);
    const Estimate estimate = Simulator(stack).Average(wi, wo, 1000, 1);
    // Where few paths are reflected inside, the error follows from their chance, not from the few.
    const double variance =
        std::max(estimate.variance[0], expected * expected * albedo * inside / estimate.paths);
    comparisons.Compare(estimate.f[0], variance, expected, (1e-5 + 1.0 / estimate.paths) * expected,
                        Name(stack));
  }
}

TEST(LayeredClosedForms, TwoSmoothSurfacesWithTheLightBetweenThem) {
  constexpr int kCount = 300;
  Comparisons comparisons(kCount);
  Rng rng(4);
  for (int i = 0; i < kCount; ++i) {
    const double n1 = 1 + Magnitude(&rng, 1e-4, 3), n2 = 1 + Magnitude(&rng, 1e-4, 3);
    const double depth = Magnitude(&rng, 1e-6, 3);
    Stack stack;
    stack.layers.resize(2);
    stack.layers[0].ior = n1;
    stack.layers[0].thickness = 2;
    for (double& a : stack.layers[0].absorption) a = depth / 2;
    stack.layers[1].ior = n2;
    const Direction w = Above(&rng);
    const double c = static_cast<double>(w.z), ct = std::sqrt(1 - (1 - c * c) / (n1 * n1));
    const double r1 = TextbookFresnel(c, n1), r2 = TextbookFresnel(ct, n2 / n1);
    const double e2 = std::exp(-2 * depth / ct);
    const double expected = r1 + (1 - r1) * (1 - r1) * r2 * e2 / (1 - r1 * r2 * e2);
    Tally tally;
    const Simulator simulator(stack);
    for (int s = 0; s < 2000; ++s) {
      const Exit exit = simulator.Walk(w, &rng);
      if (exit.left) {
        EXPECT_TRUE(exit.smooth);
        EXPECT_NEAR(exit.direction.x, static_cast<double>(-w.x), 1e-6);
      }
      tally.Add(exit.weight[0]);
    }
    // All or nothing for rare exits: too few of them are no normal deviate.
    const double binomial = expected * (1 - expected) / tally.count;
    comparisons.Compare(tally.mean(), std::max(tally.variance(), binomial), expected, 4e-3,
                        Name(stack));
  }
}

TEST(LayeredClosedForms, OneScatteringInASlab) {
  constexpr int kCount = 600;
  Comparisons comparisons(kCount);
  Rng rng(5);
  for (int i = 0; i < kCount; ++i) {
    const double depth = Magnitude(&rng, 1e-6, 1e3), g = Between(&rng, -0.9, 0.9), omega = 1e-6;
    Stack stack;
    stack.layers.resize(1);
    Layer& layer = stack.layers[0];
    layer.ior = 1;
    layer.thickness = 0.5;
    layer.asymmetry = g;
    for (size_t c = 0; c < 3; ++c) {
      layer.scattering[c] = omega * depth / layer.thickness;
      layer.absorption[c] = (1 - omega) * depth / layer.thickness;
    }
    const Direction wi = Above(&rng), wo = Above(&rng);
    const double mi = static_cast<double>(wi.z), mo = static_cast<double>(wo.z);
    const double cosine = -(static_cast<double>(wi.x) * static_cast<double>(wo.x) +
                            static_cast<double>(wi.y) * static_cast<double>(wo.y) + mi * mo);
    const double phase = (1 - g * g) / (4 * kPi * std::pow(1 + g * g - 2 * g * cosine, 1.5));
    const double expected = omega * phase / (mi + mo) * -std::expm1(-depth * (1 / mi + 1 / mo));
    const int paths = depth < 0.01 ? 20 : 1000;
    const Estimate estimate = Simulator(stack).Average(wi, wo, paths, 1);
    // Few paths scatter in thin slabs: the error follows from their chance, not from the few.
    const double chance = -std::expm1(-depth / mi);
    const double single = omega * phase / mo;
    const double variance = std::max(estimate.variance[0], single * single * chance / paths);
    comparisons.Compare(estimate.f[0], variance, expected, 1e-5 * expected + single / paths,
                        Name(stack));
  }
}

// H of Chandrasekhar for isotropic scattering of albedo omega, at m: by iteration of his equation
// 1/H(m) = sqrt(1 - omega) + omega/2 int x H(x) / (m + x) dx.
double ChandrasekharH(double omega, double m) {
  constexpr int kNodes = 200;
  static double h[kNodes];
  for (double& v : h) v = 1;
  const auto next = [&](double at) {
    double sum = 0;
    for (int j = 0; j < kNodes; ++j) {
      const double x = (j + 0.5) / kNodes;
      sum += x * h[j] / (at + x) / kNodes;
    }
    return 1 / (std::sqrt(1 - omega) + omega / 2 * sum);
  };
  for (int round = 0; round < 40; ++round) {
    for (int j = 0; j < kNodes; ++j) h[j] = next((j + 0.5) / kNodes);
  }
  return next(m);
}

TEST(LayeredClosedForms, DeepIsotropicMediumIsChandrasekhars) {
  constexpr int kAlbedos = 4, kPairs = 8;
  Comparisons comparisons(kAlbedos * kPairs);
  Rng rng(6);
  for (const double omega : {0.2, 0.6, 0.9, 0.99}) {
    Stack stack;
    stack.layers.resize(1);
    stack.layers[0].ior = 1;
    stack.layers[0].thickness = 200;
    for (size_t c = 0; c < 3; ++c) {
      stack.layers[0].scattering[c] = omega;
      stack.layers[0].absorption[c] = 1 - omega;
    }
    const Simulator simulator(stack);
    for (int i = 0; i < kPairs; ++i) {
      const Direction wi = Above(&rng), wo = Above(&rng);
      const double mi = static_cast<double>(wi.z), mo = static_cast<double>(wo.z);
      const double expected =
          omega / (4 * kPi) * ChandrasekharH(omega, mi) * ChandrasekharH(omega, mo) / (mi + mo);
      const Estimate estimate = simulator.Average(wi, wo, 5000, 1);
      comparisons.Compare(estimate.f[0], estimate.variance[0], expected, 1e-4 * expected,
                          Name(stack));
    }
  }
}

}  // namespace
}  // namespace patina::layered::test
