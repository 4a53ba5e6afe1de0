// What the trainer is asked for by a job of kind "brdf".
#pragma once

#include <cstdint>

#include "pipeline/brdf/train_brdf.h"
#include "pipeline/jobs/job.h"
#include "pipeline/layered/simulated_source.h"

namespace patina {

// Raised whenever the same BRDF file, job and seed would give other bytes. Part of the fingerprint.
inline constexpr int kBrdfRecipeVersion = 3;

// Limits of Job::model; the least is 1 where none is named.
inline constexpr int kMaxJobNside = 256;
inline constexpr int kMaxJobPrimitiveSize = 64;
inline constexpr int kMaxJobIndexBits = 12;
inline constexpr int kMinJobHidden = 4;
inline constexpr int kMaxJobHidden = 256;
inline constexpr int kMaxJobHiddenLayers = 4;

const char* InterpolationName(Interpolation interpolation);  // as in job files and manifests

// Puts what a job says of the grid and the network in the place of what the shape has.
void OverrideModel(const JobModel& model, brdf::ModelShape* shape);

// The model's shape: the recipe's, with what the job says in its place.
brdf::ModelShape ModelOfJob(const Job& job, const brdf::SourceKind& kind);

// How exactly a layered material is simulated, by quality.
layered::Effort EffortOfJob(const Job& job);

// Steps by quality: fewer for preview, three times those of standard for reference.
brdf::TrainOptions TrainingOfJob(const Job& job, const brdf::SourceKind& kind);

}  // namespace patina
