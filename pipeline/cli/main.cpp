#include <csignal>
#include <cstdio>
#include <exception>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/kernels/dispatch.h"

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

int Dispatch(const CommandLine& line) {
  if (!line.simd.empty()) {
    const Status forced = ForceSimdTarget(line.simd);
    if (!forced) {
      PrintError(forced.error().message);
      return kExitFailed;
    }
  }
  switch (line.command) {
    case Command::kBake:
      return BakeCommand(line, g_cancel);
    case Command::kRun:
      return RunCommand(line, g_cancel);
    case Command::kUnpack:
      return UnpackCommand(line, g_cancel);
    case Command::kInfo:
      return InfoCommand(line);
    case Command::kCompare:
      return CompareCommand(line, g_cancel);
    case Command::kEval:
      return EvalCommand(line);
    case Command::kSample:
      return SampleCommand(line);
    case Command::kShader:
      return ShaderCommand(line);
    case Command::kTradeoff:
      return TradeoffCommand(line, g_cancel);
    case Command::kPack:
      return PackCommand(line, g_cancel);
    case Command::kUnpackArchive:
      return UnpackArchiveCommand(line, g_cancel);
    case Command::kValidate:
      return ValidateCommand(line, g_cancel);
    case Command::kView:
      return ViewCommand(line);
    case Command::kSubmit:
      return SubmitCommand(line.client, g_cancel);
    case Command::kJobs:
      return JobsCommand(line.client, g_cancel);
    case Command::kWatch:
      return WatchCommand(line.client, g_cancel);
    case Command::kCancel:
      return CancelCommand(line.client, g_cancel);
    case Command::kRetry:
      return RetryCommand(line.client, g_cancel);
    case Command::kLogs:
      return LogsCommand(line.client, g_cancel);
    case Command::kStatus:
      return StatusCommand(line.client, g_cancel);
  }
  return kExitFailed;
}

int Main(int argc, char** argv) {
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
  const int exit_code = Dispatch(*parsed.command);
  if (std::fflush(stdout) != 0 && exit_code == kExitDone) {
    PrintError("standard output cannot be written; is the disk full?");
    return kExitFailed;
  }
  return exit_code;
}

}  // namespace
}  // namespace patina

int main(int argc, char** argv) {
  try {
    return patina::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "patina: error: unexpected failure: %s\n", error.what());
  } catch (...) {
    std::fprintf(stderr, "patina: error: unexpected failure\n");
  }
  return patina::kExitFailed;
}
