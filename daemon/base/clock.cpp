#include "daemon/base/clock.h"

#include <chrono>
#include <cstdio>
#include <ctime>

namespace patina::daemon {
namespace {

template <class T>
int64_t Milliseconds() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(T::now().time_since_epoch()).count();
}

class RealClock : public Clock {
 public:
  int64_t WallMs() const override { return Milliseconds<std::chrono::system_clock>(); }
  int64_t SteadyMs() const override { return Milliseconds<std::chrono::steady_clock>(); }
};

}  // namespace

Clock& SystemClock() {
  static RealClock clock;
  return clock;
}

std::string Rfc3339(int64_t wall_ms) {
  time_t seconds = static_cast<time_t>(wall_ms / 1000);
  int64_t fraction = wall_ms % 1000;
  if (fraction < 0) {
    fraction += 1000;
    --seconds;
  }
  tm parts{};
  gmtime_r(&seconds, &parts);
  char text[80];
  std::snprintf(text, sizeof text, "%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", parts.tm_year + 1900,
                parts.tm_mon + 1, parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec,
                static_cast<int>(fraction));
  return text;
}

}  // namespace patina::daemon
