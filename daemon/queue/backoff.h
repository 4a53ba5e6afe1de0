// How long to wait before an attempt is repeated.
#pragma once

#include <cstdint>

namespace patina::daemon {

struct BackoffPolicy {
  int64_t base_ms = 5000;
  int64_t max_ms = 600000;
  double jitter = 0.5;  // 0..1
};

// Milliseconds to wait after the `failures`-th failure (1, 2 ...): base_ms doubled for each failure
// before it, at most max_ms, times a factor from [1 - jitter, 1] that `random` (any 64 bits) picks,
// so that jobs that failed together do not come back together.
int64_t BackoffMs(const BackoffPolicy& policy, int failures, uint64_t random);

}  // namespace patina::daemon
