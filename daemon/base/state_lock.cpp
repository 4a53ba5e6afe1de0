#include "daemon/base/state_lock.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <chrono>
#include <thread>

#include "formats/base/file_io.h"
#include "formats/base/names.h"

namespace patina::daemon {

namespace {

constexpr int kTries = 400;

std::string HolderOf(int fd) {
  char text[32];
  const ssize_t n = ::pread(fd, text, sizeof text, 0);
  std::string holder(text, n > 0 ? static_cast<size_t>(n) : 0);
  while (!holder.empty() && holder.back() == '\n') holder.pop_back();
  return holder;
}

bool IsGone(const std::string& holder) {
  pid_t pid = 0;
  const auto [end, problem] = std::from_chars(holder.data(), holder.data() + holder.size(), pid);
  return problem == std::errc() && end == holder.data() + holder.size() && pid > 0 &&
         ::kill(pid, 0) != 0 && errno == ESRCH;
}

}  // namespace

void StateLock::PauseBriefly() { std::this_thread::sleep_for(std::chrono::milliseconds(5)); }

Result<StateLock> StateLock::Acquire(const std::string& state_dir,
                                     const std::function<void()>& pause) {
  const std::string path = state_dir + "/patinad.lock";
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!fd) return FailErrno(errno, "cannot create", path);
  for (int tries = 1; ::flock(fd.get(), LOCK_EX | LOCK_NB) != 0; ++tries) {
    if (errno != EWOULDBLOCK) return FailErrno(errno, "cannot lock", path);
    const std::string holder = HolderOf(fd.get());
    if (tries >= kTries || !IsGone(holder)) {
      return Fail(ErrorCode::kConflict, "another patinad has the state folder " + state_dir +
                                            ": process " +
                                            (holder.empty() ? "unknown" : QuoteForMessage(holder)) +
                                            "; stop that one, or give this one another --state");
    }
    pause();
  }
  const std::string pid = std::to_string(::getpid()) + "\n";
  if (::ftruncate(fd.get(), 0) != 0 ||
      ::pwrite(fd.get(), pid.data(), pid.size(), 0) != static_cast<ssize_t>(pid.size())) {
    return FailErrno(errno, "cannot write", path);
  }
  return StateLock(std::move(fd));
}

}  // namespace patina::daemon
