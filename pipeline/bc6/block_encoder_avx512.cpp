#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>

#include "formats/bc6h.h"
#include "pipeline/bc6/block_kernels.h"

// Order matters from here on.
// clang-format off
#include "pipeline/kernels/begin_avx512.h"
#include "pipeline/kernels/simd16.h"
#include "pipeline/kernels/unroll.h"

#include "pipeline/bc6/block_problem.inl"
#include "pipeline/bc6/principal_lines.inl"
#include "pipeline/bc6/least_squares.inl"
#include "pipeline/bc6/palette_search.inl"
#include "pipeline/bc6/block_encoder.inl"
// clang-format on

namespace patina::bc6 {
const BlockKernels kBlockKernelsAvx512 = {&::patina::PATINA_SIMD::FitTexelsKernel,
                                          &::patina::PATINA_SIMD::EncodeKernel,
                                          &::patina::PATINA_SIMD::RefineKernel};
}  // namespace patina::bc6

#include "pipeline/kernels/end_target.h"
