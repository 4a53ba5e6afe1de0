// Attempts as child processes of this machine: `patina run`, each in a session of its own, with
// limits and in a sandbox.
//
// A child holds a lock (flock) on <folder>/alive from before it runs to its end, and so do
// processes that it starts: an attempt is dead when, and only when, the lock is free. That does not
// depend on process ids, so it also holds for a later daemon.
//
// A child is not told to die with the daemon (PR_SET_PDEATHSIG): a bake of minutes outlives a
// restart, and is adopted.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/base/file_calls.h"
#include "daemon/base/log.h"
#include "daemon/execute/executor.h"

namespace patina::daemon {

struct LocalExecutorOptions {
  std::string worker;  // absolute path of `patina`
  int nice = 0;        // 0..19
  enum class Sandbox { kOff, kIfPossible, kRequired } sandbox = Sandbox::kIfPossible;
  std::vector<std::string> environment;  // of the child, complete: "NAME=value"
  std::vector<std::string> read;         // files and folders that every child may read
};

// Errors: kUnsupported (it is required, and the kernel has no Landlock).
Status CheckSandbox(LocalExecutorOptions::Sandbox sandbox);

// Errors: kUnsupported (a sandbox is required and the kernel has none), kResourceExhausted. The
// references must outlive it.
Result<std::unique_ptr<Executor>> MakeLocalExecutor(const LocalExecutorOptions& options,
                                                    FileCalls& files, Logger& log);

}  // namespace patina::daemon
