// What a job's process may reach, by Landlock and a seccomp filter, where the kernel has them.
#pragma once

#include <string>
#include <vector>

#include "daemon/base/unique_fd.h"
#include "formats/base/result.h"

namespace patina::daemon {

struct SandboxPaths {
  std::vector<std::string> read;     // files, and folders with all below them
  std::vector<std::string> execute;  // the same; also read
  std::vector<std::string> list;     // folders that may be opened, but not their files
  std::vector<std::string> write;    // folders in which everything may be done
};

// The rules of one job, made before the fork so that the child only has to apply them. What is
// named but missing is left out: it cannot be reached either.
class Sandbox {
 public:
  // The version of Landlock that the kernel has; 0: none.
  static int LandlockVersion();

  // Without Landlock in the kernel: the filter alone, and the paths are not looked at. Errors: kIo.
  static Result<Sandbox> Create(const SandboxPaths& paths);

  // For the child, between fork and exec, once it can gain no privileges: Landlock, and a filter
  // that refuses what a bake never does (sockets, tracing, mounting, loading of kernel code ...).
  // Only makes system calls. 0 or an errno value.
  int Apply() const;

 private:
  explicit Sandbox(UniqueFd ruleset) : ruleset_(std::move(ruleset)) {}
  UniqueFd ruleset_;  // none: no Landlock
};

}  // namespace patina::daemon
