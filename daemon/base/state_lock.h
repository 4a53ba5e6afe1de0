// One daemon for each state folder.
#pragma once

#include <string>

#include "daemon/base/unique_fd.h"
#include "formats/base/result.h"

namespace patina::daemon {

// Holds <state_dir>/patinad.lock; gone when the process is.
class StateLock {
 public:
  // Creates the file (mode 0600) and locks it. Errors: kConflict, naming the process that has it;
  // those of FailErrno.
  static Result<StateLock> Acquire(const std::string& state_dir);

 private:
  explicit StateLock(UniqueFd fd) : fd_(std::move(fd)) {}
  UniqueFd fd_;
};

}  // namespace patina::daemon
