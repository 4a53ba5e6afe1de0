// Included inside a target section, after simd16.h, unroll.h and math16.inl.

namespace patina::PATINA_SIMD {
namespace {

using bench::kNbrdfChunkTiles;
using bench::kNbrdfColumns;
using bench::kNbrdfInputs;
using bench::kNbrdfOffset;
using bench::kNbrdfOutputs;
using bench::kNbrdfRows;
using bench::NbrdfScratch;
using bench::NbrdfTile;

#if defined(PATINA_SIMD_IS_AVX512)
inline constexpr int kBlock = 7;  // units at a time, of two vectors of samples each
#else
inline constexpr int kBlock = 3;
#endif

struct Pairs16 {
  F16 ix, iy, iz, ox, oy, oz;
};

// Sixteen pairs; beyond `count` the first stands in.
PATINA_INLINE Pairs16 LoadPairs(const brdf::Direction* wi, const brdf::Direction* wo,
                                size_t count) {
  alignas(64) float lanes[6][16];
  for (size_t l = 0; l < 16; ++l) {
    const size_t at = l < count ? l : 0;
    lanes[0][l] = wi[at].x, lanes[1][l] = wi[at].y, lanes[2][l] = wi[at].z;
    lanes[3][l] = wo[at].x, lanes[4][l] = wo[at].y, lanes[5][l] = wo[at].z;
  }
  return {Load(lanes[0]), Load(lanes[1]), Load(lanes[2]),
          Load(lanes[3]), Load(lanes[4]), Load(lanes[5])};
}

// rgb [count][3] of up to sixteen values a channel; 0 where a direction is not above the horizon.
PATINA_INLINE void StoreValues(const Pairs16& pairs, const F16 value[3], size_t count, float* rgb) {
  alignas(64) float lanes[3][16];
  const F16 lower = Min(pairs.iz, pairs.oz);
  for (int c = 0; c < 3; ++c) Store(lanes[c], ZeroUnless(lower > Zero(), value[c]));
  for (size_t l = 0; l < count && l < 16; ++l) {
    for (int c = 0; c < 3; ++c) rgb[3 * l + c] = lanes[c][l];
  }
}

// x_i of the network, at x + i * stride: brdf::ToHalfDifference without the angles.
PATINA_INLINE void HalfDifferenceVectors(const Pairs16& p, bool isotropic, float* x, int stride) {
  const F16 sx = p.ix + p.ox, sy = p.iy + p.oy, sz = p.iz + p.oz;
  const F16 mx = p.ix - p.ox, my = p.iy - p.oy, mz = p.iz - p.oz;
  const F16 across2 = MulAdd(sx, sx, sy * sy);
  const F16 across = Sqrt(across2), sum = Sqrt(MulAdd(sz, sz, across2));
  const F16 inverse = Set(1.0f) / Max(sum, Set(1e-12f));
  const M16 pole = across < Set(1e-7f);
  const F16 around = Set(1.0f) / Max(across, Set(1e-7f));
  const F16 cosine = Select(pole, Set(1.0f), sx * around),
            sine = ZeroUnless(across > Set(1e-7f), sy * around);
  const F16 along = MulAdd(cosine, mx, sine * my);
  const F16 half = Set(0.5f);
  Store(x, isotropic ? across * inverse : sx * inverse);
  Store(x + stride, isotropic ? Zero() : sy * inverse);
  Store(x + 2 * stride, sz * inverse);
  Store(x + 3 * stride, half * inverse * NegMulAdd(mz, across, along * sz));
  Store(x + 4 * stride, half * NegMulAdd(sine, mx, cosine * my));
  Store(x + 5 * stride, half * sum);
}

// Units [first, first + kUnits) of two vectors of samples: c = b + W a, rectified.
template <int kUnits, bool kRectify>
PATINA_INLINE void Units(const float* weights, int columns, int rows, const float* a, int stride,
                         float* c) {
  F16 sum[kUnits][2];
  Unroll<kUnits>([&](auto u) PATINA_LAMBDA { sum[u][0] = sum[u][1] = Zero(); });
  for (int i = 0; i < rows; ++i) {
    const F16 left = Load(a + i * stride), right = Load(a + i * stride + 16);
    const float* row = weights + i * columns;
    Unroll<kUnits>([&](auto u) PATINA_LAMBDA {
      const F16 w = Set(row[u]);
      sum[u][0] = MulAdd(w, left, sum[u][0]);
      sum[u][1] = MulAdd(w, right, sum[u][1]);
    });
  }
  Unroll<kUnits>([&](auto u) PATINA_LAMBDA {
    for (int v = 0; v < 2; ++v)
      Store(c + u * stride + 16 * v, kRectify ? Max(sum[u][v], Zero()) : sum[u][v]);
  });
}

// The network on 32 samples; activations of layer l at a[l], [kNbrdfRows[l]][stride], whose row
// kNbrdfInputs[l] is one; outputs [3][stride].
PATINA_INLINE void Forward32(const float* parameters, float* const a[3], int stride,
                             float* outputs) {
  for (int l = 0; l < 2; ++l) {
    for (int u = 0; u < kNbrdfOutputs[l]; u += kBlock) {
      Units<kBlock, true>(Opaque(parameters + kNbrdfOffset[l] + u), kNbrdfColumns[l],
                          kNbrdfInputs[l] + 1, a[l], stride, a[l + 1] + u * stride);
    }
  }
  Units<3, false>(Opaque(parameters + kNbrdfOffset[2]), kNbrdfColumns[2], kNbrdfInputs[2] + 1, a[2],
                  stride, outputs);
}

void NbrdfEvaluate(const float* parameters, bool isotropic, const brdf::Direction* wi,
                   const brdf::Direction* wo, size_t count, float* rgb) {
  alignas(64) float x[8 * 32], first[24 * 32], second[24 * 32], y[3 * 32];
  for (int l = 0; l < 32; ++l) x[6 * 32 + l] = first[21 * 32 + l] = second[21 * 32 + l] = 1.0f;
  float* const a[3] = {x, first, second};
  for (size_t at = 0; at < count; at += 32) {
    Pairs16 pairs[2];
    for (size_t v = 0; v < 2; ++v) {
      const size_t from = at + 16 * v < count ? at + 16 * v : at;
      pairs[v] = LoadPairs(wi + from, wo + from, count - from);
      HalfDifferenceVectors(pairs[v], isotropic, x + 16 * v, 32);
    }
    Forward32(parameters, a, 32, y);
    for (size_t v = 0; v < 2 && at + 16 * v < count; ++v) {
      F16 value[3];
      for (int c = 0; c < 3; ++c)
        value[c] = Max(Exp(Load(y + 32 * c + 16 * v)) - Set(1.0f), Zero());
      StoreValues(pairs[v], value, count - at - 16 * v, rgb + 3 * (at + 16 * v));
    }
  }
}

inline constexpr int kSamples = 16 * kNbrdfChunkTiles;

PATINA_INLINE F16 Sign(F16 x) {
  return Select(x > Zero(), Set(1.0f), Select(x < Zero(), Set(-1.0f), Zero()));
}

// Replaces the outputs by the derivatives of the loss, which is returned.
PATINA_STAGE double NbrdfLoss(const NbrdfTile* tiles, float* outputs) {
  constexpr float kPlainShare = 0.05f, kMaxLogValue = 12.0f;
  const F16 one = Set(1.0f), tiny = Set(1e-30f);
  F16 total = Zero();
  for (int t = 0; t < kNbrdfChunkTiles; ++t) {
    const F16 cosine = Load(tiles[t].cosine), importance = Load(tiles[t].importance);
    for (int c = 0; c < 3; ++c) {
      float* y = outputs + c * kSamples + 16 * t;
      const F16 capped = Min(Load(y), Set(kMaxLogValue));
      const F16 e = Exp(capped);
      const F16 inside = Max(MulAdd(cosine, e - one, one), tiny);
      const M16 positive = capped > Zero();
      const F16 g = Select(positive, Log(inside), cosine * capped);
      const F16 slope = Select(positive, cosine * e / inside, cosine);
      const F16 a = g - Load(tiles[t].wanted_g[c]), b = capped - Load(tiles[t].wanted_y[c]);
      total = MulAdd(importance, MulAdd(Set(kPlainShare), Abs(b), Abs(a)), total);
      Store(y, importance * MulAdd(Sign(a), slope, Set(kPlainShare) * Sign(b)));
    }
  }
  return static_cast<double>(ReduceSum(total));
}

// gradient [rows][columns] += a d^T over the samples of the chunk.
PATINA_STAGE void AddWeightGradient(const float* a, int rows, const float* d, int columns,
                                    float* gradient) {
  for (int i = 0; i < rows; i += 4) {
    for (int o = 0; o < columns; o += 4) {
      F16 sum[16];
      Unroll<16>([&](auto k) PATINA_LAMBDA { sum[k] = Zero(); });
      for (int s = 0; s < kSamples; s += 16) {
        F16 right[4];
        Unroll<4>([&](auto k) PATINA_LAMBDA { right[k] = Load(d + (o + k) * kSamples + s); });
        Unroll<4>([&](auto k) PATINA_LAMBDA {
          const F16 left = Load(a + (i + k) * kSamples + s);
          Unroll<4>([&](auto n)
                        PATINA_LAMBDA { sum[4 * k + n] = MulAdd(left, right[n], sum[4 * k + n]); });
        });
      }
      alignas(64) float sums[16];
      Store(sums, ReduceSums(sum));
      for (int k = 0; k < 4; ++k) {
        for (int n = 0; n < 4; ++n) gradient[(i + k) * columns + o + n] += sums[4 * k + n];
      }
    }
  }
}

// d_lower = W d where the activation is above zero, of kBlock units.
PATINA_INLINE void LowerUnits(const float* weights, int columns, int outputs, const float* d,
                              const float* a, float* lower) {
  F16 sum[kBlock][2];
  Unroll<kBlock>([&](auto u) PATINA_LAMBDA { sum[u][0] = sum[u][1] = Zero(); });
  for (int o = 0; o < outputs; ++o) {
    const F16 left = Load(d + o * kSamples), right = Load(d + o * kSamples + 16);
    Unroll<kBlock>([&](auto u) PATINA_LAMBDA {
      const F16 w = Set(weights[u * columns + o]);
      sum[u][0] = MulAdd(w, left, sum[u][0]);
      sum[u][1] = MulAdd(w, right, sum[u][1]);
    });
  }
  Unroll<kBlock>([&](auto u) PATINA_LAMBDA {
    for (int v = 0; v < 2; ++v) {
      const F16 active = Load(a + u * kSamples + 16 * v);
      Store(lower + u * kSamples + 16 * v, ZeroUnless(active > Zero(), sum[u][v]));
    }
  });
}

double NbrdfTrain(const float* parameters, const NbrdfTile* tiles, NbrdfScratch* scratch,
                  float* gradient) {
  float* inputs = scratch->activations[0].data();
  for (int i = 0; i < 6; ++i) {
    for (int t = 0; t < kNbrdfChunkTiles; ++t)
      Store(inputs + i * kSamples + 16 * t, Load(tiles[t].x[i]));
  }
  for (int s = 0; s < kSamples; s += 32) {
    float* const a[3] = {inputs + s, scratch->activations[1].data() + s,
                         scratch->activations[2].data() + s};
    Forward32(parameters, a, kSamples, scratch->outputs.data() + s);
  }
  const double loss = NbrdfLoss(tiles, scratch->outputs.data());
  const float* upper = scratch->outputs.data();
  for (int l = 2; l >= 0; --l) {
    const float* a = scratch->activations[l].data();
    const float* weights = parameters + kNbrdfOffset[l];
    AddWeightGradient(a, kNbrdfRows[l], upper, kNbrdfColumns[l], gradient + kNbrdfOffset[l]);
    if (l == 0) break;
    float* lower = scratch->gradients[l].data();
    for (int u = 0; u < kNbrdfInputs[l]; u += kBlock) {
      for (int s = 0; s < kSamples; s += 32) {
        LowerUnits(Opaque(weights + u * kNbrdfColumns[l]), kNbrdfColumns[l], kNbrdfOutputs[l],
                   upper + s, a + u * kSamples + s, lower + u * kSamples + s);
      }
    }
    upper = lower;
  }
  return loss;
}

void GgxEvaluate(const bench::GgxMaterial& material, const brdf::Direction* wi,
                 const brdf::Direction* wo, size_t count, float* rgb) {
  const F16 one = Set(1.0f), a2 = Set(material.alpha * material.alpha), f0 = Set(material.f0);
  for (size_t at = 0; at < count; at += 16) {
    const Pairs16 p = LoadPairs(wi + at, wo + at, count - at);
    const F16 sx = p.ix + p.ox, sy = p.iy + p.oy, sz = p.iz + p.oz;
    const F16 across2 = MulAdd(sx, sx, sy * sy);
    const F16 sum2 = Max(MulAdd(sz, sz, across2), Set(1e-24f));
    // q of h without its length; D = a2 / (pi q^2).
    const F16 q = MulAdd(a2, sz * sz, across2) / sum2;
    const F16 i2 = p.ix * p.ix + p.iy * p.iy, o2 = p.ox * p.ox + p.oy * p.oy;
    const F16 shadow =
        MulAdd(p.oz, Sqrt(MulAdd(a2, i2, p.iz * p.iz)), p.iz * Sqrt(MulAdd(a2, o2, p.oz * p.oz)));
    const F16 edge = Max(one - Set(0.5f) * Sqrt(sum2), Zero());
    const F16 edge2 = edge * edge;
    const F16 fresnel = MulAdd(one - f0, edge2 * edge2 * edge, f0);
    const F16 lobe = a2 * fresnel / Max(Set(6.28318531f) * q * q * shadow, Set(1e-30f));
    F16 value[3];
    for (int c = 0; c < 3; ++c) {
      value[c] = MulAdd(Set(material.specular[c]), lobe, Set(material.diffuse[c] * 0.318309886f));
    }
    StoreValues(p, value, count - at, rgb + 3 * at);
  }
}

}  // namespace

extern const bench::PeerKernels kPeerKernels;
const bench::PeerKernels kPeerKernels = {NbrdfEvaluate, NbrdfTrain, GgxEvaluate};

}  // namespace patina::PATINA_SIMD
