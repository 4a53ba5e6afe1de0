// What an uploaded folder holds, by names and by the text of scenes alone: images are opened by the
// jobs, in processes of their own, and never by the daemon.
#pragma once

#include <string>
#include <vector>

#include "pipeline/jobs/job.h"

namespace patina::daemon {

// The jobs of a folder and the folders in it, without `out`: every material of every scene, every
// set of maps that no scene owns, every BRDF file. Assets are named after material, folder or set,
// or file; where that is not enough to tell them apart, after the way to them. Hidden folders and
// links to folders are passed over.
std::vector<Job> PlanUpload(const std::string& folder);

}  // namespace patina::daemon
