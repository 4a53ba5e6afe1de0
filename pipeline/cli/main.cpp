// `patina`: starts at once; what needs the image library is done by patina-bake.
#include "pipeline/cli/commands.h"
#include "pipeline/cli/part_program.h"
#include "pipeline/cli/program.h"
#include "pipeline/jobs/job_result.h"

namespace patina {
namespace {

int DispatchHere(const CommandLine& line, const CancelToken& cancel, char** argv) {
  if (NeedsImages(line)) return BecomePart("patina-bake", argv);
  switch (line.command) {
    case Command::kInfo:
      return InfoCommand(line);
    case Command::kEval:
      return EvalCommand(line);
    case Command::kShader:
      return ShaderCommand(line);
    case Command::kView:
      return ViewCommand(line);
    case Command::kPack:
      return PackCommand(line, cancel);
    case Command::kUnpackArchive:
      return UnpackArchiveCommand(line, cancel);
    case Command::kValidate:
      return ValidateCommand(line, nullptr, cancel);
    case Command::kJobs:
      return JobsCommand(line.client, cancel);
    case Command::kWatch:
      return WatchCommand(line.client, cancel);
    case Command::kCancel:
      return CancelCommand(line.client, cancel);
    case Command::kRetry:
      return RetryCommand(line.client, cancel);
    case Command::kLogs:
      return LogsCommand(line.client, cancel);
    case Command::kStatus:
      return StatusCommand(line.client, cancel);
    default:
      return kExitFailed;
  }
}

}  // namespace
}  // namespace patina

int main(int argc, char** argv) { return patina::RunProgram(argc, argv, patina::DispatchHere); }
