#include "pipeline/cli/part_program.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "pipeline/cli/commands.h"
#include "pipeline/jobs/job_result.h"

namespace patina {

int BecomePart(const std::string& name, char* const argv[]) {
  char self[4096];
  const ssize_t size = ::readlink("/proc/self/exe", self, sizeof self);
  if (size <= 0 || size == static_cast<ssize_t>(sizeof self)) {
    PrintError("cannot tell where this program lies; is /proc mounted?");
    return kExitFailed;
  }
  const std::string own(self, static_cast<size_t>(size));
  const std::string program = own.substr(0, own.rfind('/')) + "/../libexec/patina/" + name;
  ::execv(program.c_str(), argv);
  PrintError("cannot start " + program + ": " + std::strerror(errno) +
             "; it is built and installed together with this one: install patina again");
  return kExitFailed;
}

}  // namespace patina
