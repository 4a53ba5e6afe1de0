// Jobs of kind "brdf" that share codebooks.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"

namespace patina {

// Groups of at most `share` materials that look alike (brdf::GroupAlike) are trained together, by
// the first job of each; then each job runs as RunBrdfJob with what was trained. All jobs have one
// `out`, where a group's codebook is written as codebook-<hash>.hpc before any container names it.
// Files that cannot be read, and groups of one or such as cannot be trained, run alone. observer(i)
// is that of job i; a group's progress goes to that of its first job. Results stand in the order of
// the jobs; those that a cancel has left out are missing at the end.
std::vector<JobResult> RunSharedBrdfJobs(std::span<const Job> jobs, size_t share,
                                         const std::function<JobObserver&(size_t)>& observer,
                                         const CancelToken& cancel);

}  // namespace patina
