// From what somebody wants to have baked to the bodies of POST /v1/jobs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/jobs/job.h"

namespace patina {

struct PlannedSubmit {
  std::string asset;
  std::string body;            // JSON; empty if there is an error
  std::optional<Error> error;  // why there is no job
};

// A folder that the daemon watches: what lies in it is baked as it is there, under its name there.
struct SubmitDropFolder {
  std::string path;  // without links
  bool as_svbrdf = false;
};

struct SubmitSettings {
  std::string out;  // empty: the job's, else the daemon's
  int priority = 0;
  bool force = false;
  // Of texture sets; empty: the job's.
  std::string working_space, color_space, ocio;
  // What texture sets become, "material" or "svbrdf"; empty: as the job or the drop folder says.
  std::string as;
  std::vector<SubmitDropFolder> drop_folders;
};

// input: a job file, a BRDF file, a folder of maps, or a folder of such. Paths are made absolute:
// the daemon has another working folder. Assets that cannot be baked are listed with their error.
std::vector<PlannedSubmit> PlanSubmit(const std::string& input, const SubmitSettings& settings);
using SubmitPlanner = decltype(&PlanSubmit);

}  // namespace patina
