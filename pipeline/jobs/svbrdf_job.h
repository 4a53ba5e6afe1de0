// What the trainer is asked for by a job of kind "svbrdf".
#pragma once

#include <cstdint>

#include "pipeline/jobs/job.h"
#include "pipeline/layered/simulated_source.h"
#include "pipeline/svbrdf/modelled_source.h"
#include "pipeline/svbrdf/train_svbrdf.h"

namespace patina {

// Raised whenever the same source, job and seed would give other bytes. Part of the fingerprint.
inline constexpr int kSvbrdfRecipeVersion = 2;

// The model's shape for a source of this size: the recipe's, with what the job says in its place.
// isotropic: as VaryingSource::isotropic.
svbrdf::SvbrdfShape SvbrdfModelOfJob(const Job& job, int width, int height, AddressMode address,
                                     bool isotropic);

// What the neural texture is stored as: BC6H unless the job says otherwise.
svbrdf::TextureForm TextureFormOfJob(const Job& job);

// How a model with maps is sampled, by quality. exact, outlook: as TexelModel::exact and LookAhead
// say.
svbrdf::ModelledOptions SvbrdfSamplingOfJob(const Job& job, bool exact,
                                            const layered::Outlook& outlook);

// Steps by quality: a quarter for preview, three times those of standard for reference. Smaller
// ones for few measurements (texels times images, or pairs that it is measured at).
svbrdf::SvbrdfOptions SvbrdfTrainingOfJob(const Job& job, uint64_t measurements);

}  // namespace patina
