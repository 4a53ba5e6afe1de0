// From what somebody names on a command line to jobs.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/jobs/job.h"

namespace patina {

// A job, or why there is none.
struct PlannedJob {
  std::string asset;
  Result<Job> job;
  bool is_brdf_file = false;  // a BRDF for which no job file says anything
};

struct JobPlan {
  std::vector<PlannedJob> jobs;
  std::vector<std::string> skipped;  // subfolders without images and BRDF files
};

// input: a job file, a BRDF file, a list of images, a scene (one job for each material), a folder
// of maps, or a folder of such. What an input holds but cannot be baked is listed with its error.
// `except`: a folder that is passed over, see FindAssets. Jobs of files and folders have no `out`
// yet.
JobPlan PlanJobs(const std::string& input, const std::string& except);

}  // namespace patina
