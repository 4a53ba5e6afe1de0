// Time as the daemon sees it; a test winds it by hand.
#pragma once

#include <cstdint>
#include <string>

namespace patina::daemon {

class Clock {
 public:
  virtual ~Clock() = default;
  // Milliseconds since 1970, UTC: what is stored and shown.
  virtual int64_t WallMs() const = 0;
  // Milliseconds that never go back and do not jump with the wall clock: what waits are measured
  // in.
  virtual int64_t SteadyMs() const = 0;
};

Clock& SystemClock();

// "2026-11-22T06:43:17.042Z".
std::string Rfc3339(int64_t wall_ms);

}  // namespace patina::daemon
