// Training a material and looking at what an engine would decode of it.
#pragma once

#include <vector>

#include "pipeline/material/train.h"

namespace patina::test {

// Trains with `samples`, seed 1 and profile bcf-1k on any number of threads; an error fails the
// test.
TrainedMaterial MustTrain(const MaterialReference& reference, const TrainOptions& options,
                          int threads);

bool SameModel(const TrainedMaterial& a, const TrainedMaterial& b);

// Mip 0 from the files of a container, by the decoder that engines copy: [channel][y * width + x],
// coded and not clamped to the channel's range. Fails the test where the files are refused or a
// value is not finite.
std::vector<std::vector<float>> DecodeMip0(const TrainedMaterial& model,
                                           const MaterialReference& reference);

}  // namespace patina::test
