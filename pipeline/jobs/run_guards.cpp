#include "pipeline/jobs/run_guards.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <utility>

namespace patina {
namespace {

int Lock(int fd, int how) {
  int result;
  do {
    result = ::flock(fd, how);
  } while (result != 0 && errno == EINTR);
  return result;
}

// The number in the file; 0 in an empty one; -1 where there is none.
int64_t ReadNumber(int fd) {
  char text[32];
  const ssize_t size = ::pread(fd, text, sizeof text, 0);
  if (size == 0) return 0;
  int64_t number = -1;
  const auto [end, error] = std::from_chars(text, text + (size > 0 ? size : 0), number);
  return error == std::errc() && end < text + size && *end == '\n' ? number : -1;
}

}  // namespace

FenceHold::FenceHold(FenceHold&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

FenceHold::~FenceHold() {
  if (fd_ >= 0) ::close(fd_);
}

Result<FenceHold> FenceHold::Acquire(const std::string& fence_file, int64_t attempt) {
  const int fd = ::open(fence_file.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return FailErrno(errno, "cannot open", fence_file);
  FenceHold hold(fd);
  if (Lock(fd, LOCK_SH) != 0) return FailErrno(errno, "cannot lock", fence_file);
  const int64_t current = ReadNumber(fd);
  if (current == attempt) return hold;
  return Fail(ErrorCode::kConflict,
              "attempt " + std::to_string(attempt) + " may not publish: by " + fence_file +
                  (current < 0 ? " no attempt is current"
                               : " attempt " + std::to_string(current) + " is current"));
}

Status MoveFence(const std::string& fence_file, int64_t attempt) {
  const int fd = ::open(fence_file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) return FailErrno(errno, "cannot open", fence_file);
  const FenceHold hold(fd);
  if (Lock(fd, LOCK_EX) != 0) return FailErrno(errno, "cannot lock", fence_file);
  const int64_t current = ReadNumber(fd);
  if (current > attempt) {
    return Fail(ErrorCode::kConflict, fence_file + ": attempt " + std::to_string(current) +
                                          " is current, which is later than " +
                                          std::to_string(attempt));
  }
  // A larger number is never shorter text, so one write replaces the other whole.
  const std::string text = std::to_string(attempt) + "\n";
  if (::pwrite(fd, text.data(), text.size(), 0) != static_cast<ssize_t>(text.size()))
    return FailErrno(errno != 0 ? errno : EIO, "cannot write", fence_file);
  if (::fsync(fd) != 0) return FailErrno(errno, "cannot write", fence_file);
  return {};
}

}  // namespace patina
