// From a job that names a material of a scene to the maps and constants that are baked.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_sets.h"
#include "pipeline/jobs/scene_job.h"

namespace patina {

// What is baked of the material. Images inside other files are written to `scratch_folder`, which
// is made when it is needed. Errors: those of ReadSceneImage and ReadImageInfo, kInvalidArgument (a
// role that is not known, channels that do not fit it), with the pointer of the material.
Result<JobMaps> MapsOfScene(const Job& job, const SceneChoice& choice,
                            const std::string& scratch_folder);

}  // namespace patina
