// Feature blocks in SIMD: decoding to texels, gradients by their parameters, Adam. See window_kernels.h.
// Based on: Weinreich 2024, Eq. 6-9. A block's 16 texels are the 16 lanes.
//
// Differs from Eq. 7-9: endpoints are kept in binades (Eq. 9's y / 1024), where the re-interpretation as a half is a
// shift of the float's exponent field: value bits = round(binades * 2^23) + (112 << 23). Binades stay >= 1 (normal halves).

namespace patina::PATINA_SIMD {

inline constexpr int32_t kHalfToFloatBias = 112 << 23;

PATINA_INLINE F16 ValueOfBinades(F16 binades) {
  return AsFloat(RoundToInt(binades * Set(8388608.0f)) + SetI(kHalfToFloatBias));
}

// d value / d binades: the power of two of the value's binade.
PATINA_INLINE F16 SlopeOfValue(F16 value) { return AsFloat(AsInt(value) & SetI(0x7f800000)); }

struct SegmentTexels {
  F16 start[3];  // endpoint of the texel's region at index 0
  F16 span[3];   // difference to the one at index 1
};

PATINA_INLINE SegmentTexels ExpandSegments(const float* params, M16 second_region) {
  SegmentTexels s;
  Unroll<3>([&](auto c) PATINA_LAMBDA {
    s.start[c] = Select(second_region, Set(params[6 + c]), Set(params[c]));
    s.span[c] = Select(second_region, Set(params[9 + c]), Set(params[3 + c])) - s.start[c];
  });
  return s;
}

template <BlockForm kForm>
PATINA_INLINE void DecodeTexels(const float* params, unsigned partition_mask, F16 value[3]) {
  if constexpr (kForm == BlockForm::kSegments) {
    const SegmentTexels s = ExpandSegments(params, MaskOf(partition_mask));
    const F16 index = Load(params + 16);
    Unroll<3>([&](auto c) PATINA_LAMBDA { value[c] = ValueOfBinades(MulAdd(index, s.span[c], s.start[c])); });
  } else {
    Unroll<3>([&](auto c) PATINA_LAMBDA { value[c] = Load(params + c * 16); });
  }
}

// Sums of 12 vectors into lanes 0..11 of the result, each by the tree of ReduceSum; lanes 12..15 are zero.
#if defined(PATINA_SIMD_IS_AVX512)
PATINA_INLINE F16 SumTwelve(const F16 v[12]) {
  __m512 half[8], quarter[4], eighth[2];
  Unroll<8>([&](auto k) PATINA_LAMBDA {
    if constexpr (k < 6) {
      half[k] = _mm512_add_ps(_mm512_shuffle_f32x4(v[2 * k].v, v[2 * k + 1].v, 0x44),
                              _mm512_shuffle_f32x4(v[2 * k].v, v[2 * k + 1].v, 0xEE));
    } else {
      half[k] = _mm512_setzero_ps();
    }
  });
  Unroll<4>([&](auto k) PATINA_LAMBDA {
    quarter[k] = _mm512_add_ps(_mm512_shuffle_f32x4(half[2 * k], half[2 * k + 1], 0x88),
                               _mm512_shuffle_f32x4(half[2 * k], half[2 * k + 1], 0xDD));
  });
  Unroll<2>([&](auto k) PATINA_LAMBDA {
    const __m512d a = _mm512_castps_pd(quarter[2 * k]), b = _mm512_castps_pd(quarter[2 * k + 1]);
    eighth[k] = _mm512_add_ps(_mm512_castpd_ps(_mm512_unpacklo_pd(a, b)), _mm512_castpd_ps(_mm512_unpackhi_pd(a, b)));
  });
  const __m512 sum = _mm512_add_ps(_mm512_shuffle_ps(eighth[0], eighth[1], 0x88), _mm512_shuffle_ps(eighth[0], eighth[1], 0xDD));
  // 128-bit lane p holds the sums of vectors p, 4+p, 8+p, 12+p.
  return {_mm512_permutexvar_ps(_mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15), sum)};
}
#else
PATINA_INLINE F16 SumTwelve(const F16 v[12]) {
  alignas(32) float out[16] = {};
  Unroll<3>([&](auto k) PATINA_LAMBDA {
    __m128 four[4];
    Unroll<4>([&](auto j) PATINA_LAMBDA {
      const __m256 eight = _mm256_add_ps(v[4 * k + j].lo, v[4 * k + j].hi);
      four[j] = _mm_add_ps(_mm256_castps256_ps128(eight), _mm256_extractf128_ps(eight, 1));
    });
    const __m128 two_a = _mm_add_ps(_mm_movelh_ps(four[0], four[1]), _mm_movehl_ps(four[1], four[0]));
    const __m128 two_b = _mm_add_ps(_mm_movelh_ps(four[2], four[3]), _mm_movehl_ps(four[3], four[2]));
    _mm_store_ps(out + 4 * k, _mm_add_ps(_mm_shuffle_ps(two_a, two_b, 0x88), _mm_shuffle_ps(two_a, two_b, 0xDD)));
  });
  return Load(out);
}
#endif

