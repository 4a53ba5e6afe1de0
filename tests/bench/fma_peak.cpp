#include "tests/bench/fma_peak.h"

#include <immintrin.h>

namespace patina {

__attribute__((target("avx2,fma"))) double FmaLoopAvx2(long iterations) {
  __m256 a = _mm256_set1_ps(1), b = a, c = a, d = a, e = a, f = a, g = a, h = a, i = a, j = a,
         k = a, l = a;
  const __m256 x = _mm256_set1_ps(0.999f), y = _mm256_set1_ps(1e-3f);
  for (long n = 0; n < iterations; ++n) {
    // Opaque values: the chains may not be merged.
    asm volatile(""
                 : "+x"(a), "+x"(b), "+x"(c), "+x"(d), "+x"(e), "+x"(f), "+x"(g), "+x"(h), "+x"(i),
                   "+x"(j), "+x"(k), "+x"(l));
    a = _mm256_fmadd_ps(a, x, y);
    b = _mm256_fmadd_ps(b, x, y);
    c = _mm256_fmadd_ps(c, x, y);
    d = _mm256_fmadd_ps(d, x, y);
    e = _mm256_fmadd_ps(e, x, y);
    f = _mm256_fmadd_ps(f, x, y);
    g = _mm256_fmadd_ps(g, x, y);
    h = _mm256_fmadd_ps(h, x, y);
    i = _mm256_fmadd_ps(i, x, y);
    j = _mm256_fmadd_ps(j, x, y);
    k = _mm256_fmadd_ps(k, x, y);
    l = _mm256_fmadd_ps(l, x, y);
  }
  const __m256 s = _mm256_add_ps(
      _mm256_add_ps(_mm256_add_ps(a, b), _mm256_add_ps(c, d)),
      _mm256_add_ps(_mm256_add_ps(e, f),
                    _mm256_add_ps(_mm256_add_ps(g, h),
                                  _mm256_add_ps(_mm256_add_ps(i, j), _mm256_add_ps(k, l)))));
  return _mm256_cvtss_f32(s);
}

__attribute__((target("avx512f"))) double FmaLoopAvx512(long iterations) {
  __m512 a = _mm512_set1_ps(1), b = a, c = a, d = a, e = a, f = a, g = a, h = a, i = a, j = a,
         k = a, l = a;
  const __m512 x = _mm512_set1_ps(0.999f), y = _mm512_set1_ps(1e-3f);
  for (long n = 0; n < iterations; ++n) {
    asm volatile(""
                 : "+v"(a), "+v"(b), "+v"(c), "+v"(d), "+v"(e), "+v"(f), "+v"(g), "+v"(h), "+v"(i),
                   "+v"(j), "+v"(k), "+v"(l));
    a = _mm512_fmadd_ps(a, x, y);
    b = _mm512_fmadd_ps(b, x, y);
    c = _mm512_fmadd_ps(c, x, y);
    d = _mm512_fmadd_ps(d, x, y);
    e = _mm512_fmadd_ps(e, x, y);
    f = _mm512_fmadd_ps(f, x, y);
    g = _mm512_fmadd_ps(g, x, y);
    h = _mm512_fmadd_ps(h, x, y);
    i = _mm512_fmadd_ps(i, x, y);
    j = _mm512_fmadd_ps(j, x, y);
    k = _mm512_fmadd_ps(k, x, y);
    l = _mm512_fmadd_ps(l, x, y);
  }
  const __m512 s = _mm512_add_ps(
      _mm512_add_ps(_mm512_add_ps(a, b), _mm512_add_ps(c, d)),
      _mm512_add_ps(_mm512_add_ps(e, f),
                    _mm512_add_ps(_mm512_add_ps(g, h),
                                  _mm512_add_ps(_mm512_add_ps(i, j), _mm512_add_ps(k, l)))));
  return _mm512_cvtss_f32(s);
}

}  // namespace patina
