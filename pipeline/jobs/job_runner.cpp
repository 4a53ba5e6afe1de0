#include "pipeline/jobs/job_runner.h"

#include "pipeline/jobs/brdf_run.h"
#include "pipeline/jobs/material_run.h"

namespace patina {

JobResult RunJob(const Job& job, JobObserver& observer, const CancelToken& cancel) {
  JobResult result = job.kind == JobKind::kBrdf ? RunBrdfJob(job, observer, cancel)
                                                : RunMaterialJob(job, observer, cancel);
  observer.OnResult(result);
  return result;
}

}  // namespace patina