// Gradient by a block's parameters from that by its 16 texels (already zero for texels outside the level):
// kSegments: gradient[0] endpoints (lanes 0..11), gradient[1] indices; kFree: gradient[c] texels.
template <BlockForm kForm>
PATINA_INLINE void BlockGradient(const float* params, unsigned partition_mask, const F16 texel_gradient[3], F16 gradient[3]) {
  if constexpr (kForm == BlockForm::kSegments) {
    const M16 second = MaskOf(partition_mask), first = MaskOf(~partition_mask & 0xFFFFu);
    const SegmentTexels s = ExpandSegments(params, second);
    const F16 index = Load(params + 16);
    const F16 rest = Set(1.0f) - index;
    F16 sums[12];
    F16 by_index = Zero();
    Unroll<3>([&](auto c) PATINA_LAMBDA {
      const F16 value = ValueOfBinades(MulAdd(index, s.span[c], s.start[c]));
      const F16 g = texel_gradient[c] * SlopeOfValue(value);
      by_index = MulAdd(g, s.span[c], by_index);
      const F16 at_start = g * rest, at_end = g * index;
      sums[c] = ZeroUnless(first, at_start);
      sums[3 + c] = ZeroUnless(first, at_end);
      sums[6 + c] = ZeroUnless(second, at_start);
      sums[9 + c] = ZeroUnless(second, at_end);
    });
    gradient[0] = SumTwelve(sums);
    gradient[1] = by_index;
  } else {
    Unroll<3>([&](auto c) PATINA_LAMBDA { gradient[c] = texel_gradient[c]; });
  }
}

// Returns the new parameters. Adds to `check` a zero, unless a parameter or moment is not finite: limits that are put on
// parameters afterwards would hide it.
PATINA_INLINE F16 AdamStep(F16 param, F16 gradient, float* moment1, float* moment2, float rate, float correction1,
                           float correction2, const AdamRates& rates, F16* check) {
  const F16 m = MulAdd(Set(1 - rates.beta1), gradient, Set(rates.beta1) * Load(moment1));
  const F16 v = MulAdd(Set(1 - rates.beta2) * gradient, gradient, Set(rates.beta2) * Load(moment2));
  Store(moment1, m);
  Store(moment2, v);
  const F16 step = Set(rate * correction1) * m / (Sqrt(v * Set(correction2)) + Set(rates.epsilon));
  const F16 updated = param - step;
  *check = MulAdd(updated + v, Zero(), *check);
  return updated;
}

// 1 / (1 - beta^updates), by repeated squaring: the same bits everywhere.
PATINA_INLINE float BiasCorrection(float beta, int updates) {
  if (updates > 4000) return 1.0f;
  float power = 1, base = beta;
  for (int n = updates; n != 0; n >>= 1, base *= base) {
    if (n & 1) power *= base;
  }
  return 1.0f / (1.0f - power);
}

template <BlockForm kForm>
PATINA_INLINE void UpdateBlock(FeatureLevel* level, int block, const F16 gradient[3], const AdamRates& rates, F16* check) {
  constexpr int kStride = BlockStride(kForm);
  float* params = level->params.data() + static_cast<size_t>(block) * kStride;
  float* moment1 = level->moments.data() + static_cast<size_t>(block) * kStride * 2;
  float* moment2 = moment1 + kStride;
  uint16_t& updates = level->updates[block];
  if (updates < 0xFFFF) ++updates;
  const float c1 = BiasCorrection(rates.beta1, updates), c2 = BiasCorrection(rates.beta2, updates);
  if constexpr (kForm == BlockForm::kSegments) {
    const F16 endpoints = AdamStep(Load(params), gradient[0], moment1, moment2, rates.endpoint, c1, c2, rates, check);
    Store(params, Min(Max(endpoints, Set(kMinBinade)), Set(kMaxBinade)));
    const F16 indices = AdamStep(Load(params + 16), gradient[1], moment1 + 16, moment2 + 16, rates.index, c1, c2, rates, check);
    Store(params + 16, Min(Max(indices, Zero()), Set(1.0f)));
  } else {
    Unroll<3>([&](auto c) PATINA_LAMBDA {
      Store(params + c * 16, AdamStep(Load(params + c * 16), gradient[c], moment1 + c * 16, moment2 + c * 16,
                                      rates.endpoint, c1, c2, rates, check));
    });
  }
}

}  // namespace patina::PATINA_SIMD
