#include "pipeline/base/symmetric_eigen.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace patina {
namespace {

constexpr int kMostSweeps = 60;

// Columns of `v` become the eigenvectors, the diagonal of `a` the eigenvalues.
void Rotate(size_t n, std::vector<double>* matrix, std::vector<double>* vectors) {
  auto& a = *matrix;
  auto& v = *vectors;
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    double off = 0, diagonal = 0;
    for (size_t i = 0; i < n; ++i) {
      diagonal += a[i * n + i] * a[i * n + i];
      for (size_t j = i + 1; j < n; ++j) off += a[i * n + j] * a[i * n + j];
    }
    if (off <= 1e-26 * diagonal) return;
    for (size_t p = 0; p < n; ++p) {
      for (size_t q = p + 1; q < n; ++q) {
        const double apq = a[p * n + q];
        if (apq == 0) continue;
        const double theta = (a[q * n + q] - a[p * n + p]) / (2 * apq);
        const double t = (theta >= 0 ? 1 : -1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (size_t k = 0; k < n; ++k) {
          const double akp = a[k * n + p], akq = a[k * n + q];
          a[k * n + p] = c * akp - s * akq;
          a[k * n + q] = s * akp + c * akq;
        }
        for (size_t k = 0; k < n; ++k) {
          const double apk = a[p * n + k], aqk = a[q * n + k];
          a[p * n + k] = c * apk - s * aqk;
          a[q * n + k] = s * apk + c * aqk;
        }
        for (size_t k = 0; k < n; ++k) {
          const double vkp = v[k * n + p], vkq = v[k * n + q];
          v[k * n + p] = c * vkp - s * vkq;
          v[k * n + q] = s * vkp + c * vkq;
        }
      }
    }
  }
}

}  // namespace

SymmetricEigen EigenOf(int count, std::vector<double> matrix) {
  const auto n = static_cast<size_t>(count);
  std::vector<double> columns(n * n);
  for (size_t i = 0; i < n; ++i) columns[i * n + i] = 1;
  Rotate(n, &matrix, &columns);
  std::vector<size_t> order(n);
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return matrix[a * n + a] > matrix[b * n + b]; });
  SymmetricEigen eigen;
  for (const size_t k : order) {
    eigen.values.push_back(matrix[k * n + k]);
    for (size_t i = 0; i < n; ++i) eigen.vectors.push_back(columns[i * n + k]);
  }
  return eigen;
}

}  // namespace patina
