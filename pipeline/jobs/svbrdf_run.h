// Jobs of kind "svbrdf": from measured images, a layered material with maps or a texture set to a
// published container.
#pragma once

#include "pipeline/base/progress.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/run_guards.h"

namespace patina {

// Stages: ingest (read and hash the source, draw samples from it), train, package, verify (decode
// the written bytes and measure them), report, publish.
JobResult RunSvbrdfJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                       const RunGuards& guards);

}  // namespace patina
