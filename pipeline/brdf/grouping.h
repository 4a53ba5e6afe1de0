// Which materials share a codebook.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

// Groups of at most `most` sources that look alike, each of the same kind (KindOf; lists stand
// alone); every source is in one group. Looks are log(1 + f) over a fixed set of half and
// difference angles. Greedy: the source that is farthest from all others takes its nearest ones,
// and so on. The order of members is that of the sources.
//
// Differs from NeuBRDF, section 3.3 (bottleneck of an autoencoder, k-means): the descriptor needs
// no training, and groups have a size that can be asked for.
std::vector<std::vector<size_t>> GroupAlike(std::span<const Source* const> sources, size_t most);

}  // namespace patina::brdf
