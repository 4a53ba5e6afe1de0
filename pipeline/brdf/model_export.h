// From what was trained to what is written: index packs and the network in half precision.
#pragma once

#include <span>
#include <vector>

#include "formats/base/result.h"
#include "formats/index_pack.h"
#include "formats/weights.h"
#include "pipeline/brdf/grid_trainer.h"
#include "pipeline/brdf/train_brdf.h"

namespace patina::brdf {

// How many codes a model has: a sixteenth of the indices stays free, as rare codes bring least.
int CodesOf(const ModelShape& shape);

// Weights as halves, in the order of decoders' inputs: features of wi, of wo, the scalars, the
// neural texture; padding goes. Errors: kOutOfRange (beyond halves).
Result<WeightBuffer> ExportNetwork(const NetworkLayout& layout, const float* parameters);

// The packs of `materials` materials that were trained on one codebook, each with a copy of it.
// Corners without usage (one number for each of trainer's) are not stored; codes that nobody uses
// are dropped.
std::vector<IndexPack> ExportPacks(const ModelShape& shape, int materials,
                                   std::span<const float> usage, GridTrainer* trainer);

}  // namespace patina::brdf
