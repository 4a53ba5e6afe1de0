// The lines that a growing file gains.
#pragma once

#include <string>
#include <vector>

#include "daemon/base/file_calls.h"

namespace patina::daemon {

class EventTail {
 public:
  explicit EventTail(std::string path) : path_(std::move(path)) {}

  // Complete lines, without their line breaks, since the last call; a line of more than 1 MiB is
  // left out. At most about 1 MiB is read, so call again while lines come. A file that is not there
  // or cannot be read has none yet.
  std::vector<std::string> Read(FileCalls& files);

 private:
  std::string path_;
  uint64_t offset_ = 0;
  std::string rest_;
  bool too_long_ = false;  // of the line that rest_ begins
};

}  // namespace patina::daemon
