// What each command of `patina` does. Each returns the exit code; errors are printed.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"
#include "pipeline/cli/options.h"
#include "pipeline/validate/validate.h"

namespace patina {

int BakeCommand(const CommandLine& line, const CancelToken& cancel);
int RunCommand(const CommandLine& line, const CancelToken& cancel);
int UnpackCommand(const CommandLine& line, const CancelToken& cancel);
int InfoCommand(const CommandLine& line);
int CompareCommand(const CommandLine& line, const CancelToken& cancel);
int EvalCommand(const CommandLine& line);
int SampleCommand(const CommandLine& line, const CancelToken& cancel);
int ShaderCommand(const CommandLine& line);
int TradeoffCommand(const CommandLine& line, const CancelToken& cancel);
int PackCommand(const CommandLine& line, const CancelToken& cancel);
int UnpackArchiveCommand(const CommandLine& line, const CancelToken& cancel);
// `remeasure`: what --against asks for, or nullptr where images cannot be read.
int ValidateCommand(const CommandLine& line, validate::RemeasureFunction remeasure,
                    const CancelToken& cancel);
// Becomes the program patina-view; returns only if that cannot be started.
int ViewCommand(const CommandLine& line);

// "patina: error: <message>" on standard error.
void PrintError(const std::string& message);

// Prints the error; returns its exit code, that of bad input for what the user can correct.
int FailCommand(const Error& error);

}  // namespace patina
