#include "pipeline/svbrdf/feature_basis.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pipeline/base/symmetric_eigen.h"

namespace patina::svbrdf {
namespace {

constexpr double kLeastShare = 0.1;       // of a feature's deviation, of its texture's first one's
constexpr double kLeastImportance = 1e-6;  // of a direction, of the one that matters most
constexpr double kLeastDeviation = 1e-6;   // of a component, of the first one's

using Matrix = std::vector<double>;  // [n][n]

Matrix Product(size_t n, std::span<const double> a, std::span<const double> b) {
  Matrix product(n * n);
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < n; ++k) {
      for (size_t j = 0; j < n; ++j) product[i * n + j] += a[i * n + k] * b[k * n + j];
    }
  }
  return product;
}

// The symmetric square root and its inverse.
struct Roots {
  Matrix root, inverse;
};

Roots RootsOf(size_t n, std::span<const double> importance) {
  const SymmetricEigen eigen =
      EigenOf(static_cast<int>(n), Matrix(importance.begin(), importance.end()));
  const double most = eigen.values[0] > 0 ? eigen.values[0] : 1.0;
  Roots roots{Matrix(n * n), Matrix(n * n)};
  for (size_t k = 0; k < n; ++k) {
    const double root = std::sqrt(std::max(eigen.values[k], kLeastImportance * most));
    const double* v = eigen.vectors.data() + k * n;
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = 0; j < n; ++j) {
        roots.root[i * n + j] += root * v[i] * v[j];
        roots.inverse[i * n + j] += v[i] * v[j] / root;
      }
    }
  }
  return roots;
}

}  // namespace

FeatureBasis PrincipalBasis(std::vector<double> mean, std::span<const double> covariance,
                            std::span<const double> importance) {
  const size_t n = mean.size(), textures = n / 3;
  const Roots roots = RootsOf(n, importance);
  const SymmetricEigen eigen = EigenOf(
      static_cast<int>(n), Product(n, Product(n, roots.root, covariance), roots.root));
  // Where all texels are equal there is nothing to scale.
  const double first = eigen.values[0] > 0 ? std::sqrt(eigen.values[0]) : 1.0;
  const auto deviation = [&](size_t k) {
    return std::max(std::sqrt(std::max(0.0, eigen.values[k])), kLeastDeviation * first);
  };
  FeatureBasis basis{std::move(mean), Matrix(n * n), Matrix(n * n)};
  for (size_t k = 0; k < n; ++k) {
    const size_t leader = k % textures, place = 3 * leader + k / textures;
    const double share = std::max(kLeastShare, deviation(k) / deviation(leader));
    const double scale = kFeatureSpread * share / deviation(k);
    const double* v = eigen.vectors.data() + k * n;
    for (size_t f = 0; f < n; ++f) {
      for (size_t j = 0; j < n; ++j) {
        basis.forward[place * n + f] += scale * v[j] * roots.root[j * n + f];
        basis.backward[f * n + place] += roots.inverse[f * n + j] * v[j] / scale;
      }
    }
  }
  return basis;
}

}  // namespace patina::svbrdf
