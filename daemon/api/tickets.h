// Leave to open one page for a while, for what cannot send a header: a link that a browser follows.
#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <string_view>

#include "formats/base/result.h"

namespace patina::daemon {

// Thread-safe. A ticket holds for the path it was issued for, and for reading only.
class Tickets {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kLifetime{300};
  static constexpr size_t kMost = 10000;

  // 128 random bits in hexadecimal. Errors: kIo (no random numbers), kResourceExhausted (more than
  // kMost are out).
  Result<std::string> Issue(const std::string& path, Clock::time_point now);
  bool Admits(const std::string& ticket, std::string_view path, Clock::time_point now);

 private:
  struct Entry {
    std::string path;
    Clock::time_point end;
  };
  void ForgetOld(Clock::time_point now);

  std::mutex mutex_;
  std::map<std::string, Entry> tickets_;
};

// So many random bytes of the system in hexadecimal. Errors: kIo.
Result<std::string> RandomName(size_t bytes);

}  // namespace patina::daemon
