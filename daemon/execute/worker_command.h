// The command line of an attempt, and the script in which a farm runs it.
#pragma once

#include <string>
#include <vector>

#include "daemon/execute/executor.h"

namespace patina::daemon {

// `worker` is the absolute path of `patina`.
std::vector<std::string> WorkerCommand(const std::string& worker, const AttemptSpec& spec);

// A file in the attempt's folder that is there once the script runs.
inline constexpr const char* kStartedName = "started";

// For /bin/sh: goes to the attempt's folder, makes sure that it runs once and that the attempt is
// still the current one, sets the limits that the local executor sets, and becomes the worker with
// this environment and no other. It ends with 75 if the folder is not there, 76 if it has run
// before, 77 if another attempt is current.
std::string WorkerScript(const std::string& worker, const std::vector<std::string>& environment,
                         const AttemptSpec& spec);

}  // namespace patina::daemon
