// Begins a section compiled for AVX-512 (F, BW, DQ, VL). See simd16.h.
#include <immintrin.h>
#include <cstdint>
#define PATINA_SIMD simd_avx512
#define PATINA_SIMD_IS_AVX512 1
#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c,prefer-vector-width=512")
#endif
