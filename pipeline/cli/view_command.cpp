#include "formats/container.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/part_program.h"

namespace patina {

// The server lies above this layer: it is a program of its own.
int ViewCommand(const CommandLine& line) {
  const ViewArguments& given = line.view;
  const auto container = OpenContainer(given.container);
  if (!container) return FailCommand(container.error());
  std::string words[] = {"patina-view", std::to_string(given.port), given.no_browser ? "0" : "1",
                         given.source, container->directory};
  char* argv[] = {words[0].data(), words[1].data(), words[2].data(),
                  words[3].data(), words[4].data(), nullptr};
  return BecomePart("patina-view", argv);
}

}  // namespace patina
