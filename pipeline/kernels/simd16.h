// Sixteen float lanes, the same bits on AVX2 and AVX-512.
//
// A kernel is written once, in a file `name.inl`, inside `namespace patina::PATINA_SIMD { ... }`, and compiled twice, by
// `name_avx2.cpp` and `name_avx512.cpp`:
//
//     #include <...>                                 // every standard and project header the .inl needs, first
//     #include "pipeline/kernels/begin_avx512.h"     // switches the compiler's target, defines PATINA_SIMD
//     #include "pipeline/kernels/simd16.h"           // no include guard: once for each target
//     #include "name.inl"
//     #include "pipeline/kernels/end_target.h"
//
// Headers included before the switch are compiled for plain x86-64, so no AVX code can leak into shared inline functions.
// On AVX2 a vector is a pair of registers: lane l has the same history on both targets, every reduction keeps 16 partial
// sums, and ReduceSum folds them by one fixed tree. Why not Highway's own vectors: the Debian 12 version has no two-table
// lookup and no fixed 16-lane pair, and both are what makes the taps cheap and the bits equal.
//
// All operations are IEEE single precision, round to nearest; MulAdd is fused. NaN: Min(a,b) and Max(a,b) return b when
// either is NaN, as the instructions do.

namespace patina::PATINA_SIMD {

// A stage of a kernel: its own function, so that a profile names it.
#define PATINA_STAGE static __attribute__((noinline))

#if defined(PATINA_SIMD_IS_AVX512)

struct F16 { __m512 v; };
struct I16 { __m512i v; };
struct M16 { __mmask16 v; };

#define PATINA_INLINE static inline __attribute__((always_inline))

PATINA_INLINE F16 Load(const float* p) { return {_mm512_load_ps(p)}; }
PATINA_INLINE F16 LoadU(const float* p) { return {_mm512_loadu_ps(p)}; }
PATINA_INLINE void Store(float* p, F16 a) { _mm512_store_ps(p, a.v); }
PATINA_INLINE void StoreU(float* p, F16 a) { _mm512_storeu_ps(p, a.v); }
PATINA_INLINE F16 Set(float x) { return {_mm512_set1_ps(x)}; }
PATINA_INLINE F16 Zero() { return {_mm512_setzero_ps()}; }
PATINA_INLINE F16 operator+(F16 a, F16 b) { return {_mm512_add_ps(a.v, b.v)}; }
PATINA_INLINE F16 operator-(F16 a, F16 b) { return {_mm512_sub_ps(a.v, b.v)}; }
PATINA_INLINE F16 operator*(F16 a, F16 b) { return {_mm512_mul_ps(a.v, b.v)}; }
PATINA_INLINE F16 operator/(F16 a, F16 b) { return {_mm512_div_ps(a.v, b.v)}; }
PATINA_INLINE F16 MulAdd(F16 a, F16 b, F16 c) { return {_mm512_fmadd_ps(a.v, b.v, c.v)}; }      // a*b + c
PATINA_INLINE F16 NegMulAdd(F16 a, F16 b, F16 c) { return {_mm512_fnmadd_ps(a.v, b.v, c.v)}; }  // c - a*b
PATINA_INLINE F16 Sqrt(F16 a) { return {_mm512_sqrt_ps(a.v)}; }
PATINA_INLINE F16 Min(F16 a, F16 b) { return {_mm512_min_ps(a.v, b.v)}; }
PATINA_INLINE F16 Max(F16 a, F16 b) { return {_mm512_max_ps(a.v, b.v)}; }
PATINA_INLINE F16 Abs(F16 a) { return {_mm512_abs_ps(a.v)}; }
PATINA_INLINE M16 operator>(F16 a, F16 b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_GT_OQ)}; }
PATINA_INLINE M16 operator<(F16 a, F16 b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LT_OQ)}; }
PATINA_INLINE F16 Select(M16 m, F16 yes, F16 no) { return {_mm512_mask_blend_ps(m.v, no.v, yes.v)}; }
PATINA_INLINE F16 ZeroUnless(M16 m, F16 a) { return {_mm512_maskz_mov_ps(m.v, a.v)}; }
PATINA_INLINE unsigned Bits(M16 m) { return m.v; }
PATINA_INLINE M16 MaskOf(unsigned bits) { return {static_cast<__mmask16>(bits)}; }

