// `patina`: starts at once; what needs the image library is done by patina-bake.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/program.h"
#include "pipeline/jobs/job_result.h"

namespace patina {
namespace {

// The same place in a build, below /usr and below any other prefix.
constexpr char kBakeProgram[] = "/../libexec/patina/patina-bake";

// Returns only if that fails. Signals, working folder and descriptors are inherited; the process
// stays the same, so who waits for it or ends it need not know.
int BecomeBakeProgram(char** argv) {
  char self[4096];
  const ssize_t size = ::readlink("/proc/self/exe", self, sizeof self);
  if (size <= 0 || size == static_cast<ssize_t>(sizeof self)) {
    PrintError("cannot tell where this program lies; is /proc mounted?");
    return kExitFailed;
  }
  const std::string own(self, static_cast<size_t>(size));
  const std::string program = own.substr(0, own.rfind('/')) + kBakeProgram;
  ::execv(program.c_str(), argv);
  PrintError("cannot start " + program + ": " + std::strerror(errno) +
             "; it is built and installed together with this one: install patina again");
  return kExitFailed;
}

int DispatchHere(const CommandLine& line, const CancelToken& cancel, char** argv) {
  if (NeedsImages(line)) return BecomeBakeProgram(argv);
  switch (line.command) {
    case Command::kInfo:
      return InfoCommand(line);
    case Command::kEval:
      return EvalCommand(line);
    case Command::kShader:
      return ShaderCommand(line);
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
