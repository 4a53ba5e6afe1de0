// From the configuration to the executor that it names.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/base/clock.h"
#include "daemon/base/file_calls.h"
#include "daemon/base/log.h"
#include "daemon/config/config.h"
#include "daemon/execute/executor.h"

namespace patina::daemon {

// environment: the daemon's, as environ(7); jobs get what of it concerns them. Errors: those of
// MakeLocalExecutor and MakeFarmExecutor. The references must outlive it.
Result<std::unique_ptr<Executor>> MakeExecutor(const Config& config,
                                               const std::vector<std::string>& environment,
                                               FileCalls& files, Clock& clock, Logger& log);

// Asks Slurm whether it would take a job of the configuration's limits, and submits nothing;
// without a farm, whether the kernel has the sandbox that is required. The answer is text to print,
// empty for other executors. Errors: kInvalidArgument (it would not, its programs are not here, or
// its arguments or templates are wrong), kUnsupported (no sandbox), kIo (it does not answer; that
// says nothing about the configuration).
Result<std::string> AskExecutor(const Config& config, Clock& clock);

}  // namespace patina::daemon
