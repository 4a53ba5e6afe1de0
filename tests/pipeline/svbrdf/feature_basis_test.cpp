#include "pipeline/svbrdf/feature_basis.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/rng.h"

namespace patina::svbrdf {
namespace {

constexpr size_t kFeatures = 6;

double Forward(const FeatureBasis& basis, size_t place, const std::vector<double>& x) {
  double y = 1;
  for (size_t f = 0; f < kFeatures; ++f)
    y += basis.forward[place * kFeatures + f] * (x[f] - basis.mean[f]);
  return y;
}

std::vector<double> Diagonal(const std::vector<double>& values) {
  std::vector<double> matrix(kFeatures * kFeatures);
  for (size_t i = 0; i < kFeatures; ++i) matrix[i * kFeatures + i] = values[i];
  return matrix;
}

TEST(FeatureBasis, BackIsTheInverseOfForward) {
  Rng rng(3);
  const auto random = [&rng](std::vector<double>* values) {
    for (double& value : *values) value = static_cast<double>(rng.Uniform()) - 0.5;
  };
  // Products of random vectors: two fewer than features, so that some of it is singular.
  const auto products = [&] {
    std::vector<double> sum(kFeatures * kFeatures), v(kFeatures);
    for (int k = 0; k < 4; ++k) {
      random(&v);
      for (size_t i = 0; i < kFeatures; ++i) {
        for (size_t j = 0; j < kFeatures; ++j) sum[i * kFeatures + j] += v[i] * v[j];
      }
    }
    return sum;
  };
  std::vector<double> mean(kFeatures), x(kFeatures);
  random(&mean);
  const FeatureBasis basis = PrincipalBasis(mean, products(), products());
  for (int i = 0; i < 20; ++i) {
    random(&x);
    for (size_t f = 0; f < kFeatures; ++f) {
      double back = basis.mean[f];
      for (size_t place = 0; place < kFeatures; ++place)
        back += basis.backward[f * kFeatures + place] * (Forward(basis, place, x) - 1);
      EXPECT_NEAR(back, x[f], 1e-6);
    }
  }
}

// Features 4 and 1 matter most: variance times importance. Each leads a texture.
TEST(FeatureBasis, WhatMattersMostLeadsATexture) {
  const FeatureBasis basis =
      PrincipalBasis(std::vector<double>(kFeatures, 2.0), Diagonal({1, 4, 1, 1, 100, 1}),
                     Diagonal({1e-2, 4, 1e-4, 1e-3, 1, 1e-5}));
  const auto scale_of = [&](size_t place, size_t feature) {
    return std::abs(basis.forward[place * kFeatures + feature]);
  };
  EXPECT_NEAR(scale_of(0, 4), kFeatureSpread / 10, 1e-9);  // of deviation 10
  EXPECT_NEAR(scale_of(3, 1), kFeatureSpread / 2, 1e-9);
  // The rest follows in turn: 0 and 3 second, 2 and 5 third.
  EXPECT_NEAR(scale_of(1, 0), 0.1 * kFeatureSpread, 1e-9);
  EXPECT_NEAR(scale_of(4, 3), 0.1 * kFeatureSpread, 1e-9);
  EXPECT_NEAR(scale_of(2, 2), 0.1 * kFeatureSpread, 1e-9);
  EXPECT_NEAR(scale_of(5, 5), 0.1 * kFeatureSpread, 1e-9);
  // Nothing else is mixed in.
  EXPECT_NEAR(scale_of(0, 1), 0, 1e-12);
}

TEST(FeatureBasis, EqualTexelsAndALossThatIsFlatStayFinite) {
  const std::vector<double> zero(kFeatures * kFeatures);
  for (const auto& covariance : {zero, Diagonal({1, 0, 0, 0, 0, 0})}) {
    for (const auto& importance : {zero, Diagonal({0, 1, 0, 0, 0, 0})}) {
      const FeatureBasis basis =
          PrincipalBasis(std::vector<double>(kFeatures, 1.0), covariance, importance);
      for (const auto* matrix : {&basis.forward, &basis.backward}) {
        for (const double value : *matrix) EXPECT_TRUE(std::isfinite(value));
      }
      // The mean is the middle of what BC6H gets.
      EXPECT_EQ(Forward(basis, 0, std::vector<double>(kFeatures, 1.0)), 1);
    }
  }
}

}  // namespace
}  // namespace patina::svbrdf
