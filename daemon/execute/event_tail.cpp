#include "daemon/execute/event_tail.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>

namespace patina::daemon {
namespace {
constexpr size_t kMaxBytes = size_t{1} << 20;
}

std::vector<std::string> EventTail::Read(FileCalls& files) {
  std::vector<std::string> lines;
  int fd = -1;
  if (files.Open(path_, O_RDONLY | O_NONBLOCK, 0, &fd) != 0) return lines;
  std::array<uint8_t, 65536> buffer;
  size_t total = 0;
  if (::lseek(fd, static_cast<off_t>(offset_), SEEK_SET) >= 0) {
    size_t n = 0;
    while (total < kMaxBytes && files.Read(fd, buffer, &n) == 0 && n > 0) {
      total += n;
      offset_ += n;
      for (size_t i = 0; i < n; ++i) {
        const char c = static_cast<char>(buffer[i]);
        if (c != '\n') {
          if (rest_.size() < kMaxBytes) {
            rest_ += c;
          } else {
            too_long_ = true;
          }
          continue;
        }
        if (!too_long_) lines.push_back(std::move(rest_));
        rest_.clear();
        too_long_ = false;
      }
    }
  }
  files.Close(fd);
  return lines;
}

}  // namespace patina::daemon
