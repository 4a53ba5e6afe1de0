// Starting the process of one attempt.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/base/unique_fd.h"
#include "daemon/execute/sandbox.h"
#include "formats/base/result.h"

namespace patina::daemon {

struct ChildSpec {
  std::vector<std::string> arguments;    // [0] is the program, an absolute path
  std::vector<std::string> environment;  // "NAME=value"
  std::string folder;                    // working directory
  int log_fd = -1;                       // becomes standard output and error
  int lock_fd = -1;                      // stays open in the child, which writes its id to it
  int nice = 0;
  int64_t memory_mb = 0, cpu_s = 0;  // 0: no limit
  const Sandbox* sandbox = nullptr;  // may be null
};

struct ChildProcess {
  pid_t pid = -1;  // also of its process group and session
  UniqueFd pidfd;  // becomes readable when it ends
};

// Starts it and waits until it runs the program. Errors: kResourceExhausted, kIo (what could not be
// set up or executed); then nothing is left of it.
Result<ChildProcess> StartChild(const ChildSpec& spec);

// Of a process that may not be ours. Errors: kNotFound, kIo.
Result<UniqueFd> OpenPidFd(pid_t pid);

// Whether a process has this file open.
bool HasFileOpen(pid_t pid, const std::string& path);

}  // namespace patina::daemon
