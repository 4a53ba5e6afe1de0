// What the trainer is asked for by a job of kind "svbrdf".
#pragma once

#include <cstdint>

#include "pipeline/jobs/job.h"
#include "pipeline/svbrdf/train_svbrdf.h"

namespace patina {

// Raised whenever the same image set, job and seed would give other bytes. Part of the fingerprint.
inline constexpr int kSvbrdfRecipeVersion = 1;

// The model's shape for images of this size: the recipe's, with what the job says in its place.
svbrdf::SvbrdfShape SvbrdfModelOfJob(const Job& job, int width, int height, AddressMode address);

// Steps by quality: a quarter for preview, three times those of standard for reference. Smaller ones
// for few measurements (texels of all images together).
svbrdf::SvbrdfOptions SvbrdfTrainingOfJob(const Job& job, uint64_t measurements);

}  // namespace patina
