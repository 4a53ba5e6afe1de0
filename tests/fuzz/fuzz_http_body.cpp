// The bodies of the daemon's requests: any bytes give a request or a list of problems, each with
// its place.
#include <string_view>

#include "daemon/api/submit_body.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view body(reinterpret_cast<const char*>(data), size);
  for (const daemon::FieldProblem& problem : daemon::ParseSubmit(body, "/baked").problems)
    FUZZ_CHECK(!problem.detail.empty());
  for (const daemon::FieldProblem& problem : daemon::ParsePriority(body).problems)
    FUZZ_CHECK(!problem.detail.empty());
  for (const daemon::FieldProblem& problem : daemon::CheckEmptyBody(body))
    FUZZ_CHECK(!problem.detail.empty());
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  const std::string_view texts[] = {
      R"({"job": {"kind": "material", "asset": "a", "folder": "/f", "out": "/o"}, "priority": 3, "force": true,
          "limits": {"memory_mb": 512, "cpu_s": 10, "wall_s": 20}})",
      R"({"job": {"kind": "brdf", "asset": "a", "file": "/f.binary"}})", R"({"priority": -5})",
      "{}"};
  return SeedsOf(texts, [](std::string_view text) {
    return daemon::ParseSubmit(text, "/baked").problems.empty() ||
           daemon::ParsePriority(text).problems.empty() || daemon::CheckEmptyBody(text).empty();
  });
}
