#include "tests/bench/nbrdf.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <filesystem>
#include <fstream>
#include <limits>
#include <vector>

#include "formats/brdf/angles.h"
#include "pipeline/base/rng.h"
#include "tests/pipeline/brdf/brdf_samples.h"

namespace patina::bench {
namespace {

using brdf::Direction;
using Complex = std::complex<double>;

std::vector<SimdTarget> Targets() {
  std::vector<SimdTarget> targets;
  for (const SimdTarget target : {SimdTarget::kAvx2, SimdTarget::kAvx512}) {
    if (SimdTargetSupported(target)) targets.push_back(target);
  }
  return targets;
}

NbrdfNetwork RandomNetwork(uint64_t seed) {
  NbrdfNetwork network;
  Rng rng(seed);
  for (int l = 0; l < kNbrdfLayers; ++l) {
    for (int i = 0; i <= kNbrdfInputs[l]; ++i) {
      for (int o = 0; o < kNbrdfOutputs[l]; ++o)
        network.weight(l, i, o) = 0.9f * (2 * rng.Uniform() - 1);
    }
  }
  return network;
}

TrainingPair RandomPair(Rng* rng) {
  TrainingPair pair{};
  brdf::DrawPair(rng->Below(2) == 0 ? brdf::Draw::kHalfAngles : brdf::Draw::kDirections, rng,
                 &pair.wi, &pair.wo);
  for (float& value : pair.value) value = 4 * rng->Uniform() - 0.2f;
  pair.cosine = std::max(pair.wi.z, pair.wo.z);
  pair.importance = 0.5f + rng->Uniform();
  return pair;
}

// The network and its loss as they are written, for real numbers and for the complex-step
// derivative; branches go by the real part.
template <class S>
struct Reference {
  std::vector<S> parameters;  // as NbrdfNetwork holds them

  void Outputs(const double x[6], S y[3]) const {
    std::vector<S> a(x, x + 6);
    for (int l = 0; l < kNbrdfLayers; ++l) {
      std::vector<S> next(kNbrdfOutputs[l]);
      for (int o = 0; o < kNbrdfOutputs[l]; ++o) {
        const auto w = [&](int i) {
          return parameters[kNbrdfOffset[l] + i * kNbrdfColumns[l] + o];
        };
        next[o] = w(kNbrdfInputs[l]);
        for (int i = 0; i < kNbrdfInputs[l]; ++i) next[o] += w(i) * a[i];
        if (l < 2 && !(std::real(next[o]) > 0)) next[o] = 0;
      }
      a = next;
    }
    std::copy_n(a.begin(), 3, y);
  }

