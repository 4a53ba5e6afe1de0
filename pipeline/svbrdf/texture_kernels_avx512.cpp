// Texture kernels for avx512; see pipeline/kernels/simd16.h for the scheme.
#include <cstddef>
#include <cstdint>
#include <utility>

#include "pipeline/material/partition_masks.h"
#include "pipeline/svbrdf/texture_kernels.h"

// clang-format off: the order is the scheme
#include "pipeline/kernels/begin_avx512.h"
#include "pipeline/kernels/simd16.h"
#include "pipeline/kernels/unroll.h"
#include "pipeline/material/block_kernels.inl"
#include "pipeline/svbrdf/texture_kernels.inl"
#include "pipeline/kernels/end_target.h"
