// What each effect of a material brought, computed from the model that was trained.
#pragma once

#include <vector>

#include "formats/manifest.h"
#include "pipeline/jobs/job.h"
#include "pipeline/material/reference.h"
#include "pipeline/material/train.h"

namespace patina {

// Bytes of the feature textures' files.
uint64_t TextureBytes(const ModelShape& shape);

// The reference's effects with what they saved. model: null when every channel is constant.
//   bytes: rows of the network's last layer, levels of feature textures, that are not stored
//   decode_multiply_adds: of one lookup
//   train_samples: samples that were not drawn, by the quality's budget
//   train_multiply_adds: of the training, by the samples that were drawn: forward, and backward to
//     inputs and weights
std::vector<ManifestEffect> DescribeEffects(const Job& job, const SourceReference& reference,
                                            const TrainedMaterial* model);

}  // namespace patina
