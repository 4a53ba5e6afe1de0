#include "pipeline/jobs/job_runner.h"

#include "pipeline/jobs/brdf_run.h"
#include "pipeline/jobs/material_run.h"
#include "pipeline/jobs/svbrdf_run.h"

namespace patina {
namespace {

JobResult Run(const Job& job, JobObserver& observer, const CancelToken& cancel,
              const RunGuards& guards) {
  switch (job.kind) {
    case JobKind::kBrdf:
      return RunBrdfJob(job, observer, cancel, guards);
    case JobKind::kSvbrdf:
      return RunSvbrdfJob(job, observer, cancel, guards);
    case JobKind::kMaterial:
      break;
  }
  return RunMaterialJob(job, observer, cancel, guards);
}

}  // namespace

JobResult RunJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                 const RunGuards& guards) {
  JobResult result = Run(job, observer, cancel, guards);
  observer.OnResult(result);
  return result;
}

}  // namespace patina
