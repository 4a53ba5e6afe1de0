#include "pipeline/cli/program.h"

#include <csignal>
#include <cstdio>
#include <exception>

#include "pipeline/cli/commands.h"
#include "pipeline/jobs/job_result.h"

namespace patina {
namespace {

CancelToken g_cancel;

extern "C" void OnSignal(int) { g_cancel.Cancel(); }

void HandleSignals() {
  struct sigaction action {};
  action.sa_handler = OnSignal;
  // The second signal ends the process at once; what is staged is then removed by the next bake of
  // the asset.
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // A reader that goes away (`patina bake ... | head`) must not end a bake half way.
  std::signal(SIGPIPE, SIG_IGN);
}

int Run(int argc, char** argv, Dispatch dispatch) {
  HandleSignals();
  const ParsedCommandLine parsed = ParseCommandLine(argc, argv);
  if (!parsed.command) {
    if (parsed.exit_code != 0) {
      PrintError(parsed.text);
      return parsed.exit_code;
    }
    std::fputs(parsed.text.c_str(), stdout);
    return kExitDone;
  }
  const int exit_code = dispatch(*parsed.command, g_cancel, argv);
  if (std::fflush(stdout) != 0 && exit_code == kExitDone) {
    PrintError("standard output cannot be written; is the disk full?");
    return kExitFailed;
  }
  return exit_code;
}

}  // namespace

void PrintError(const std::string& message) {
  std::fprintf(stderr, "patina: error: %s\n", message.c_str());
}

int FailCommand(const Error& error) {
  PrintError(error.message);
  return ExitCodeFor(error, true);
}

int RunProgram(int argc, char** argv, Dispatch dispatch) {
  try {
    return Run(argc, argv, dispatch);
  } catch (const std::exception& error) {
    PrintError(std::string("unexpected failure: ") + error.what());
  } catch (...) {
    PrintError("unexpected failure");
  }
  return kExitFailed;
}

bool NeedsImages(const CommandLine& line) {
  switch (line.command) {
    case Command::kBake:
    case Command::kRun:
    case Command::kUnpack:
    case Command::kCompare:
    case Command::kSample:
    case Command::kTradeoff:
    case Command::kSubmit:  // plans jobs of folders
      return true;
    case Command::kValidate:
      return !line.validate.against.empty();
    default:
      return false;
  }
}

}  // namespace patina
