#include "pipeline/layered/simulator.h"

#include <vector>

#include "tests/pipeline/layered/statistics.h"

namespace patina::layered::test {
namespace {

using brdf::Direction;

double Z(const Direction& w) { return static_cast<double>(w.z); }

TEST(LayeredSimulator, ReciprocalWhateverTheStack) {
  constexpr int kStacks = 400;
  Comparisons comparisons(3 * kStacks);
  Rng rng(1);
  for (int i = 0; i < kStacks; ++i) {
    const Stack stack = RandomStack(&rng, 0.1);
    const Simulator simulator(stack);
    const Direction a = Above(&rng, 0.1), b = Above(&rng, 0.1);
    const Estimate there = simulator.Average(a, b, 600, 1), back = simulator.Average(b, a, 600, 2);
    for (size_t c = 0; c < 3; ++c) {
      comparisons.Compare(there.f[c], there.variance[c] + back.variance[c], back.f[c],
                          1e-5 * back.f[c] + 1e-9, Name(stack));
    }
  }
}

// f with its connections, integrated by the sampler, against walks that connect nothing.
TEST(LayeredSimulator, TheIntegralOfFIsWhatWalksCarryOut) {
  constexpr int kStacks = 60;
  Comparisons comparisons(3 * kStacks);
  Rng rng(2);
  for (int i = 0; i < kStacks; ++i) {
    const Stack stack = RandomStack(&rng, 0.1);
    const Simulator simulator(stack);
    const Direction wi = Above(&rng, 0.2);
    Tally carried[3], integral[3];
    for (int s = 0; s < 3000; ++s) {
      const Exit exit = simulator.Walk(wi, &rng);
      for (int c = 0; c < 3; ++c) carried[c].Add(exit.smooth ? 0 : exit.weight[c]);
      const double u[3] = {Unit(&rng), Unit(&rng), Unit(&rng)};
      Direction wo;
      double pdf, f[3] = {0, 0, 0}, squares[3];
      const bool kept = simulator.Sample(wi, u, &wo, &pdf);
      if (kept) simulator.AddPaths(wi, wo, 1, &rng, f, squares);
      for (int c = 0; c < 3; ++c) integral[c].Add(kept ? f[c] * Z(wo) / pdf : 0);
    }
    for (int c = 0; c < 3; ++c) {
      comparisons.Compare(carried[c].mean(), carried[c].variance() + integral[c].variance(),
                          integral[c].mean(), 1e-6, Name(stack));
    }
  }
}

TEST(LayeredSimulator, WhiteFurnace) {
  Rng rng(3);
  // Smooth surfaces, a medium that only scatters, a white base: every walk comes out whole.
  for (int i = 0; i < 200; ++i) {
    Stack stack;
    stack.layers.resize(1 + rng.Below(3));
    for (Layer& layer : stack.layers) {
      layer.ior = 1 + Magnitude(&rng, 1e-4, 3);
      layer.thickness = 1;
      const double scattering = rng.Below(2) == 0 ? Magnitude(&rng, 1e-6, 10) : 0;
      layer.scattering = {scattering, scattering, scattering};
      layer.asymmetry = Between(&rng, -0.9, 0.9);
    }
    stack.parts.push_back(Diffuse(1));
    const Simulator simulator(stack);
    const Direction w = Above(&rng, 0.001);
    for (int s = 0; s < 10; ++s) {
      const Exit exit = simulator.Walk(w, &rng);
      ASSERT_TRUE(exit.left) << Name(stack);
      for (const double weight : exit.weight) EXPECT_NEAR(weight, 1, 1e-9) << Name(stack);
    }
  }
  // Where channels scatter differently, one path serves all three: whole on average.
  constexpr int kStacks = 20;
  Comparisons comparisons(3 * kStacks);
  for (int i = 0; i < kStacks; ++i) {
    Stack stack;
    stack.layers.resize(1);
    stack.layers[0].thickness = 1;
    for (double& s : stack.layers[0].scattering) s = Magnitude(&rng, 0.1, 2);
    stack.parts.push_back(Diffuse(1));
    const Simulator simulator(stack);
    const Direction w = Above(&rng);
    Tally tally[3];
    for (int s = 0; s < 4000; ++s) {
      const Exit exit = simulator.Walk(w, &rng);
      for (int c = 0; c < 3; ++c) tally[c].Add(exit.weight[c]);
    }
    for (const Tally& channel : tally)
      comparisons.Compare(channel.mean(), channel.variance(), 1, 1e-9, Name(stack));
  }
}

// Facets lose what they send onto each other; with little roughness that is little.
TEST(LayeredSimulator, RoughSurfacesGainNothingAndLoseLittle) {
  Rng rng(4);
  for (const double alpha : {1e-4, 0.01, 0.1, 0.3, 1.0}) {
    Stack stack;
    stack.layers.resize(1);
    stack.layers[0].roughness = {alpha, alpha, 0};
    stack.parts.push_back(Diffuse(1));
    const Simulator simulator(stack);
    for (const float z : {0.01f, 0.3f, 1.0f}) {
      const Direction w{std::sqrt(1 - z * z), 0, z};
      Tally tally;
      for (int s = 0; s < 4000; ++s) tally.Add(simulator.Walk(w, &rng).weight[0]);
      EXPECT_LE(tally.mean(), 1 + 1e-9);
      if (alpha <= 0.01 && z > 0.1f) {
        EXPECT_GT(tally.mean(), 0.995) << alpha << " " << z;
      }
    }
  }
}

// A slab without surfaces against a walk written for it alone, exits counted by cosine.
TEST(LayeredSimulator, ASlabAgainstABruteForceWalk) {
  constexpr int kBins = 8, kSlabs = 6, kWalks = 20000;
  Comparisons comparisons(kBins * kSlabs);
  Rng rng(5);
  for (int slab = 0; slab < kSlabs; ++slab) {
    const double depth = std::vector<double>{1e-6, 0.1, 1, 3, 10, 1e3}[slab];
    const double omega = slab == 5 ? 0.9 : Between(&rng, 0.5, 1), g = slab < 3 ? 0.6 : -0.3;
    const double mi = 0.7;
    double counts[kBins] = {};
    for (int walk = 0; walk < kWalks; ++walk) {
      double z = 0, m = mi;  // optical depth, cosine downwards
      for (;;) {
        z += m * -std::log(1 - Unit(&rng));
        if (z < 0 || z > depth || Unit(&rng) >= omega) break;
        // Henyey and Greenstein's cosine against the old direction, the azimuth even.
        const double s = (1 - g * g) / (1 - g + 2 * g * Unit(&rng));
        const double c = (1 + g * g - s * s) / (2 * g), phi = Between(&rng, 0, 2 * kPi);
        m = m * c + std::sqrt((1 - m * m) * (1 - c * c)) * std::cos(phi);
      }
      if (z < 0) counts[std::min(kBins - 1, static_cast<int>(-m * kBins))] += 1;
    }
    Stack stack;
    stack.layers.resize(1);
    Layer& layer = stack.layers[0];
    layer.ior = 1;
    layer.thickness = 3;
    layer.asymmetry = g;
    for (size_t c = 0; c < 3; ++c) {
      layer.scattering[c] = omega * depth / 3;
      layer.absorption[c] = (1 - omega) * depth / 3;
    }
    const Simulator simulator(stack);
    const Direction wi{std::sqrt(1 - 0.7f * 0.7f), 0, 0.7f};
    for (int bin = 0; bin < kBins; ++bin) {
      Tally tally;
      for (int s = 0; s < 1500; ++s) {
        const double z = (bin + Unit(&rng)) / kBins, phi = Between(&rng, 0, 2 * kPi),
                     r = std::sqrt(1 - z * z);
        const Direction wo{static_cast<float>(r * std::cos(phi)),
                           static_cast<float>(r * std::sin(phi)), static_cast<float>(z)};
        double f[3] = {0, 0, 0}, squares[3];
        simulator.AddPaths(wi, wo, 1, &rng, f, squares);
        tally.Add(f[0] * z * 2 * kPi / kBins);
      }
      const double share = counts[bin] / kWalks;
      comparisons.Compare(tally.mean(), tally.variance() + share / kWalks + 1.0 / kWalks / kWalks,
                          share, 1e-7, "bin " + std::to_string(bin) + " of " + Name(stack));
    }
  }
}

// Directions in cells of equal solid angle, 8 by 16.
TEST(LayeredSimulator, SamplesFollowTheirDensity) {
  constexpr int kSamples = 40000, kRows = 8, kColumns = 16, kFine = 24;
  Rng rng(6);
  for (int i = 0; i < 6; ++i) {
    Stack stack;
    stack.layers.resize(1);
    stack.layers[0].roughness = i < 2 ? Roughness{0.3, 0.3, 0} : Roughness{0.5, 0.25, 0.7};
    if (i % 2 == 0) stack.parts.push_back(Diffuse(0.5));
    if (i % 2 == 1)
      stack.parts.push_back(Conductor({0.2, 0.9, 1.3}, {3.9, 2.5, 2.2}, {0.3, 0.4, 0.2}));
    const Simulator simulator(stack);
    const Direction wi = Above(&rng, 0.1);
    std::vector<double> expected(kRows * kColumns), counts(kRows * kColumns);
    for (int row = 0; row < kRows * kFine; ++row) {
      for (int column = 0; column < kColumns * kFine; ++column) {
        const double z = (row + 0.5) / (kRows * kFine),
                     phi = 2 * kPi * (column + 0.5) / (kColumns * kFine), r = std::sqrt(1 - z * z);
        const Direction wo{static_cast<float>(r * std::cos(phi)),
                           static_cast<float>(r * std::sin(phi)), static_cast<float>(z)};
        expected[static_cast<size_t>(row / kFine * kColumns + column / kFine)] +=
            simulator.Pdf(wi, wo) * 2 * kPi / (kRows * kColumns * kFine * kFine);
      }
    }
    double lost = 0;
    for (int s = 0; s < kSamples; ++s) {
      const double u[3] = {Unit(&rng), Unit(&rng), Unit(&rng)};
      Direction wo;
      double pdf;
      if (!simulator.Sample(wi, u, &wo, &pdf)) {
        ++lost;
        continue;
      }
      EXPECT_EQ(pdf, simulator.Pdf(wi, wo));
      double turn = std::atan2(static_cast<double>(wo.y), static_cast<double>(wo.x)) / (2 * kPi);
      turn -= std::floor(turn);
      const int row = std::min(kRows - 1, static_cast<int>(Z(wo) * kRows)),
                column = std::min(kColumns - 1, static_cast<int>(turn * kColumns));
      ++counts[static_cast<size_t>(row * kColumns + column)];
    }
    double square = 0, rest_expected = kSamples, rest = 0;
    int cells = 0;
    for (size_t cell = 0; cell < counts.size(); ++cell) {
      const double wanted = expected[cell] * kSamples;
      if (wanted < 20) {
        rest += counts[cell];
        continue;
      }
      rest_expected -= wanted;
      square += (counts[cell] - wanted) * (counts[cell] - wanted) / wanted;
      ++cells;
    }
    rest += lost;
    if (rest_expected >= 20) {
      square += (rest - rest_expected) * (rest - rest_expected) / rest_expected;
    } else {
      --cells;
    }
    // As a normal deviate (Wilson and Hilferty); 6 of them beyond 5 by chance: 4e-6.
    const double k = cells,
                 deviate = (std::cbrt(square / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
    EXPECT_LT(deviate, 5) << i;
  }
}

TEST(LayeredSimulator, FiniteAtEveryExtreme) {
  Rng rng(7);
  for (const double alpha : {0.0, 1e-4, 1.0}) {
    for (const double ior : {1.0, 1.0001, 4.0}) {
      for (const double depth : {0.0, 1e-6, 1e3}) {
        for (int kind = 0; kind < 4; ++kind) {
          Stack stack;
          stack.layers.resize(2);
          stack.layers[0].ior = ior;
          stack.layers[1].ior = 1.5;
          for (Layer& layer : stack.layers) {
            layer.roughness = {alpha, kind == 3 && alpha > 0 ? 1.0 : alpha, 0.5};
            layer.thickness = 1;
            layer.asymmetry = 0.99;
            for (size_t c = 0; c < 3; ++c) {
              layer.absorption[c] = kind < 2 ? depth * static_cast<double>(c + 1) : 0.1 * depth;
              layer.scattering[c] = kind < 1 ? 0 : depth / static_cast<double>(c + 1);
            }
          }
          stack.parts.push_back(
              kind % 2 == 0 ? Diffuse(1) : Conductor({0.1, 1, 4}, {8, 2, 0}, {alpha, alpha, 0}));
          const Simulator simulator(stack);
          for (const float zi : {1e-6f, 0.01f, 0.5f, 1.0f}) {
            for (const float zo : {1e-6f, 0.5f, 1.0f}) {
              const Direction wi{std::sqrt(1 - zi * zi), 0, zi};
              const Direction wo{-0.8f * std::sqrt(1 - zo * zo), 0.6f * std::sqrt(1 - zo * zo), zo};
              double f[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
              simulator.AddPaths(wi, wo, 4, &rng, f, squares);
              for (int c = 0; c < 3; ++c) {
                EXPECT_TRUE(std::isfinite(f[c]) && std::isfinite(squares[c]) && f[c] >= 0)
                    << f[c] << " " << Name(stack) << " " << zi << " " << zo;
              }
              const Exit exit = simulator.Walk(wi, &rng);
              for (const double weight : exit.weight)
                EXPECT_TRUE(std::isfinite(weight) && weight >= 0);
              EXPECT_TRUE(std::isfinite(simulator.Pdf(wi, wo)));
            }
          }
        }
      }
    }
  }
}

// A kernel without an effect gives what the one with all of them gives.
TEST(LayeredSimulator, KernelsLeaveOutOnlyWhatIsAbsent) {
  Rng rng(8);
  for (int i = 0; i < 200; ++i) {
    Stack stack = RandomStack(&rng, 0.05);
    // One channel: with three, other random numbers are drawn.
    for (Layer& layer : stack.layers) {
      layer.absorption = {layer.absorption[0], layer.absorption[0], layer.absorption[0]};
      layer.scattering = {layer.scattering[0], layer.scattering[0], layer.scattering[0]};
    }
    for (BasePart& part : stack.parts) part.eta = part.k = {2, 2, 2};
    const PreparedStack prepared = Prepare(stack);
    ASSERT_FALSE(prepared.effects.colour);
    const Effects all{true, true, true, true, true, false};
    const Vec wi = Normalized({0.3, 0.2, 0.6}), wo = Normalized({-0.5, 0.1, 0.4});
    double few[3] = {0, 0, 0}, many[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
    Rng one(9, static_cast<uint64_t>(i)), two(9, static_cast<uint64_t>(i));
    KernelFor(prepared.effects)(prepared, wi, wo, 50, &one, few, squares);
    KernelFor(all)(prepared, wi, wo, 50, &two, many, squares);
    EXPECT_NEAR(few[0], many[0], 1e-9 * many[0]) << Name(stack);
  }
}

TEST(LayeredSimulator, PathsGoWhereTheVarianceIs) {
  Stack stack;
  stack.layers.resize(1);
  stack.layers[0].roughness = {0.2, 0.2, 0};
  stack.parts.push_back(Conductor({0.2, 0.9, 1.3}, {3.9, 2.5, 2.2}, {0.1, 0.1, 0}));
  const Simulator simulator(stack);
  Accuracy accuracy;
  accuracy.standard_error = 0.01;
  accuracy.max_paths = 100000;
  Rng rng(10);
  int least = accuracy.max_paths, most = 0;
  Tally stated;
  for (int i = 0; i < 100; ++i) {
    const Direction wi = Above(&rng), wo = Above(&rng);
    const Estimate estimate = simulator.Evaluate(wi, wo, accuracy, 1);
    least = std::min(least, estimate.paths);
    most = std::max(most, estimate.paths);
    EXPECT_GE(estimate.spent, estimate.paths + accuracy.pilot_paths);
    EXPECT_GE(4 * (estimate.spent - estimate.paths), estimate.paths);
    const double error = Simulator::StandardError(estimate, wi, wo);
    stated.Add(error * error);
    EXPECT_EQ(estimate.f, simulator.Evaluate(wi, wo, accuracy, 1).f);
    EXPECT_NE(estimate.f, simulator.Evaluate(wi, wo, accuracy, 2).f);
  }
  EXPECT_EQ(least, accuracy.min_paths);
  EXPECT_GT(most, 10 * accuracy.min_paths);
  // Pilots mistake the variance of single pairs, not that of all.
  EXPECT_LT(std::sqrt(stated.mean()), 1.3 * accuracy.standard_error);
}

TEST(LayeredSimulator, NothingBelowTheHorizon) {
  Stack stack;
  stack.layers.resize(1);
  stack.layers[0].roughness = {0.2, 0.2, 0};
  stack.parts.push_back(Diffuse(1));
  const Simulator simulator(stack);
  for (const float z : {-0.5f, 0.0f, -0.0f}) {
    const Direction below{std::sqrt(1 - z * z), 0, z}, up;
    EXPECT_EQ(simulator.Average(below, up, 2, 1).f[0], 0);
    EXPECT_EQ(simulator.Average(up, below, 2, 1).f[0], 0);
    EXPECT_EQ(simulator.Pdf(below, up), 0);
    EXPECT_EQ(simulator.Pdf(up, below), 0);
  }
}

}  // namespace
}  // namespace patina::layered::test
