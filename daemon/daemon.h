// patinad from its command line to its exit code.
#pragma once

#include "daemon/base/file_calls.h"

namespace patina::daemon {

// Runs until a signal ends it. `files` are the calls that all modules make; main() passes the real
// ones. Exit codes: 0 stopped, 1 failed, 2 wrong usage, 3 wrong configuration.
int DaemonMain(int argc, char** argv, FileCalls& files);

}  // namespace patina::daemon
