// Eigenvectors of small symmetric matrices.
#pragma once

#include <vector>

namespace patina {

struct SymmetricEigen {
  std::vector<double> values;   // [n], the largest first
  std::vector<double> vectors;  // [n][n], row k of unit length belongs to values[k]
};

// matrix: [n][n], symmetric, finite. By cyclic Jacobi rotations, in a fixed order: fine for 64 x 64.
SymmetricEigen EigenOf(int n, std::vector<double> matrix);

}  // namespace patina