PATINA_INLINE I16 LoadI(const int32_t* p) { return {_mm512_load_si512(p)}; }
PATINA_INLINE I16 LoadIU(const int32_t* p) { return {_mm512_loadu_si512(p)}; }
PATINA_INLINE void StoreI(int32_t* p, I16 a) { _mm512_store_si512(p, a.v); }
PATINA_INLINE I16 SetI(int32_t x) { return {_mm512_set1_epi32(x)}; }
PATINA_INLINE I16 operator+(I16 a, I16 b) { return {_mm512_add_epi32(a.v, b.v)}; }
PATINA_INLINE I16 operator-(I16 a, I16 b) { return {_mm512_sub_epi32(a.v, b.v)}; }
PATINA_INLINE I16 operator*(I16 a, I16 b) { return {_mm512_mullo_epi32(a.v, b.v)}; }
PATINA_INLINE I16 operator&(I16 a, I16 b) { return {_mm512_and_si512(a.v, b.v)}; }
template <int kBits> PATINA_INLINE I16 ShiftRight(I16 a) { return {_mm512_srai_epi32(a.v, kBits)}; }
template <int kBits> PATINA_INLINE I16 ShiftLeft(I16 a) { return {_mm512_slli_epi32(a.v, kBits)}; }
PATINA_INLINE I16 MinI(I16 a, I16 b) { return {_mm512_min_epi32(a.v, b.v)}; }
PATINA_INLINE I16 MaxI(I16 a, I16 b) { return {_mm512_max_epi32(a.v, b.v)}; }
PATINA_INLINE M16 EqualI(I16 a, I16 b) { return {_mm512_cmpeq_epi32_mask(a.v, b.v)}; }
PATINA_INLINE I16 SelectI(M16 m, I16 yes, I16 no) { return {_mm512_mask_blend_epi32(m.v, no.v, yes.v)}; }
PATINA_INLINE I16 RoundToInt(F16 a) { return {_mm512_cvtps_epi32(a.v)}; }     // to nearest, ties to even
PATINA_INLINE I16 TruncateToInt(F16 a) { return {_mm512_cvttps_epi32(a.v)}; }
PATINA_INLINE F16 ToFloat(I16 a) { return {_mm512_cvtepi32_ps(a.v)}; }
PATINA_INLINE F16 AsFloat(I16 a) { return {_mm512_castsi512_ps(a.v)}; }
PATINA_INLINE I16 AsInt(F16 a) { return {_mm512_castps_si512(a.v)}; }

// out[l] = table[index[l]], index in 0..15.
PATINA_INLINE F16 Lookup(F16 table, I16 index) { return {_mm512_permutexvar_ps(index.v, table.v)}; }
// out[l] = (lo, hi)[index[l]], index in 0..31.
PATINA_INLINE F16 Lookup2(F16 lo, F16 hi, I16 index) { return {_mm512_permutex2var_ps(lo.v, index.v, hi.v)}; }
// Sixteen halves <-> floats, round to nearest even.
PATINA_INLINE F16 LoadHalf(const uint16_t* p) { return {_mm512_cvtph_ps(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)))}; }
PATINA_INLINE void StoreHalf(uint16_t* p, F16 a) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), _mm512_cvtps_ph(a.v, 0)); }

// Sixteen halves, as bits in the lanes' low 16 bits, to floats.
PATINA_INLINE F16 HalfBitsToFloat(I16 a) { return {_mm512_cvtph_ps(_mm512_cvtepi32_epi16(a.v))}; }

// The low and high eight lanes, for ReduceSum.
PATINA_INLINE __m256 LowHalf(F16 a) { return _mm512_castps512_ps256(a.v); }
PATINA_INLINE __m256 HighHalf(F16 a) { return _mm256_castpd_ps(_mm512_extractf64x4_pd(_mm512_castps_pd(a.v), 1)); }

// Steps of ReduceSums: the halves of two vectors added, side by side; then quarters; then within quarters.
PATINA_INLINE F16 AddHalves(F16 a, F16 b) { return {_mm512_add_ps(_mm512_shuffle_f32x4(a.v, b.v, 0x44), _mm512_shuffle_f32x4(a.v, b.v, 0xEE))}; }
PATINA_INLINE F16 AddQuarters(F16 a, F16 b) { return {_mm512_add_ps(_mm512_shuffle_f32x4(a.v, b.v, 0x88), _mm512_shuffle_f32x4(a.v, b.v, 0xDD))}; }
template <int kEven, int kOdd> PATINA_INLINE F16 AddShuffled(F16 a, F16 b) { return {_mm512_add_ps(_mm512_shuffle_ps(a.v, b.v, kEven), _mm512_shuffle_ps(a.v, b.v, kOdd))}; }

