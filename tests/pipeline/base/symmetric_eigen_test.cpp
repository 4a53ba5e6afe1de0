#include "pipeline/base/symmetric_eigen.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/rng.h"

namespace patina {
namespace {

TEST(SymmetricEigen, DecomposesWhatItWasMadeOf) {
  for (const int n : {1, 2, 12, 64}) {
    SCOPED_TRACE(n);
    const auto count = static_cast<size_t>(n);
    Rng rng(5, static_cast<uint64_t>(n));
    std::vector<double> matrix(count * count);
    for (size_t i = 0; i < count; ++i) {
      for (size_t j = 0; j <= i; ++j)
        matrix[i * count + j] = matrix[j * count + i] = static_cast<double>(rng.Uniform()) - 0.3;
    }
    const SymmetricEigen eigen = EigenOf(n, matrix);
    for (size_t k = 0; k + 1 < count; ++k) EXPECT_GE(eigen.values[k], eigen.values[k + 1]);
    for (size_t i = 0; i < count; ++i) {
      for (size_t j = 0; j < count; ++j) {
        double rebuilt = 0, dot = 0;
        for (size_t k = 0; k < count; ++k) {
          rebuilt += eigen.values[k] * eigen.vectors[k * count + i] * eigen.vectors[k * count + j];
          dot += eigen.vectors[i * count + k] * eigen.vectors[j * count + k];
        }
        EXPECT_NEAR(rebuilt, matrix[i * count + j], 1e-10);
        EXPECT_NEAR(dot, i == j ? 1 : 0, 1e-10);
      }
    }
  }
}

TEST(SymmetricEigen, ZerosAndEqualValuesAreNoTrouble) {
  const SymmetricEigen zero = EigenOf(3, std::vector<double>(9));
  EXPECT_EQ(zero.values, std::vector<double>(3));
  EXPECT_EQ(zero.vectors, (std::vector<double>{1, 0, 0, 0, 1, 0, 0, 0, 1}));
  const SymmetricEigen twice = EigenOf(2, {2, 0, 0, 2});
  EXPECT_EQ(twice.values, (std::vector<double>{2, 2}));
}

}  // namespace
}  // namespace patina
