// What the two executables of `patina` share: signals, the command line, errors.
#pragma once

#include "pipeline/base/progress.h"
#include "pipeline/cli/options.h"

namespace patina {

// Runs a command and returns its exit code.
using Dispatch = int (*)(const CommandLine& line, const CancelToken& cancel, char** argv);

// The whole of main(): reads the command line, answers --help and --version, and never throws.
int RunProgram(int argc, char** argv, Dispatch dispatch);

// Commands that need Debian's image library. It takes a third of a second to load (some 260
// libraries), so they are a program of their own, which `patina` becomes when one is asked for.
bool NeedsImages(const CommandLine& line);

}  // namespace patina
