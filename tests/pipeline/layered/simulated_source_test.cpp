#include "pipeline/layered/simulated_source.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "formats/layered/layered_file.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/sample_pool.h"
#include "pipeline/layered/presets.h"
#include "tests/pipeline/layered/statistics.h"

namespace patina::layered::test {
namespace {

using brdf::Direction;
using ::testing::HasSubstr;

Stack CoatOn(const BasePart& base, double alpha) {
  Stack stack;
  stack.layers.resize(1);
  stack.layers[0].roughness = {alpha, alpha, 0};
  stack.parts = {base};
  return stack;
}

TEST(SimulatedSource, IsATableLikeAnyOther) {
  Effort effort;
  effort.accuracy = {0.02, 16, 16, 256};
  const auto source = SimulatedSource(CoatOn(Diffuse(0.5), 0.2), effort);
  ASSERT_TRUE(source.has_value());
  EXPECT_EQ(source->format, "layered");
  EXPECT_TRUE(source->isotropic);
  EXPECT_EQ(source->effects, std::vector<std::string>{"rough refraction"});
  EXPECT_EQ(source->left_out_effects.size(), 5u);
  EXPECT_TRUE(source->warnings.empty());
  const Direction up, aslant{0.6f, 0, 0.8f}, below{0.6f, 0, -0.8f};
  float once[3], again[3], weight = 0;
  EXPECT_TRUE(source->table->Evaluate(up, aslant, once));
  EXPECT_TRUE(source->table->EvaluateToLearn(up, aslant, again, &weight));
  for (int c = 0; c < 3; ++c) EXPECT_EQ(once[c], again[c]);
  EXPECT_GT(weight, 0.5);
  EXPECT_LE(weight, 1);
  EXPECT_FALSE(source->table->Evaluate(below, up, once));
  EXPECT_EQ(once[0], 0);
  // Only values to learn from are counted.
  const brdf::SimulationCost cost = source->simulated->Spent();
  EXPECT_EQ(cost.pairs, 1u);
  EXPECT_GE(cost.paths, 32u);
  EXPECT_GT(cost.standard_error, 0);
  EXPECT_LT(cost.standard_error, 0.05);
}

TEST(SimulatedSource, GivesTheSameSamplesToAnyNumberOfThreads) {
  Effort effort;
  effort.accuracy = {0.05, 8, 8, 32};
  brdf::PoolOptions options;
  options.count = 3000;
  const auto draw = [&](int threads) {
    const auto source = SimulatedSource(CoatOn(Diffuse(0.5), 0.2), effort);
    ThreadPool pool(threads);
    const auto samples = brdf::DrawPool(*source, brdf::GridShape(), options, pool);
    std::vector<float> values;
    for (size_t i = 0; i < samples.size(); ++i) {
      for (const float value : samples[i].value) values.push_back(value);
      values.push_back(samples[i].importance);
    }
    EXPECT_GT(samples.size(), 2500u);
    return std::pair(values, source->simulated->Spent().paths);
  };
  const auto one = draw(1);
  EXPECT_EQ(draw(3), one);
  EXPECT_GT(*std::max_element(one.first.begin(), one.first.end()), 0.1f);
}

TEST(SimulatedSource, NoisyValuesCountForLess) {
  Effort effort;
  effort.accuracy = {1e-6, 8, 8, 8};
  const auto source = SimulatedSource(
      CoatOn(Conductor({0.2, 0.9, 1.3}, {3.9, 2.5, 2.2}, {0.1, 0.1, 0}), 0.3), effort);
  ASSERT_TRUE(source.has_value());
  Rng rng(1);
  float least = 1;
  for (int i = 0; i < 100; ++i) {
    const Direction wi = Above(&rng);
    const Direction wo{-wi.x, -wi.y, wi.z};
    float rgb[3], weight;
    source->table->EvaluateToLearn(wi, wo, rgb, &weight);
    EXPECT_GT(weight, 0);
    least = std::min(least, weight);
  }
  EXPECT_LT(least, 0.5);
}

TEST(SimulatedSource, LongPathsGetLessOfThem) {
  Effort effort;
  effort.accuracy = {1e-9, 16, 16, 400};
  Stack thick = CoatOn(Diffuse(0.9), 0.2);
  thick.layers[0].thickness = 1;
  thick.layers[0].scattering = {20, 20, 20};
  uint64_t paths[2];
  for (int i = 0; i < 2; ++i) {
    const auto source = SimulatedSource(i == 0 ? CoatOn(Diffuse(0.9), 0.2) : thick, effort);
    ASSERT_TRUE(source.has_value());
    float rgb[3], weight;
    source->table->EvaluateToLearn({}, {0.6f, 0, 0.8f}, rgb, &weight);
    paths[i] = source->simulated->Spent().paths;
  }
  EXPECT_GT(paths[0], 3 * paths[1]);
}

TEST(SimulatedSource, SaysWhatABrdfCannotHold) {
  const auto mirrored = SimulatedSource(CoatOn(Diffuse(0.5), 0), {});
  ASSERT_TRUE(mirrored.has_value());
  ASSERT_EQ(mirrored->warnings.size(), 1u);
  EXPECT_THAT(mirrored->warnings[0], HasSubstr("mirror"));
  Stack only = CoatOn(Conductor({0.2, 0.2, 0.2}, {4, 4, 4}, {0, 0, 0}), 0);
  EXPECT_THAT(SimulatedSource(only, {}).error().message, HasSubstr("roughness of 0.005"));
  only.parts.clear();
  EXPECT_FALSE(SimulatedSource(only, {}).has_value());
}

TEST(Presets, AreValidAndConserveEnergy) {
  Rng rng(3);
  EXPECT_GE(Presets().size(), 5u);
  for (const Preset& preset : Presets()) {
    EXPECT_TRUE(CheckStack(preset.stack).has_value()) << preset.name;
    const auto again = ParseStack(FormatStack(preset.stack), preset.name);
    ASSERT_TRUE(again.has_value()) << again.error().message;
    const auto source = SimulatedSource(*again, {});
    ASSERT_TRUE(source.has_value());
    EXPECT_TRUE(source->warnings.empty()) << preset.name;
    EXPECT_EQ(source->isotropic, preset.name != "brushed_coated");
    const Simulator simulator(preset.stack);
    Tally tally;
    for (int i = 0; i < 500; ++i) {
      const Exit exit = simulator.Walk(Above(&rng), &rng);
      tally.Add(std::max({exit.weight[0], exit.weight[1], exit.weight[2]}));
    }
    EXPECT_GT(tally.mean(), 0.02) << preset.name;
    EXPECT_LT(tally.mean(), 1) << preset.name;
  }
}

}  // namespace
}  // namespace patina::layered::test
