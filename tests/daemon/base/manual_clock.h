// A clock that stands still until it is wound.
#pragma once

#include <atomic>

#include "daemon/base/clock.h"

namespace patina::daemon::test {

class ManualClock : public Clock {
 public:
  int64_t WallMs() const override { return 1'800'000'000'000 + passed_ms_; }
  int64_t SteadyMs() const override { return 1'000 + passed_ms_; }
  void Advance(int64_t ms) { passed_ms_ += ms; }

 private:
  std::atomic<int64_t> passed_ms_{0};
};

}  // namespace patina::daemon::test