#else  // AVX2 + FMA + F16C

struct F16 { __m256 lo, hi; };
struct I16 { __m256i lo, hi; };
struct M16 { __m256 lo, hi; };  // all bits of a lane set or clear

#define PATINA_INLINE static inline __attribute__((always_inline))

PATINA_INLINE F16 Load(const float* p) { return {_mm256_load_ps(p), _mm256_load_ps(p + 8)}; }
PATINA_INLINE F16 LoadU(const float* p) { return {_mm256_loadu_ps(p), _mm256_loadu_ps(p + 8)}; }
PATINA_INLINE void Store(float* p, F16 a) { _mm256_store_ps(p, a.lo); _mm256_store_ps(p + 8, a.hi); }
PATINA_INLINE void StoreU(float* p, F16 a) { _mm256_storeu_ps(p, a.lo); _mm256_storeu_ps(p + 8, a.hi); }
PATINA_INLINE F16 Set(float x) { const __m256 v = _mm256_set1_ps(x); return {v, v}; }
PATINA_INLINE F16 Zero() { return {_mm256_setzero_ps(), _mm256_setzero_ps()}; }
PATINA_INLINE F16 operator+(F16 a, F16 b) { return {_mm256_add_ps(a.lo, b.lo), _mm256_add_ps(a.hi, b.hi)}; }
PATINA_INLINE F16 operator-(F16 a, F16 b) { return {_mm256_sub_ps(a.lo, b.lo), _mm256_sub_ps(a.hi, b.hi)}; }
PATINA_INLINE F16 operator*(F16 a, F16 b) { return {_mm256_mul_ps(a.lo, b.lo), _mm256_mul_ps(a.hi, b.hi)}; }
PATINA_INLINE F16 operator/(F16 a, F16 b) { return {_mm256_div_ps(a.lo, b.lo), _mm256_div_ps(a.hi, b.hi)}; }
PATINA_INLINE F16 MulAdd(F16 a, F16 b, F16 c) { return {_mm256_fmadd_ps(a.lo, b.lo, c.lo), _mm256_fmadd_ps(a.hi, b.hi, c.hi)}; }
PATINA_INLINE F16 NegMulAdd(F16 a, F16 b, F16 c) { return {_mm256_fnmadd_ps(a.lo, b.lo, c.lo), _mm256_fnmadd_ps(a.hi, b.hi, c.hi)}; }
PATINA_INLINE F16 Sqrt(F16 a) { return {_mm256_sqrt_ps(a.lo), _mm256_sqrt_ps(a.hi)}; }
PATINA_INLINE F16 Min(F16 a, F16 b) { return {_mm256_min_ps(a.lo, b.lo), _mm256_min_ps(a.hi, b.hi)}; }
PATINA_INLINE F16 Max(F16 a, F16 b) { return {_mm256_max_ps(a.lo, b.lo), _mm256_max_ps(a.hi, b.hi)}; }
PATINA_INLINE F16 Abs(F16 a) { const __m256 s = _mm256_set1_ps(-0.0f); return {_mm256_andnot_ps(s, a.lo), _mm256_andnot_ps(s, a.hi)}; }
PATINA_INLINE M16 operator>(F16 a, F16 b) { return {_mm256_cmp_ps(a.lo, b.lo, _CMP_GT_OQ), _mm256_cmp_ps(a.hi, b.hi, _CMP_GT_OQ)}; }
PATINA_INLINE M16 operator<(F16 a, F16 b) { return {_mm256_cmp_ps(a.lo, b.lo, _CMP_LT_OQ), _mm256_cmp_ps(a.hi, b.hi, _CMP_LT_OQ)}; }
PATINA_INLINE F16 Select(M16 m, F16 yes, F16 no) { return {_mm256_blendv_ps(no.lo, yes.lo, m.lo), _mm256_blendv_ps(no.hi, yes.hi, m.hi)}; }
PATINA_INLINE F16 ZeroUnless(M16 m, F16 a) { return {_mm256_and_ps(m.lo, a.lo), _mm256_and_ps(m.hi, a.hi)}; }
PATINA_INLINE unsigned Bits(M16 m) { return static_cast<unsigned>(_mm256_movemask_ps(m.lo)) | (static_cast<unsigned>(_mm256_movemask_ps(m.hi)) << 8); }
PATINA_INLINE M16 MaskOf(unsigned bits) {
  const __m256i sel = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
  const __m256i lo = _mm256_and_si256(_mm256_set1_epi32(static_cast<int>(bits & 255)), sel);
  const __m256i hi = _mm256_and_si256(_mm256_set1_epi32(static_cast<int>((bits >> 8) & 255)), sel);
  return {_mm256_castsi256_ps(_mm256_cmpeq_epi32(lo, sel)), _mm256_castsi256_ps(_mm256_cmpeq_epi32(hi, sel))};
}

