// Jobs of kind "brdf": from a measured BRDF to a published container.
#pragma once

#include <string>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/brdf/train_brdf.h"
#include "pipeline/jobs/brdf_package.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/run_guards.h"

namespace patina {

// A BRDF that was read and trained together with others.
struct TrainedInGroup {
  BrdfSource source;
  brdf::TrainedBrdf model;
  SharedCodebook codebook;
  std::vector<std::string> group;  // SHA-256 of the files of all of them, in their order
};

// Stages: ingest (read and check the file), train, package (write grid, weights and sampler),
// verify (decode the written bytes and measure them), report, publish. trained: what takes the
// place of reading and training, and is used up; null for none.
JobResult RunBrdfJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                     const RunGuards& guards, TrainedInGroup* trained = nullptr);

}  // namespace patina
