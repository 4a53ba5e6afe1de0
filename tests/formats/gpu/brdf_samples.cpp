#include "tests/formats/gpu/brdf_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "formats/decoder/patina_brdf_decoder.h"
#include "formats/decoder/patina_svbrdf_decoder.h"

namespace patina::gpu_test {
namespace {

using test::Random;
using Direction = std::array<double, 3>;

Direction At(double z, double phi) {
  const double r = std::sqrt(std::max(0.0, 1 - z * z));
  return {r * std::cos(phi), r * std::sin(phi), z};
}

constexpr double kPi = 3.14159265358979323846;

}  // namespace

std::vector<float> RandomPairs(uint64_t seed, size_t count) {
  Random random(seed);
  std::vector<float> pairs;
  const auto any = [&] { return At(random.Unit(), random.Unit() * 2 * kPi); };
  for (size_t i = 0; i < count; ++i) {
    Direction wi = any(), wo = any();
    switch (i % 16) {
      case 0:
        wi = {0, 0, 1};
        break;
      case 1:
        wo = {0, 0, 1};
        if (i % 32 == 1) wi = wo;
        break;
      case 2:
        wo = wi;
        break;
      case 3:
        wo = {-wi[0], -wi[1], wi[2]};
        break;
      case 4:  // axes: where quadrants meet, and the azimuth wraps
        wi = At(random.Unit(), kPi / 2 * random.Below(5));
        for (double& d : wi) d = std::abs(d) < 1e-9 ? 0 : d;
        break;
      case 5:
        wo = At(random.Unit(), random.Below(2) == 0 ? 1e-6 : 2 * kPi - 1e-6);
        break;
      case 6:  // grazing
        wi = At(1e-4 * random.Unit() + 1e-7, random.Unit() * 2 * kPi);
        break;
      case 7:
        wo = At(1e-5, random.Unit() * 2 * kPi);
        wi = At(2e-5, random.Unit() * 2 * kPi);
        break;
      case 8:  // near the pole
        wi = At(1 - 1e-6 * random.Unit(), random.Unit() * 2 * kPi);
        break;
      case 9:  // the end of the cap
        wo = At(2.0 / 3.0 + (random.Unit() - 0.5) * 1e-5, random.Unit() * 2 * kPi);
        break;
      case 10:  // below the horizon, and on it
        (random.Below(2) == 0 ? wi : wo)[2] = i % 32 == 10 ? 0 : -random.Unit();
        break;
      default:
        break;
    }
    for (const Direction& d : {wi, wo}) {
      for (const double value : d) pairs.push_back(static_cast<float>(value));
      pairs.push_back(0);
    }
  }
  return pairs;
}

void CheckBrdf(const test::BrdfSampleOptions& options, uint64_t seed, size_t count,
               ShaderLanguage language, const RunProgram& run) {
  const test::TemporaryDirectory folder;
  auto staging = test::StageBrdfSample(folder.path(), "asset", seed, options);
  ASSERT_OK(staging);
  const auto published = staging->Publish();
  ASSERT_OK(published);
  const auto container = OpenContainer(published->directory);
  ASSERT_OK(container);
  const bool varies = options.textures > 0;
  BrdfDecoder decoder;
  SvbrdfDecoder varying;
  std::string problem;
  if (varies) {
    ASSERT_EQ(SvbrdfDecoder::Load(container->directory, &varying, &problem),
              SvbrdfDecoder::LoadStatus::kOk)
        << problem;
  } else {
    ASSERT_EQ(BrdfDecoder::Load(container->directory, &decoder, &problem),
              BrdfDecoder::LoadStatus::kOk)
        << problem;
  }
  ShaderOptions shader;
  shader.language = language;
  GpuProgram program = LoadProgram(*container, shader);
  SetBrdfBody(&program, varies);
  std::vector<float> pairs = RandomPairs(seed, count);
  // Where a spatially varying one is looked up: u and v, of which the level follows.
  Random random(seed + 1);
  for (size_t i = 3; i < pairs.size(); i += 4) pairs[i] = static_cast<float>(random.Unit());
  const std::vector<float> from_gpu = run(program, pairs);
  ASSERT_EQ(from_gpu.size(), 3 * count);

  // Values span orders of magnitude, so they are compared as log(1 + f), which is what the network
  // gives: 1e-3 of its range is 1e-3 relative for large f.
  double range = 0;
  std::vector<float> expected(3 * count);
  for (size_t i = 0; i < count; ++i) {
    const float *wi = &pairs[8 * i], *wo = &pairs[8 * i + 4];
    if (varies) {
      varying.Evaluate(wi, wo, static_cast<double>(wi[3]), static_cast<double>(wo[3]),
                       static_cast<double>(5 * wi[3] - 1), &expected[3 * i]);
    } else {
      decoder.Evaluate(wi, wo, &expected[3 * i]);
    }
    for (size_t c = 0; c < 3; ++c)
      range = std::max(range, std::log1p(static_cast<double>(expected[3 * i + c])));
  }
  ASSERT_GT(range, 0.1);
  double worst = 0;
  size_t at = 0;
  for (size_t i = 0; i < expected.size(); ++i) {
    // !(>= 0) is also true of NaN.
    const double got = from_gpu[i] >= 0 ? std::log1p(static_cast<double>(from_gpu[i])) : -1e9;
    const double error = std::abs(got - std::log1p(static_cast<double>(expected[i]))) / range;
    if (error > worst) worst = error, at = i;
  }
  const float* pair = &pairs[at / 3 * 8];
  EXPECT_LE(worst, 1e-3) << "channel " << at % 3 << " of pair " << at / 3 << " (" << pair[0] << ", "
                         << pair[1] << ", " << pair[2] << ") (" << pair[4] << ", " << pair[5]
                         << ", " << pair[6] << "): " << from_gpu[at] << " instead of "
                         << expected[at];
}

}  // namespace patina::gpu_test
