// Where training starts: features and network from principal components, or at random as in the paper.
#pragma once

#include "pipeline/base/rng.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/material/channel_stats.h"
#include "pipeline/material/feature_store.h"
#include "pipeline/material/network.h"

namespace patina {

// Principal components: texture 0 carries z_0..z_2, texture 1 z_3..z_5, texture 2 z_6..z_8, texture 3 z_0..z_2 again, each
// level from the mip of its own size, as w = 1 + z/4 (positive, so that unsigned BC6H holds it). Blocks are fitted directly.
void InitFeaturesFromComponents(const MaterialReference& reference, const ModelShape& shape, const ChannelStats& stats,
                                ThreadPool& pool, FeatureStore* store);

// A network that passes the twelve inputs through the ReLU's linear range and decodes the components; four hidden units and
// the second copy of z_0..z_2 start without influence, at random.
void InitNetworkFromComponents(const ChannelStats& stats, std::span<const float> scale, Rng* rng, Network* network);

// Weinreich 2024: features at random (uniform in [0, 1)), the network as PyTorch initialises linear layers.
void InitFeaturesAtRandom(Rng* rng, FeatureStore* store);
void InitNetworkAtRandom(Rng* rng, Network* network);

// Blocks fitted to the texels of a free store (Weinreich 2024, section 5.1).
void InitBlocksFromFreeTexels(const FeatureStore& free_store, ThreadPool& pool, FeatureStore* store);

}  // namespace patina