PATINA_INLINE I16 LoadI(const int32_t* p) { return {_mm256_load_si256(reinterpret_cast<const __m256i*>(p)), _mm256_load_si256(reinterpret_cast<const __m256i*>(p + 8))}; }
PATINA_INLINE I16 LoadIU(const int32_t* p) { return {_mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)), _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p + 8))}; }
PATINA_INLINE void StoreI(int32_t* p, I16 a) { _mm256_store_si256(reinterpret_cast<__m256i*>(p), a.lo); _mm256_store_si256(reinterpret_cast<__m256i*>(p + 8), a.hi); }
PATINA_INLINE I16 SetI(int32_t x) { const __m256i v = _mm256_set1_epi32(x); return {v, v}; }
PATINA_INLINE I16 operator+(I16 a, I16 b) { return {_mm256_add_epi32(a.lo, b.lo), _mm256_add_epi32(a.hi, b.hi)}; }
PATINA_INLINE I16 operator-(I16 a, I16 b) { return {_mm256_sub_epi32(a.lo, b.lo), _mm256_sub_epi32(a.hi, b.hi)}; }
PATINA_INLINE I16 operator*(I16 a, I16 b) { return {_mm256_mullo_epi32(a.lo, b.lo), _mm256_mullo_epi32(a.hi, b.hi)}; }
PATINA_INLINE I16 operator&(I16 a, I16 b) { return {_mm256_and_si256(a.lo, b.lo), _mm256_and_si256(a.hi, b.hi)}; }
template <int kBits> PATINA_INLINE I16 ShiftRight(I16 a) { return {_mm256_srai_epi32(a.lo, kBits), _mm256_srai_epi32(a.hi, kBits)}; }
template <int kBits> PATINA_INLINE I16 ShiftLeft(I16 a) { return {_mm256_slli_epi32(a.lo, kBits), _mm256_slli_epi32(a.hi, kBits)}; }
PATINA_INLINE I16 MinI(I16 a, I16 b) { return {_mm256_min_epi32(a.lo, b.lo), _mm256_min_epi32(a.hi, b.hi)}; }
PATINA_INLINE I16 MaxI(I16 a, I16 b) { return {_mm256_max_epi32(a.lo, b.lo), _mm256_max_epi32(a.hi, b.hi)}; }
PATINA_INLINE M16 EqualI(I16 a, I16 b) { return {_mm256_castsi256_ps(_mm256_cmpeq_epi32(a.lo, b.lo)), _mm256_castsi256_ps(_mm256_cmpeq_epi32(a.hi, b.hi))}; }
PATINA_INLINE I16 SelectI(M16 m, I16 yes, I16 no) {
  return {_mm256_blendv_epi8(no.lo, yes.lo, _mm256_castps_si256(m.lo)), _mm256_blendv_epi8(no.hi, yes.hi, _mm256_castps_si256(m.hi))};
}
PATINA_INLINE I16 RoundToInt(F16 a) { return {_mm256_cvtps_epi32(a.lo), _mm256_cvtps_epi32(a.hi)}; }
PATINA_INLINE I16 TruncateToInt(F16 a) { return {_mm256_cvttps_epi32(a.lo), _mm256_cvttps_epi32(a.hi)}; }
PATINA_INLINE F16 ToFloat(I16 a) { return {_mm256_cvtepi32_ps(a.lo), _mm256_cvtepi32_ps(a.hi)}; }
PATINA_INLINE F16 AsFloat(I16 a) { return {_mm256_castsi256_ps(a.lo), _mm256_castsi256_ps(a.hi)}; }
PATINA_INLINE I16 AsInt(F16 a) { return {_mm256_castps_si256(a.lo), _mm256_castps_si256(a.hi)}; }

