// The trainer of BRDFs and the evaluation on hard sources: finite, within a bound, the same bytes
// everywhere.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/brdf/batch_evaluator.h"
#include "tests/hard_cases/brdf_cases.h"
#include "tests/hard_cases/everywhere.h"

namespace patina {
namespace {

using brdf::BatchEvaluator;
using brdf::Direction;
using test::BrdfCase;
using test::Everywhere;

class HardBrdfs : public testing::TestWithParam<size_t> {
 public:
  static const std::vector<BrdfCase>& Cases() {
    static const std::vector<BrdfCase> cases = test::BrdfCases();
    return cases;
  }
};

Direction At(double theta_deg, double phi_deg) {
  const double theta = theta_deg * M_PI / 180, phi = phi_deg * M_PI / 180;
  return {static_cast<float>(std::sin(theta) * std::cos(phi)),
          static_cast<float>(std::sin(theta) * std::sin(phi)), static_cast<float>(std::cos(theta))};
}

// What a black surface would err by, on the measure that the training reports.
double ErrorOfBlack(const brdf::Source& source, const brdf::TrainedBrdf& model) {
  ThreadPool pool(1);
  brdf::PoolOptions options;
  options.count = 4000;
  const auto samples = brdf::DrawPool(source, model.shape.grid, options, pool);
  double sum = 0;
  for (size_t s = 0; s < samples.size(); ++s) {
    for (const float value : samples[s].value)
      sum += std::log1p(std::max(0.0, static_cast<double>(value)) *
                        static_cast<double>(samples[s].cosine));
  }
  return sum / static_cast<double>(3 * samples.size());
}

// Pairs at 89.99 degrees, at the pole, and on both sides of the azimuth's wrap.
std::vector<std::pair<Direction, Direction>> AwkwardPairs() {
  std::vector<std::pair<Direction, Direction>> pairs;
  const double thetas[] = {0, 1e-4, 45, 89.99, 89.9999};
  const double phis[] = {0, 1e-5, 90, 179.99999, 180, -179.99999, 360};
  for (const double a : thetas) {
    for (const double b : thetas) {
      for (const double phi : phis) pairs.push_back({At(a, 180), At(b, phi)});
    }
  }
  return pairs;
}

// 0.02 of the logarithm is 2 % of what a perfect white reflects: as good as black. Ten per cent
// more is what the 750 samples that are held back differ by from others.
TEST_P(HardBrdfs, AreLearnedNoWorseThanByABlackSurface) {
  const BrdfCase& hard = Cases()[GetParam()];
  SCOPED_TRACE(hard.name + ": " + hard.why);
  const brdf::TrainedBrdf model = Everywhere(
      [&](int threads) {
        return test::MustTrainBrdf(hard.source, test::QuickBrdfTraining(), threads);
      },
      test::SameBrdf);
  EXPECT_EQ(model.rollbacks, 0);
  test::ExpectFinite(model);
  EXPECT_LE(model.final_loss, std::max(0.02, 1.1 * ErrorOfBlack(hard.source, model)));

  const auto features = ExpandCorners(model.pack, {model.pack.primitive_size, model.pack.codebook});
  ASSERT_TRUE(features);
  const auto evaluator = BatchEvaluator::Create(model.pack, *features, model.network);
  ASSERT_TRUE(evaluator);
  BatchEvaluator::Scratch scratch(*evaluator);
  std::vector<Direction> wi, wo;
  for (const auto& [i, o] : AwkwardPairs()) {
    wi.push_back(i);
    wo.push_back(o);
  }
  std::vector<float> rgb(3 * wi.size()), exchanged(3 * wi.size());
  evaluator->Evaluate(&scratch, wi.size(), wi.data(), wo.data(), rgb.data());
  evaluator->Evaluate(&scratch, wi.size(), wo.data(), wi.data(), exchanged.data());
  for (size_t k = 0; k < rgb.size(); ++k) {
    ASSERT_TRUE(std::isfinite(rgb[k]) && rgb[k] >= 0) << rgb[k] << " at pair " << k / 3;
    // Canonical order makes it reciprocal, but where both are equally high and no order is.
    if (wi[k / 3].z == wo[k / 3].z) continue;
    ASSERT_NEAR(std::log1p(rgb[k]), std::log1p(exchanged[k]), 1e-3) << "pair " << k / 3;
  }
}

INSTANTIATE_TEST_SUITE_P(All, HardBrdfs, testing::Range(size_t{0}, HardBrdfs::Cases().size()),
                         [](const auto& given) {
                           std::string name;
                           for (const char c : HardBrdfs::Cases()[given.param].name) {
                             if (std::isalnum(static_cast<unsigned char>(c))) name += c;
                           }
                           return name;
                         });

// A white surface may not make light: the mean over directions stays near 1 / pi.
TEST(HardBrdfsWhite, KeepsItsAlbedo) {
  const auto cases = test::BrdfCases();
  const auto white = std::find_if(cases.begin(), cases.end(),
                                  [](const BrdfCase& c) { return c.name.rfind("white", 0) == 0; });
  ASSERT_NE(white, cases.end());
  brdf::TrainOptions options = test::QuickBrdfTraining();
  options.free_steps = options.codebook_steps = 600;
  const brdf::TrainedBrdf model = test::MustTrainBrdf(white->source, options, 1);
  const auto features = ExpandCorners(model.pack, {model.pack.primitive_size, model.pack.codebook});
  ASSERT_TRUE(features);
  const auto evaluator = BatchEvaluator::Create(model.pack, *features, model.network);
  ASSERT_TRUE(evaluator);
  BatchEvaluator::Scratch scratch(*evaluator);
  for (const double theta : {0.0, 45.0, 80.0}) {
    // A uniform grid in the cosine squared and the azimuth integrates f cos exactly for constants.
    std::vector<Direction> wi, wo;
    for (int i = 0; i < 16; ++i) {
      for (int j = 0; j < 16; ++j) {
        wi.push_back(At(theta, 0));
        wo.push_back(At(std::acos(std::sqrt((i + 0.5) / 16)) * 180 / M_PI, (j + 0.5) * 22.5));
      }
    }
    std::vector<float> rgb(3 * wi.size());
    evaluator->Evaluate(&scratch, wi.size(), wi.data(), wo.data(), rgb.data());
    double sum = 0;
    for (size_t k = 0; k < wi.size(); ++k) sum += static_cast<double>(rgb[3 * k]);
    // 5 %: a training of a tenth of the default length.
    EXPECT_NEAR(sum / 256 * M_PI, 1, 0.05) << theta;
  }
}

}  // namespace
}  // namespace patina
