// Commands that read containers alone.
#include <cstdio>

#include "formats/base/file_io.h"
#include "formats/container.h"
#include "pipeline/cli/commands.h"
#include "pipeline/jobs/describe.h"
#include "pipeline/jobs/eval_pairs.h"
#include "pipeline/jobs/job_result.h"

namespace patina {

int InfoCommand(const CommandLine& line) {
  auto container = OpenContainer(line.info.container);
  if (!container) return FailCommand(container.error());
  if (!line.json) {
    std::fputs(ContainerText(*container).c_str(), stdout);
    return kExitDone;
  }
  auto json = ContainerJson(*container);
  if (!json) return FailCommand(json.error());
  std::printf("%s\n", json->c_str());
  return kExitDone;
}

int EvalCommand(const CommandLine& line) {
  const EvalOptions& options = line.eval;
  auto values = EvaluatePairsFile(options.container, options.pairs);
  if (!values) return FailCommand(values.error());
  if (options.out.empty()) {
    std::fputs(values->c_str(), stdout);
    return kExitDone;
  }
  const Status written = WriteFileDurably(options.out, std::string_view(*values));
  return written ? static_cast<int>(kExitDone) : FailCommand(written.error());
}

}  // namespace patina
