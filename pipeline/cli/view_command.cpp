#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "formats/container.h"
#include "pipeline/cli/commands.h"
#include "pipeline/jobs/job_result.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

// The server lies above this layer, so it is a program of its own: in the build tree beside this
// one, installed in ../libexec/patina. Empty if it is in neither place.
std::string FindViewer() {
  std::error_code ignored;
  const fs::path folder = fs::read_symlink("/proc/self/exe", ignored).parent_path();
  for (const fs::path& candidate :
       {folder / "patina-view", folder.parent_path() / "libexec" / "patina" / "patina-view"}) {
    if (access(candidate.c_str(), X_OK) == 0) return candidate.string();
  }
  return {};
}

}  // namespace

int ViewCommand(const CommandLine& line) {
  const ViewArguments& given = line.view;
  const auto container = OpenContainer(given.container);
  if (!container) return FailCommand(container.error());
  const std::string program = FindViewer();
  if (program.empty()) {
    PrintError(
        "the program patina-view, a part of patina, is neither beside it nor in "
        "../libexec/patina; install patina again");
    return kExitFailed;
  }
  const std::string port = std::to_string(given.port);
  execl(program.c_str(), "patina-view", port.c_str(), given.no_browser ? "0" : "1",
        given.source.c_str(), container->directory.c_str(), static_cast<char*>(nullptr));
  PrintError(program + " cannot be run: " + std::strerror(errno));
  return kExitFailed;
}

}  // namespace patina
