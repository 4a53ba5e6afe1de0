// Begins a section compiled for AVX2 + FMA + F16C. See simd16.h.
#include <immintrin.h>
#include <cstdint>
#define PATINA_SIMD simd_avx2
#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx2,fma,f16c"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma,f16c")
#endif
