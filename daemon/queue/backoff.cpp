#include "daemon/queue/backoff.h"

#include <algorithm>

namespace patina::daemon {

int64_t BackoffMs(const BackoffPolicy& policy, int failures, uint64_t random) {
  int64_t wait = std::min(policy.base_ms, policy.max_ms);
  for (int i = 1; i < failures && wait < policy.max_ms; ++i)
    wait = wait > policy.max_ms / 2 ? policy.max_ms : wait * 2;
  const double unit = static_cast<double>(random >> 11) * 0x1p-53;
  return wait - static_cast<int64_t>(static_cast<double>(wait) * policy.jitter * unit);
}

}  // namespace patina::daemon
