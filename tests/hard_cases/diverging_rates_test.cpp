// Rates at which a training runs away, in earnest: the guard notices, goes back, goes on, and says
// how often; or gives up.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "formats/half.h"
#include "pipeline/brdf/train_brdf.h"
#include "pipeline/jobs/brdf_package.h"
#include "pipeline/jobs/package.h"
#include "tests/formats/test_support.h"
#include "tests/hard_cases/brdf_cases.h"
#include "tests/hard_cases/everywhere.h"
#include "tests/hard_cases/map_cases.h"
#include "tests/hard_cases/material_runs.h"

namespace patina {
namespace {

using test::Everywhere;
using testing::HasSubstr;

constexpr int kForever = std::numeric_limits<int>::max();

TrainOptions MaterialOptions(Recipe recipe, const RateFault& fault) {
  TrainOptions options;
  options.recipe = recipe;
  options.samples = 6e5;
  options.rate_fault = fault;
  return options;
}

// One step far outside, as a flipped bit would make it: a transient fault costs what was learned
// since the last good state.
TEST(DivergingRates, OfOneStepCostAMaterialLittle) {
  const MaterialReference reference = test::ReferenceOf(test::OrdinaryMap(48, 32, 4));
  for (const Recipe recipe : {Recipe::kPatina, Recipe::kPaper}) {
    SCOPED_TRACE(RecipeName(recipe));
    const TrainedMaterial good = test::MustTrain(reference, MaterialOptions(recipe, {}), 1);
    EXPECT_EQ(good.rollbacks, 0);
    const TrainedMaterial model = Everywhere(
        [&](int threads) {
          return test::MustTrain(reference, MaterialOptions(recipe, {30, 31, 1e30}), threads);
        },
        test::SameModel);
    EXPECT_EQ(model.rollbacks, 1);
    test::DecodeMip0(model, reference);
    // Rates are a quarter from there on, in a training that is a tenth of the shortest: 5 dB.
    EXPECT_GT(model.exported_psnr_mip0_db, good.exported_psnr_mip0_db - 5);
  }
}

// Rates that are too high throughout: several rollbacks until they are bearable. What is left is
// whatever the last rates reach; it is finite and can be written and decoded.
TEST(DivergingRates, ThroughoutAreLoweredUntilAMaterialTrains) {
  const MaterialReference reference = test::ReferenceOf(test::OrdinaryMap(48, 32, 4));
  for (const Recipe recipe : {Recipe::kPatina, Recipe::kPaper}) {
    SCOPED_TRACE(RecipeName(recipe));
    const TrainedMaterial model = Everywhere(
        [&](int threads) {
          return test::MustTrain(reference, MaterialOptions(recipe, {0, kForever, 1e9}), threads);
        },
        test::SameModel);
    EXPECT_GE(model.rollbacks, 2);
    EXPECT_LT(model.rollbacks, RateGuard::kMaxRollbacks);
    test::DecodeMip0(model, reference);
    EXPECT_TRUE(std::isfinite(model.exported_psnr_mip0_db));
  }
}

TEST(DivergingRates, WithoutEndEndTheTrainingOfAMaterialWithAnError) {
  const MaterialReference reference = test::ReferenceOf(test::OrdinaryMap(16, 16, 2));
  ThreadPool pool(1);
  for (const Recipe recipe : {Recipe::kPatina, Recipe::kPaper}) {
    const auto result =
        TrainMaterial(reference, ShapeForProfile(Profile::kBcf1k, 16, 16),
                      MaterialOptions(recipe, {0, kForever, 1e300}), pool, NoProgress());
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::kOutOfRange);
    EXPECT_THAT(result.error().message, HasSubstr("given up after 20 rollbacks"));
  }
}

TEST(DivergingRates, OfOneStepCostABrdfLittle) {
  const brdf::Source source = test::OrdinaryBrdf();
  for (const auto training : {brdf::IndexTraining::kClusters, brdf::IndexTraining::kSoftmax}) {
    brdf::TrainOptions options = test::QuickBrdfTraining();
    options.index_training = training;
    const brdf::TrainedBrdf good = test::MustTrainBrdf(source, options, 1);
    EXPECT_EQ(good.rollbacks, 0);
    // In the first part and in the part with codes.
    for (const int step : {90, 250}) {
      SCOPED_TRACE(step);
      options.rate_fault = {step, step + 1, 1e30};
      const brdf::TrainedBrdf model =
          Everywhere([&](int threads) { return test::MustTrainBrdf(source, options, threads); },
                     test::SameBrdf);
      EXPECT_EQ(model.rollbacks, 1);
      test::ExpectFinite(model);
      // A quarter of the rates for the rest of a training that is forty times shorter than the
      // default, some of it lost.
      EXPECT_LT(model.final_loss, 8 * good.final_loss);
    }
  }
}

TEST(DivergingRates, ThroughoutAreLoweredUntilABrdfTrains) {
  brdf::TrainOptions options = test::QuickBrdfTraining();
  options.rate_fault = {0, kForever, 1e9};
  const brdf::Source source = test::OrdinaryBrdf();
  const brdf::TrainedBrdf model = Everywhere(
      [&](int threads) { return test::MustTrainBrdf(source, options, threads); }, test::SameBrdf);
  EXPECT_GE(model.rollbacks, 2);
  EXPECT_LT(model.rollbacks, RateGuard::kMaxRollbacks);
  test::ExpectFinite(model);
}

TEST(DivergingRates, WithoutEndEndTheTrainingOfABrdfWithAnError) {
  brdf::TrainOptions options = test::QuickBrdfTraining();
  options.rate_fault = {0, kForever, 1e300};
  ThreadPool pool(1);
  const auto result =
      brdf::TrainBrdf(test::OrdinaryBrdf(), test::SmallBrdf(), options, pool, NoProgress());
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kOutOfRange);
  EXPECT_THAT(result.error().message, HasSubstr("given up after 20 rollbacks"));
}

// Should a value that is not finite get past the trainers, no payload takes it.
TEST(NonFiniteModels, AreRefusedByEveryPayload) {
  const MaterialReference reference = test::ReferenceOf(test::OrdinaryMap(16, 16, 2));
  TrainedMaterial material = test::MustTrain(reference, MaterialOptions(Recipe::kPatina, {}), 1);
  const test::TemporaryDirectory out;
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(),
                       std::numeric_limits<float>::infinity(), 1e6f};
  for (const float value : bad) {
    for (auto* weights : {&material.w1, &material.b1, &material.w2, &material.b2}) {
      const float good = weights->back();
      weights->back() = value;
      auto staging = StagingArea::Create(out.path(), "m");
      ASSERT_TRUE(staging);
      const Status status = AddModel(material, &*staging);
      EXPECT_FALSE(status);
      weights->back() = good;
    }
  }
  brdf::TrainedBrdf model = test::MustTrainBrdf(test::OrdinaryBrdf(), test::QuickBrdfTraining(), 1);
  for (const uint16_t half : {uint16_t{0x7C00}, uint16_t{0xFC00}, uint16_t{0x7E00}}) {
    std::vector<uint16_t*> places = {&model.pack.codebook[3]};
    for (WeightTensor& tensor : model.network.tensors) places.push_back(&tensor.elements.back());
    for (uint16_t* place : places) {
      const uint16_t good = *place;
      *place = half;
      auto staging = StagingArea::Create(out.path(), "b");
      ASSERT_TRUE(staging);
      EXPECT_FALSE(AddBrdfModel(model, {}, &*staging));
      *place = good;
    }
  }
}

}  // namespace
}  // namespace patina
