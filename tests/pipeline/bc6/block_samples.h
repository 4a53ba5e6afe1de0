// Blocks as the exporter meets them, made from a seed: three correlated channels around 1.0 with
// gradients, noise and edges, and Hessians from Jacobians of nine outputs whose sizes differ.
#pragma once

#include <cstdint>

#include "pipeline/bc6/block_encoder.h"

namespace patina::bc6 {

struct BlockSample {
  float texels[3][16];    // what unconstrained features would be, linear
  SoftBlock current;      // a trainer's block: the two-segment fit of the texels
  WeightedTarget target;  // the texels, with a mean Hessian trace of 1
};

BlockSample MakeBlockSample(uint64_t seed);

// The linear values of a soft block, by the trainer's float arithmetic.
void SoftValues(const SoftBlock& block, float out[3][16]);

// sum over texels of (values - target)^T H (values - target), in double.
double WeightedError(const WeightedTarget& target, const float values[3][16]);

// The least WeightedError of the fields' mode, partition and endpoints over all legal indices, with
// either end of region 0 as the first; by plain search over decoded values. Infinite where no order
// of the endpoints is legal.
double LeastErrorOverIndices(const WeightedTarget& target, const bc6h::BlockFields& fields);

// The soft block rounded to the codes of one mode, indices to their nearest; false where the mode
// cannot hold it.
bool RoundSoftBlock(const SoftBlock& block, int mode, bc6h::BlockFields* fields);

}  // namespace patina::bc6
