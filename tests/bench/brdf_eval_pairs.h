// The pairs of directions that the peers are fitted to: those that our trainer draws.
#pragma once

#include <vector>

#include "formats/brdf/brdf_source.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/sample_pool.h"

namespace patina::bench {

struct TrainingPair {
  brdf::Direction wi, wo;
  float value[3];    // f, 1/sr
  float cosine;      // of the direction that is nearer to the normal
  float importance;  // factor of the loss
};

// The same pairs, in the same order, as brdf::DrawPool looks up for the same options, without those
// that have no valid data. The same for any number of threads; empty if all is invalid.
std::vector<TrainingPair> DrawTrainingPairs(const brdf::Source& source,
                                            const brdf::PoolOptions& options, ThreadPool& pool);

}  // namespace patina::bench
