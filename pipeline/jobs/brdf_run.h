// Jobs of kind "brdf": from a measured BRDF to a published container.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/brdf/train_brdf.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/run_guards.h"

namespace patina {

// Stages: ingest (read and check the file), train, package (write grid, weights and sampler),
// verify (decode the written bytes and measure them), report, publish.
JobResult RunBrdfJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                     const RunGuards& guards);

// Jobs of kind "brdf" that share codebooks: groups of at most `share` materials that look alike are
// trained together (see GroupAlike), then each job runs as above with what was trained in place of
// its own training. All have one `out`, where a group's codebook is written as
// codebook-<hash>.hpc before any container that names it. A group of one is trained alone. Files
// that cannot be read fail by themselves. observer(i): of job i, made when its turn comes; the
// group's progress goes to that of its first job. Results stand in the order of the jobs.
std::vector<JobResult> RunSharedBrdfJobs(std::span<const Job> jobs, size_t share,
                                         const std::function<JobObserver&(size_t)>& observer,
                                         const CancelToken& cancel);

}  // namespace patina
