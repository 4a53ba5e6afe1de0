// Runs one job, from maps to a published container.
#pragma once

#include "pipeline/base/progress.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"

namespace patina {

// Stages, in order: ingest (find the maps, read and check them), reference (filter them), train,
// package (write the payloads), verify (decode the written bytes and measure them), report,
// publish. The observer hears of each, and of the result. Everything that can go wrong is in the
// result:
//   kExitDone         published as result.container; `current` of the asset points at it.
//   kExitBadInput     maps missing, ambiguous, damaged, not finite ...
//   kExitQualityGate  worse than job.min_psnr_db: kept as <out>/<asset>/rejected in place of an
//   earlier rejected one. kExitInterrupted  `cancel` was set. kExitFailed       anything else:
//   disk, memory, a bug.
// Unless it is done, nothing is published, an earlier container is as it was, and what was staged
// is removed. The bytes of the container depend on the maps and the job alone (run.json excepted),
// not on the number of threads.
JobResult RunJob(const Job& job, JobObserver& observer, const CancelToken& cancel);

}  // namespace patina
