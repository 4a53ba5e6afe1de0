#include "daemon/api/tickets.h"

#include <sys/random.h>

#include <cerrno>

#include "formats/base/file_io.h"

namespace patina::daemon {

Result<std::string> RandomName(size_t bytes) {
  std::string random(bytes, '\0'), name;
  if (getrandom(random.data(), bytes, 0) != static_cast<ssize_t>(bytes))
    return FailErrno(errno, "cannot get", "random numbers");
  for (const char c : random) {
    name += "0123456789abcdef"[static_cast<unsigned char>(c) >> 4];
    name += "0123456789abcdef"[static_cast<unsigned char>(c) & 15];
  }
  return name;
}

Result<std::string> Tickets::Issue(const std::string& path, Clock::time_point now) {
  PATINA_ASSIGN(std::string ticket, RandomName(16));
  const std::lock_guard lock(mutex_);
  ForgetOld(now);
  if (tickets_.size() >= kMost) {
    return Fail(ErrorCode::kResourceExhausted,
                "too many tickets are out; they end by themselves within minutes");
  }
  tickets_[ticket] = {path, now + kLifetime};
  return ticket;
}

bool Tickets::Admits(const std::string& ticket, std::string_view path, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  ForgetOld(now);
  const auto found = tickets_.find(ticket);
  return found != tickets_.end() && found->second.path == path;
}

void Tickets::ForgetOld(Clock::time_point now) {
  for (auto entry = tickets_.begin(); entry != tickets_.end();)
    entry = entry->second.end <= now ? tickets_.erase(entry) : std::next(entry);
}

}  // namespace patina::daemon
