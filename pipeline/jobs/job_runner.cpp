#include "pipeline/jobs/job_runner.h"

#include "pipeline/jobs/brdf_run.h"
#include "pipeline/jobs/material_run.h"

namespace patina {

JobResult RunJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                 const RunGuards& guards) {
  JobResult result = job.kind == JobKind::kBrdf ? RunBrdfJob(job, observer, cancel, guards)
                                                : RunMaterialJob(job, observer, cancel, guards);
  observer.OnResult(result);
  return result;
}

}  // namespace patina
