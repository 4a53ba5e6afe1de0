// Jobs of kind "material": from maps to a published container.
#pragma once

#include "pipeline/base/progress.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/run_guards.h"

namespace patina {

// Stages: ingest (find the maps), reference (read, check and filter them), train, package (write
// the payloads), verify (decode the written bytes and measure them), report, publish. A container
// worse than job.min_psnr_db is kept as <out>/<asset>/rejected in place of an earlier rejected one.
JobResult RunMaterialJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                         const RunGuards& guards);

}  // namespace patina
