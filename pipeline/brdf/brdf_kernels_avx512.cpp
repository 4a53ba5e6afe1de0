// BRDF kernels for avx512; see pipeline/kernels/simd16.h for the scheme.
#include <cstddef>
#include <cstdint>
#include <utility>

#include "pipeline/brdf/brdf_kernels.h"

// clang-format off: the order is the scheme
#include "pipeline/kernels/begin_avx512.h"
#include "pipeline/kernels/simd16.h"
#include "pipeline/kernels/unroll.h"
#include "pipeline/kernels/math16.inl"
#include "pipeline/brdf/row_product.inl"
#include "pipeline/brdf/pair_lookup.inl"
#include "pipeline/brdf/brdf_kernels.inl"
#include "pipeline/kernels/end_target.h"
