// Runs one job of any kind, from its input to a published container.
#pragma once

#include "pipeline/base/progress.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/run_guards.h"

namespace patina {

// The stages are those of the job's kind (material_run.h, brdf_run.h): ingest, reference, train,
// package, verify, report, publish. The observer hears of each, and of the result. Everything that
// can go wrong is in the result:
//   kExitDone         published as result.container; `current` of the asset points at it.
//   kExitBadInput     input missing, ambiguous, damaged, not finite ...
//   kExitQualityGate  worse than the job's gate: kept beside the revisions, not published.
//   kExitInterrupted  `cancel` was set.
//   kExitFailed       anything else: disk, memory, a bug.
// Unless it is done, nothing is published, an earlier container is as it was, and what was staged
// is removed. The bytes of the container depend on the input and the job alone, not on the number
// of threads; of run.json and report.html they do not.
JobResult RunJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                 const RunGuards& guards = {});

}  // namespace patina
