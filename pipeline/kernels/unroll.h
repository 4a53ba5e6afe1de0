// Compile-time loops for kernels: g++ 12 spills arrays of vectors in loops that it unrolls itself, not in these.
// Included inside a target section, after simd16.h; no include guard.

namespace patina::PATINA_SIMD {

template <class Body, int... kIndex>
PATINA_INLINE void UnrollIndices(Body&& body, std::integer_sequence<int, kIndex...>) {
  (body(std::integral_constant<int, kIndex>{}), ...);
}

// Calls body(std::integral_constant<int, k>) for k = 0 .. kCount-1.
template <int kCount, class Body>
PATINA_INLINE void Unroll(Body&& body) {
  UnrollIndices(body, std::make_integer_sequence<int, kCount>{});
}

#define PATINA_LAMBDA __attribute__((always_inline))

// Hides where a pointer comes from, so that the compiler does not hoist every broadcast from it out of a loop.
template <class T>
PATINA_INLINE T* Opaque(T* p) {
  asm volatile("" : "+r"(p));
  return p;
}

}  // namespace patina::PATINA_SIMD
