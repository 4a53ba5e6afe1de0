// --against: the recorded quality of containers against what their files amount to.
#pragma once

#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/job.h"
#include "pipeline/validate/findings.h"
#include "pipeline/validate/targets.h"

namespace patina::validate {

// How far a PSNR measured again may be from the recorded one. The same bytes, source and arithmetic
// give the same number; what was baked with a job whose settings are not known (tolerances of
// constants, Toksvig) gives a slightly different one.
inline constexpr double kPsnrBoundDb = 0.1;
// The same of the errors of a BRDF, as a share of the recorded one.
inline constexpr double kBrdfErrorBound = 0.01;

// Measures a container (archives are a finding, other targets nothing). `source`: a job, or a
// folder, or a BRDF's file; of a folder that has one of the asset's name, that one. Also compares
// the hashes of the inputs.
void Remeasure(const Target& target, const Job& source, ThreadPool& pool, const CancelToken& cancel,
               ProgressSink& progress, FindingList* findings);

}  // namespace patina::validate
