// From wanted texel values to legal BC6H blocks: the first fit of the trainer's blocks, and the
// sensitivity-weighted re-encode.
//
// "Binades" below: a half's bits as a number, divided by 1024: 15.0 is the value 1.0, 16.0 is 2.0,
// and between two integers the value is linear in it. A BC6H segment is a straight line in this
// scale. All values are positive (UF16).
//
// All functions are pure, thread-safe and free of allocation, and give the same bits on AVX2 and
// AVX-512. The CPU must have one of the SIMD targets of pipeline/kernels/dispatch.h: a program asks
// ActiveSimdTarget() before it starts.
#pragma once

#include <cstdint>

#include "formats/bc6h.h"

namespace patina::bc6 {

// A block as the trainer sees it: two segments and a position on them for each texel. Texel t of
// region r (r from bc6h::PartitionMask(partition)) has, per channel, endpoint[2r] + index[t] *
// (endpoint[2r+1] - endpoint[2r]) binades.
struct SoftBlock {
  float endpoint[4][3] = {};  // binades, within [1, 30.9]
  float index[16] = {};       // 0..1
  int partition = 0;          // 0..31
};

// Wanted values of a block, and how much a deviation costs: error = sum over texels of d^T H d with
// d = decoded - value. Linear feature values (not binades), planar: [channel][texel]. Values are
// clamped to [0, 65504]; a texel with a value or a Hessian entry that is not finite costs nothing.
// Hessians may be of any scale and rank. Texels whose Hessian is zero, or all texels where all are
// zero, still come to lie near their value, as far as that costs the others nothing.
struct WeightedTarget {
  alignas(64) float value[3][16];
  alignas(64) float hessian[6][16];  // xx, xy, xz, yy, yz, zz; positive semidefinite for each texel
};

enum class Effort {
  kQuick,  // half the time: one candidate descends to the end
  kFull,
};

struct EncodedBlock {
  bc6h::BlockFields fields;  // what the bytes say
  bc6h::Block bytes = {};    // legal, decodable by anything
  // The same as a starting point for further training, clamped to a soft block's ranges. One-region
  // blocks: both segments equal, with the partition that suits the target best for two regions.
  SoftBlock soft;
  float error = 0;  // exact: with the values that a decoder gives
};

// The first fit: for each of the 32 partitions a principal line per region in binades; the best by
// squared distance. texels: [channel][texel], linear values, clamped to [2^-14, 60000].
// Deterministic; never fails.
SoftBlock FitTexels(const float texels[3][16]);

// Encodes a block: candidates are current's partition with its endpoints, the best of 32 partitions
// by line-fit residual of the target whitened by the block's mean Hessian, and one region, each in
// every mode that can hold it; indices by exhaustive palette search under the anchor rule,
// endpoints refined by weighted least squares and by steps of up to three codes. The result is
// never worse, in `error`, than current rounded into its best mode. Endpoints and partition of
// `current` are clamped to their ranges; its indices are not used.
EncodedBlock Encode(const WeightedTarget& target, const SoftBlock& current,
                    Effort effort = Effort::kFull);

// As Encode, keeping mode and partition of `current`: new endpoints and indices only. Never worse
// than `current`, which must be legal (as unpacked or encoded).
EncodedBlock Refine(const WeightedTarget& target, const bc6h::BlockFields& current);

// Linear values of a legal block, [channel][texel], exactly as a decoder gives them.
void DecodeToFloat(const bc6h::BlockFields& fields, float out[3][16]);

}  // namespace patina::bc6
