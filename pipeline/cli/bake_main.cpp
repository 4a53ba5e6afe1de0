// `patina-bake`: the commands of `patina` that read or write images; started by it.
#include "pipeline/cli/commands.h"
#include "pipeline/cli/program.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/kernels/dispatch.h"
#include "pipeline/validate/remeasure.h"

namespace patina {
namespace {

int DispatchImages(const CommandLine& line, const CancelToken& cancel, char**) {
  if (!line.simd.empty()) {
    const Status forced = ForceSimdTarget(line.simd);
    if (!forced) {
      PrintError(forced.error().message);
      return kExitFailed;
    }
  }
  switch (line.command) {
    case Command::kBake:
      return BakeCommand(line, cancel);
    case Command::kRun:
      return RunCommand(line, cancel);
    case Command::kUnpack:
      return UnpackCommand(line, cancel);
    case Command::kCompare:
      return CompareCommand(line, cancel);
    case Command::kSample:
      return SampleCommand(line, cancel);
    case Command::kTradeoff:
      return TradeoffCommand(line, cancel);
    case Command::kSubmit:
      return SubmitCommand(line.client, PlanSubmit, cancel);
    case Command::kValidate:
      return ValidateCommand(line, validate::Remeasure, cancel);
    default:
      PrintError("patina-bake is started by patina, for the commands that need it");
      return kExitUsage;
  }
}

}  // namespace
}  // namespace patina

int main(int argc, char** argv) { return patina::RunProgram(argc, argv, patina::DispatchImages); }
