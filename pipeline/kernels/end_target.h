// Ends a section begun by begin_avx2.h or begin_avx512.h.
#ifdef __clang__
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#undef PATINA_SIMD
#undef PATINA_SIMD_IS_AVX512
#undef PATINA_INLINE
#undef PATINA_STAGE
#undef PATINA_LAMBDA
