// Sums over the rows of an image that do not depend on the number of threads.
#pragma once

#include <algorithm>
#include <vector>

#include "pipeline/base/thread_pool.h"

namespace patina::metrics {

// The sum of row_sum(y) for y in [0, rows), added in row order. row_sum is called once for each
// row, on any worker.
template <class RowSum>
double SumOverRows(int rows, RowSum&& row_sum, ThreadPool& pool) {
  constexpr int kRowsPerTask = 32;
  std::vector<double> sums(static_cast<size_t>(std::max(rows, 0)));
  pool.ParallelFor((rows + kRowsPerTask - 1) / kRowsPerTask, [&](int task, int) {
    const int end = std::min(rows, (task + 1) * kRowsPerTask);
    for (int y = task * kRowsPerTask; y < end; ++y) sums[static_cast<size_t>(y)] = row_sum(y);
  });
  double total = 0;
  for (const double sum : sums) total += sum;
  return total;
}

}  // namespace patina::metrics