  S Loss(const NbrdfTile& tile, int lane) const {
    double x[6];
    for (int i = 0; i < 6; ++i) x[i] = static_cast<double>(tile.x[i][lane]);
    S y[3], sum = 0;
    Outputs(x, y);
    const auto magnitude = [](S v) { return std::real(v) < 0 ? -v : v; };
    const auto c = static_cast<double>(tile.cosine[lane]);
    for (int k = 0; k < 3; ++k) {
      const S g = std::real(y[k]) > 0 ? std::log(1.0 + c * (std::exp(y[k]) - 1.0)) : c * y[k];
      sum += magnitude(g - static_cast<double>(tile.wanted_g[k][lane])) +
             0.05 * magnitude(y[k] - static_cast<double>(tile.wanted_y[k][lane]));
    }
    return sum * static_cast<double>(tile.importance[lane]);
  }
};

TEST(Nbrdf, IsTheNetworkThatThePaperWrites) {
  // One path through the network: unit 2 sees hz and a bias, unit 5 what is left of it, and the
  // outputs are 0.5, 0.25 and -1 times that.
  NbrdfNetwork network;
  network.weight(0, 2, 2) = 2;
  network.bias(0, 2) = -1;
  network.weight(0, 2, 3) = -1;  // never active
  network.weight(1, 2, 5) = 1.5f;
  network.weight(1, 3, 5) = 100;
  network.bias(1, 5) = 0.25f;
  network.weight(2, 5, 0) = 0.5f;
  network.weight(2, 5, 1) = 0.25f;
  network.weight(2, 5, 2) = -1;
  const Direction wi = {0.6f, 0, 0.8f}, wo = {0, 0, 1}, below = {0.6f, 0, -0.8f};
  // h = (0.6, 0, 1.8) / |..|: hz = 0.948683; first 0.897367, second 1.596050.
  const double second = 1.5 * (2 * 1.8 / std::sqrt(0.36 + 3.24) - 1) + 0.25;
  for (const SimdTarget target : Targets()) {
    const Direction in[2] = {wi, wi}, out[2] = {wo, below};
    float rgb[6];
    PeerKernelsFor(target).nbrdf_evaluate(network.parameters.data(), true, in, out, 2, rgb);
    EXPECT_NEAR(rgb[0], std::expm1(0.5 * second), 1e-5);
    EXPECT_NEAR(rgb[1], std::expm1(0.25 * second), 1e-5);
    EXPECT_EQ(rgb[2], 0);  // exp of a negative number, less one, cut off
    for (int c = 3; c < 6; ++c) EXPECT_EQ(rgb[c], 0);
  }
}

TEST(Nbrdf, SeesTheDifferenceVectorOfTheLight) {
  // Outputs are log(1 + d) of d's first two coordinates, shifted into the positive.
  NbrdfNetwork network;
  for (int k = 0; k < 3; ++k) {
    network.weight(0, 3 + k, k) = 1;
    network.bias(0, k) = 1;
    network.weight(1, k, k) = 1;
    network.weight(2, k, k) = 1;
  }
  Rng rng(4);
  std::vector<Direction> wi(100), wo(100);
  for (size_t n = 0; n < 100; ++n) brdf::DrawPair(brdf::Draw::kDirections, &rng, &wi[n], &wo[n]);
  wi[0] = {0, 0, 1}, wo[0] = {0, 0, 1};
  wi[1] = {0.6f, 0, 0.8f}, wo[1] = {-0.6f, 0, 0.8f};
  for (const SimdTarget target : Targets()) {
    std::vector<float> rgb(300);
    PeerKernelsFor(target).nbrdf_evaluate(network.parameters.data(), true, wi.data(), wo.data(),
                                          100, rgb.data());
    for (size_t n = 0; n < 100; ++n) {
      const brdf::HalfDifference angles = brdf::ToHalfDifference(wi[n], wo[n]);
      const double sine = std::sin(static_cast<double>(angles.theta_d));
      const auto phi = static_cast<double>(angles.phi_d);
      EXPECT_NEAR(rgb[3 * n], std::expm1(1 + sine * std::cos(phi)), 2e-5) << n;
      EXPECT_NEAR(rgb[3 * n + 1], std::expm1(1 + sine * std::sin(phi)), 2e-5) << n;
      EXPECT_NEAR(rgb[3 * n + 2], std::expm1(1 + std::cos(static_cast<double>(angles.theta_d))),
                  2e-5);
    }
  }
}

TEST(Nbrdf, AnyCountGivesTheSameValues) {
  const NbrdfNetwork network = RandomNetwork(3);
  Rng rng(8);
  std::vector<Direction> wi(70), wo(70);
  for (size_t n = 0; n < 70; ++n) brdf::DrawPair(brdf::Draw::kHalfAngles, &rng, &wi[n], &wo[n]);
  std::vector<float> first;
  for (const SimdTarget target : Targets()) {
    const PeerKernels& kernels = PeerKernelsFor(target);
    std::vector<float> all(210);
    kernels.nbrdf_evaluate(network.parameters.data(), true, wi.data(), wo.data(), 70, all.data());
    if (first.empty()) first = all;
    EXPECT_EQ(all, first) << SimdTargetName(target);
    for (size_t count = 0; count <= 70; ++count) {
      std::vector<float> some(210, -1.0f);
      kernels.nbrdf_evaluate(network.parameters.data(), true, wi.data(), wo.data(), count,
                             some.data());
      for (size_t i = 0; i < 210; ++i) EXPECT_EQ(some[i], i < 3 * count ? all[i] : -1.0f);
    }
  }
}

TEST(NbrdfTrainer, TilesHoldWhatTheEvaluatorSees) {
  const NbrdfNetwork network = RandomNetwork(5);
  Reference<double> reference;
  reference.parameters.assign(network.parameters.data(), network.parameters.data() + kNbrdfPadded);
  Rng rng(6);
  for (const bool isotropic : {true, false}) {
    for (int n = 0; n < 50; ++n) {
      const TrainingPair pair = RandomPair(&rng);
      const auto tiles = MakeNbrdfTiles(&pair, 1, isotropic);
      ASSERT_EQ(tiles.size(), static_cast<size_t>(kNbrdfChunkTiles));
      EXPECT_EQ(tiles[0].importance[1], 0);
      double x[6], y[3];
      for (int i = 0; i < 6; ++i) x[i] = static_cast<double>(tiles[0].x[i][0]);
      reference.Outputs(x, y);
      float rgb[3];
      PeerKernelsFor(SimdTarget::kAvx2)
          .nbrdf_evaluate(network.parameters.data(), isotropic, &pair.wi, &pair.wo, 1, rgb);
      for (int c = 0; c < 3; ++c) {
        const double wanted = std::max(0.0, std::expm1(y[c]));
        EXPECT_NEAR(rgb[c], wanted, 2e-5 * (1 + std::exp(y[c])));
      }
    }
  }
}

TEST(NbrdfTrainer, GradientsAreThoseOfTheComplexStep) {
  const NbrdfNetwork network = RandomNetwork(1);
  constexpr size_t kPairs = 100;  // some lanes stay empty
  Rng rng(2);
  std::vector<TrainingPair> pairs(kPairs);
  for (TrainingPair& pair : pairs) pair = RandomPair(&rng);
  const auto tiles = MakeNbrdfTiles(pairs.data(), kPairs, true);
  ASSERT_EQ(tiles.size(), static_cast<size_t>(kNbrdfChunkTiles));

  Reference<Complex> reference;
  reference.parameters.assign(network.parameters.data(), network.parameters.data() + kNbrdfPadded);
  const auto loss = [&] {
    Complex sum = 0;
    for (size_t n = 0; n < kPairs; ++n)
      sum += reference.Loss(tiles[n / 16], static_cast<int>(n % 16));
    return sum;
  };
  const double wanted_loss = loss().real();
  std::vector<double> wanted(kNbrdfPadded);
  for (size_t i = 0; i < kNbrdfPadded; ++i) {
    constexpr double kStep = 1e-30;
    reference.parameters[i] += Complex(0, kStep);
    wanted[i] = loss().imag() / kStep;
    reference.parameters[i] = static_cast<double>(network.parameters[i]);
  }
  std::vector<float> first;
  for (const SimdTarget target : Targets()) {
    NbrdfScratch scratch;
    AlignedBuffer<float> gradient(kNbrdfPadded);
    gradient[5] = 1;  // is added to
    const double got = PeerKernelsFor(target).nbrdf_train(network.parameters.data(), tiles.data(),
                                                          &scratch, gradient.data());
    gradient[5] -= 1;
    EXPECT_NEAR(got, wanted_loss, 1e-4 * wanted_loss);
    double largest = 0;
    for (const double g : wanted) largest = std::max(largest, std::abs(g));
    // Single precision: a hundred terms of seven digits, some of which cancel.
    for (size_t i = 0; i < kNbrdfPadded; ++i)
      EXPECT_NEAR(gradient[i], wanted[i], 1e-5 * largest) << i;
    const std::vector<float> all(gradient.data(), gradient.data() + kNbrdfPadded);
    if (first.empty()) first = all;
    EXPECT_EQ(all, first) << SimdTargetName(target);
  }
}

TEST(NbrdfTrainer, PaddingOfTheNetworkHasNoGradient) {
  const NbrdfNetwork network = RandomNetwork(7);
  Rng rng(2);
  std::vector<TrainingPair> pairs(128);
  for (TrainingPair& pair : pairs) pair = RandomPair(&rng);
  const auto tiles = MakeNbrdfTiles(pairs.data(), pairs.size(), true);
  NbrdfScratch scratch;
  AlignedBuffer<float> gradient(kNbrdfPadded);
  PeerKernelsFor(Targets()[0])
      .nbrdf_train(network.parameters.data(), tiles.data(), &scratch, gradient.data());
  for (int l = 0; l < kNbrdfLayers; ++l) {
    for (int i = 0; i < kNbrdfRows[l]; ++i) {
      for (int o = 0; o < kNbrdfColumns[l]; ++o) {
        if (i <= kNbrdfInputs[l] && o < kNbrdfOutputs[l]) continue;
        EXPECT_EQ(gradient[kNbrdfOffset[l] + i * kNbrdfColumns[l] + o], 0);
      }
    }
  }
}

TEST(NbrdfTrainer, LearnsAGlossyMaterialWithAnyNumberOfThreads) {
  const brdf::Source source =
      brdf::SourceOf([](const Direction& wi, const Direction& wo, float* rgb) {
        return brdf::Plastic(0.3f, wi, wo, rgb);
      });
  NbrdfTrainOptions options;
  options.pool = 20000;
  options.steps = 300;
  std::vector<float> first;
  for (const int threads : {1, 3}) {
    ThreadPool pool(threads);
    const auto trained = TrainNbrdf(source, options, pool);
    ASSERT_TRUE(trained);
    const float* p = trained->network.parameters.data();
    if (first.empty()) first.assign(p, p + kNbrdfPadded);
    EXPECT_EQ(std::vector<float>(p, p + kNbrdfPadded), first);
    // Constants, the best that no network can do, come to 0.05.
    EXPECT_LT(trained->held_out_loss, 0.02);
  }
}

TEST(NbrdfTrainer, RefusesASourceWithoutData) {
  const brdf::Source source =
      brdf::SourceOf([](const Direction&, const Direction&, float*) { return false; });
  NbrdfTrainOptions options;
  options.pool = 1000;
  ThreadPool pool(1);
  const auto trained = TrainNbrdf(source, options, pool);
  ASSERT_FALSE(trained);
  EXPECT_EQ(trained.error().code, ErrorCode::kCorruptData);
}

class NbrdfFile : public testing::Test {
 protected:
  Result<std::map<std::string, NbrdfNetwork>> Read(const std::string& text) {
    const std::string path =
        testing::TempDir() + "/patina_nbrdf_test_" + std::to_string(getpid()) + ".txt";
    std::ofstream(path) << text;
    auto networks = ReadNbrdfNetworks(path);
    std::filesystem::remove(path);
    return networks;
  }
  static std::string Line(const std::string& name, int count) {
    std::string line = name;
    for (int i = 0; i < count; ++i) line += " " + std::to_string(i) + ".5";
    return line + "\n";
  }
};

TEST_F(NbrdfFile, GivesNetworksByName) {
  auto networks = Read(Line("steel", 675) + Line("brass", 675));
  ASSERT_TRUE(networks);
  ASSERT_EQ(networks->size(), 2u);
  NbrdfNetwork& steel = networks->at("steel");
  EXPECT_EQ(steel.weight(0, 1, 0), 21.5f);
  EXPECT_EQ(steel.bias(0, 2), 128.5f);
  EXPECT_EQ(steel.weight(1, 0, 0), 147.5f);
  EXPECT_EQ(steel.bias(2, 2), 674.5f);
}

TEST_F(NbrdfFile, RefusesLinesThatAreNoNetwork) {
  for (const std::string& bad :
       {Line("steel", 674), Line("steel", 676), Line("steel", 674) + " nan\n", Line("", 675),
        std::string("steel 1 2 x\n"), std::string("\n")}) {
    const auto networks = Read(Line("brass", 675) + bad);
    ASSERT_FALSE(networks) << bad.substr(0, 40);
    EXPECT_EQ(networks.error().code, ErrorCode::kCorruptData);
    EXPECT_NE(networks.error().message.find("line 2"), std::string::npos);
  }
  EXPECT_FALSE(ReadNbrdfNetworks(testing::TempDir() + "/patina_no_such_networks.txt"));
}

}  // namespace
}  // namespace patina::bench