// Eight lanes of a 16-entry table: two permutes and a blend on index bit 3 (moved to the sign).
PATINA_INLINE __m256 LookupHalf(F16 table, __m256i index) {
  const __m256 a = _mm256_permutevar8x32_ps(table.lo, index);
  const __m256 b = _mm256_permutevar8x32_ps(table.hi, index);
  return _mm256_blendv_ps(a, b, _mm256_castsi256_ps(_mm256_slli_epi32(index, 28)));
}
PATINA_INLINE F16 Lookup(F16 table, I16 index) { return {LookupHalf(table, index.lo), LookupHalf(table, index.hi)}; }
PATINA_INLINE F16 Lookup2(F16 lo, F16 hi, I16 index) {
  const F16 a = Lookup(lo, index), b = Lookup(hi, index);
  return {_mm256_blendv_ps(a.lo, b.lo, _mm256_castsi256_ps(_mm256_slli_epi32(index.lo, 27))),
          _mm256_blendv_ps(a.hi, b.hi, _mm256_castsi256_ps(_mm256_slli_epi32(index.hi, 27)))};
}
PATINA_INLINE F16 LoadHalf(const uint16_t* p) {
  return {_mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(p))),
          _mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(p + 8)))};
}
PATINA_INLINE void StoreHalf(uint16_t* p, F16 a) {
  _mm_storeu_si128(reinterpret_cast<__m128i*>(p), _mm256_cvtps_ph(a.lo, 0));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(p + 8), _mm256_cvtps_ph(a.hi, 0));
}
PATINA_INLINE F16 HalfBitsToFloat(I16 a) {
  const __m256i packed = _mm256_permute4x64_epi64(_mm256_packus_epi32(a.lo, a.hi), 0xD8);
  return {_mm256_cvtph_ps(_mm256_castsi256_si128(packed)), _mm256_cvtph_ps(_mm256_extracti128_si256(packed, 1))};
}
PATINA_INLINE __m256 LowHalf(F16 a) { return a.lo; }
PATINA_INLINE __m256 HighHalf(F16 a) { return a.hi; }

PATINA_INLINE F16 AddHalves(F16 a, F16 b) { return {_mm256_add_ps(a.lo, a.hi), _mm256_add_ps(b.lo, b.hi)}; }
PATINA_INLINE __m256 AddQuartersOf(F16 a) { return _mm256_add_ps(_mm256_permute2f128_ps(a.lo, a.hi, 0x20), _mm256_permute2f128_ps(a.lo, a.hi, 0x31)); }
PATINA_INLINE F16 AddQuarters(F16 a, F16 b) { return {AddQuartersOf(a), AddQuartersOf(b)}; }
template <int kEven, int kOdd> PATINA_INLINE F16 AddShuffled(F16 a, F16 b) {
  return {_mm256_add_ps(_mm256_shuffle_ps(a.lo, b.lo, kEven), _mm256_shuffle_ps(a.lo, b.lo, kOdd)),
          _mm256_add_ps(_mm256_shuffle_ps(a.hi, b.hi, kEven), _mm256_shuffle_ps(a.hi, b.hi, kOdd))};
}

#endif

// The sum of the lanes by a fixed tree: l + (l+8), then +4, +2, +1.
PATINA_INLINE float ReduceSum(F16 a) {
  const __m256 eight = _mm256_add_ps(LowHalf(a), HighHalf(a));
  const __m128 four = _mm_add_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps(eight, 1));
  const __m128 two = _mm_add_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_add_ss(two, _mm_shuffle_ps(two, two, 1)));
}

// Lane i of the result is ReduceSum(v[i]), bit for bit; 45 operations for the sixteen.
PATINA_INLINE F16 ReduceSums(const F16 v[16]) {
  F16 quarter[4];
  for (int i = 0; i < 4; ++i) quarter[i] = AddQuarters(AddHalves(v[i], v[i + 4]), AddHalves(v[i + 8], v[i + 12]));
  return AddShuffled<0x88, 0xDD>(AddShuffled<0x44, 0xEE>(quarter[0], quarter[1]), AddShuffled<0x44, 0xEE>(quarter[2], quarter[3]));
}

// The largest lane; lanes must not be NaN.
PATINA_INLINE float ReduceMax(F16 a) {
  const __m256 eight = _mm256_max_ps(LowHalf(a), HighHalf(a));
  const __m128 four = _mm_max_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps(eight, 1));
  const __m128 two = _mm_max_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_max_ss(two, _mm_shuffle_ps(two, two, 1)));
}

}  // namespace patina::PATINA_SIMD
