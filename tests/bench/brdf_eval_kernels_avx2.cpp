// Kernels of the peers for avx2; see pipeline/kernels/simd16.h for the scheme.
#include <cstddef>
#include <cstdint>
#include <utility>

#include "tests/bench/brdf_eval_kernels.h"

// The order is the scheme.
// clang-format off
#include "pipeline/kernels/begin_avx2.h"
#include "pipeline/kernels/simd16.h"
#include "pipeline/kernels/unroll.h"
#include "pipeline/kernels/math16.inl"
#include "tests/bench/brdf_eval_kernels.inl"
#include "pipeline/kernels/end_target.h"
