// Jobs of kind "brdf": from a measured BRDF to a published container.
#pragma once

#include "pipeline/base/progress.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/run_guards.h"

namespace patina {

// Stages: ingest (read and check the file), train, package (write grid, weights and sampler),
// verify (decode the written bytes and measure them), report, publish.
JobResult RunBrdfJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                     const RunGuards& guards);

}  // namespace patina
