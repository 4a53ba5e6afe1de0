// One daemon for each state folder.
#pragma once

#include <functional>
#include <string>

#include "daemon/base/unique_fd.h"
#include "formats/base/result.h"

namespace patina::daemon {

// Holds <state_dir>/patinad.lock; gone when the process is.
class StateLock {
 public:
  // Creates the file (mode 0600) and locks it. A daemon that was killed while it started a job may
  // leave its lock for some milliseconds to the job's process, until that runs its own program: so
  // where the process that has the lock is gone, it is tried again, after `pause` each time, for
  // about two seconds. Errors: kConflict, naming the process that has it; those of FailErrno.
  static Result<StateLock> Acquire(const std::string& state_dir,
                                   const std::function<void()>& pause = PauseBriefly);

 private:
  static void PauseBriefly();
  explicit StateLock(UniqueFd fd) : fd_(std::move(fd)) {}
  UniqueFd fd_;
};

}  // namespace patina::daemon
