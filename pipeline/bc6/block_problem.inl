// A block made ready for the searches: sanitised, scaled, and in binades. Compiled for each target;
// see simd16.h.

namespace patina::PATINA_SIMD {
namespace {

using bc6::BlockTables;
using bc6::ModeLanes;
using bc6::ModeLimits;
using bc6::WeightedTarget;

// Symmetric 3x3 matrices are stored as xx, xy, xz, yy, yz, zz.
inline constexpr int kSymmetric[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

struct Problem {
  F16 target[3];   // linear, within [0, 65504]
  F16 cost[6];     // the Hessian as given, scaled
  F16 hessian[6];  // the same plus a trace on the diagonal, so that texels that cost nothing stay
                   // near their target
  F16 root[3], inverse_root[3];  // of hessian's diagonal
  F16 position[3];               // the target in binades, minus centre
  // For the lanes that are not texels: hessian, position, and in binades with the slope at the
  // target
  alignas(64) float hessian_of[6][16];
  alignas(64) float position_of[3][16];
  alignas(64) float target_of[3][16];
  alignas(64) float slope_of[3][16];      // of the value by binades, at the target
  alignas(64) float curvature_of[6][16];  // hessian per binade squared
  alignas(64) float pull_of[3][16];       // curvature * position
  // Points and weights in which squared distances approximate the cost: the block's mean curvature
  // becomes the identity, and a texel counts by the size of its own curvature beside the mean.
  alignas(64) float point_of[3][16];
  alignas(64) float weight_of[16];
  float mean_weight;
  float whiten[6];  // L^T by rows: 00 01 02 11 12 22
  float centre[3];  // of the positions, binades
  float mean_target[3];
  float inverse_scale;  // error as given = error here * inverse_scale
};

// Values in [0, 65504] to binades, and the value's change in one binade (the slope of the half's
// scale there).
PATINA_INLINE F16 ToBinades(F16 value, F16* slope) {
  const I16 bits = AsInt(value);
  const F16 fraction = AsFloat((bits & SetI(0x7FFFFF)) + SetI(0x3F800000));  // in [1, 2)
  const F16 normal = ToFloat(ShiftRight<23>(bits) - SetI(113)) + fraction;
  const F16 subnormal = value * Set(0x1p14f);
  const M16 is_subnormal = value < Set(0x1p-14f);
  *slope = Max(AsFloat(bits & SetI(0x7F800000)), Set(0x1p-14f));
  return Select(is_subnormal, subnormal, normal);
}

// Binades in [0, 31] to values.
PATINA_INLINE F16 FromBinades(F16 binades) {
  const F16 normal = AsFloat(RoundToInt(binades * Set(0x1p23f)) + SetI(112 << 23));
  return Select(binades < Set(1.0f), binades * Set(0x1p-14f), normal);
}

PATINA_INLINE void Multiply(const F16 m[6], const F16 v[3], F16 out[3]) {
  out[0] = MulAdd(m[2], v[2], MulAdd(m[1], v[1], m[0] * v[0]));
  out[1] = MulAdd(m[4], v[2], MulAdd(m[3], v[1], m[1] * v[0]));
  out[2] = MulAdd(m[5], v[2], MulAdd(m[4], v[1], m[2] * v[0]));
}

PATINA_INLINE void ScaleHessian(const F16 hessian[6], const F16 slope[3], F16 out[6]) {
  for (int q = 0, r = 0; r < 3; ++r) {
    for (int c = r; c < 3; ++c, ++q) out[q] = hessian[q] * (slope[r] * slope[c]);
  }
}

PATINA_INLINE F16 Dot(const F16 a[3], const F16 b[3]) {
  return MulAdd(a[2], b[2], MulAdd(a[1], b[1], a[0] * b[0]));
}

// The whitening: curvature and position give points, weights and L^T with mean curvature = L L^T.
inline void Whiten(const F16 curvature[6], Problem* p) {
  float mean[6];
  for (int q = 0; q < 6; ++q) mean[q] = ReduceSum(curvature[q]) * (1.0f / 16);
  const float ridge = (mean[0] + mean[3] + mean[5]) * 1e-4f + 1e-34f;
  const float l00 = std::sqrt(std::max(mean[0], 0.0f) + ridge);
  const float l10 = mean[1] / l00, l20 = mean[2] / l00;
  const float l11 = std::sqrt(std::max(mean[3] - l10 * l10, 0.0f) + ridge);
  const float l21 = (mean[4] - l20 * l10) / l11;
  const float l22 = std::sqrt(std::max(mean[5] - l20 * l20 - l21 * l21, 0.0f) + ridge);
  const float whiten[6] = {l00, l10, l20, l11, l21, l22};
  std::copy(whiten, whiten + 6, p->whiten);
  Store(p->point_of[0], MulAdd(Set(l20), p->position[2],
                               MulAdd(Set(l10), p->position[1], Set(l00) * p->position[0])));
  Store(p->point_of[1], MulAdd(Set(l21), p->position[2], Set(l11) * p->position[1]));
  Store(p->point_of[2], Set(l22) * p->position[2]);
  // weight = trace(L^-1 curvature L^-T) / 3
  const float i00 = 1 / l00, i11 = 1 / l11, i22 = 1 / l22;
  const float i10 = -l10 * i00 * i11, i21 = -l21 * i11 * i22;
  const float i20 = (l10 * l21 * i11 - l20) * i00 * i22;
  const float m[6] = {i00 * i00 + i10 * i10 + i20 * i20,
                      2 * (i10 * i11 + i20 * i21),
                      2 * i20 * i22,
                      i11 * i11 + i21 * i21,
                      2 * i21 * i22,
                      i22 * i22};
  F16 sum = Zero();
  for (int q = 0; q < 6; ++q) sum = MulAdd(Set(m[q]), curvature[q], sum);
  const F16 weight = Max(sum * Set(1.0f / 3), Zero());
  Store(p->weight_of, weight);
  p->mean_weight = ReduceSum(weight) * (1.0f / 16);
}

inline void PrepareProblem(const WeightedTarget& in, Problem* p) {
  F16 value[3], h[6];
  F16 size = Zero(), value_size = Zero();
  for (int c = 0; c < 3; ++c) {
    value[c] = LoadU(in.value[c]);
    value_size = value_size + Abs(value[c]);
    p->target[c] = Min(Max(value[c], Zero()), Set(65504.0f));  // NaN becomes 0
  }
  for (int q = 0; q < 6; ++q) {
    h[q] = LoadU(in.hessian[q]);
    size = size + Abs(h[q]);
  }
  const M16 hessian_finite = size < Set(0x1p124f),
            value_finite = value_size < Set(0x1p127f);  // false for NaN
  for (int q = 0; q < 6; ++q) h[q] = ZeroUnless(value_finite, ZeroUnless(hessian_finite, h[q]));

  // Scaling by a power of two brings the largest trace into [1, 2), so that nothing below overflows
  // or vanishes.
  const float largest = ReduceMax(Max(h[0] + h[3] + h[5], Zero()));
  int32_t exponent;
  std::memcpy(&exponent, &largest, 4);
  exponent = std::clamp(exponent >> 23, 1, 253);
  const float scale = std::ldexp(1.0f, 127 - exponent);
  p->inverse_scale = std::ldexp(1.0f, exponent - 127);
  const F16 ridge = Set(largest > 0 ? 0x1p-36f : 1.0f);
  for (int q = 0; q < 6; ++q) {
    p->cost[q] = h[q] * Set(scale);
    p->hessian[q] = (q == 0 || q == 3 || q == 5) ? p->cost[q] + ridge : p->cost[q];
    Store(p->hessian_of[q], p->hessian[q]);
  }
  for (int c = 0; c < 3; ++c) {
    p->root[c] = Sqrt(Max(p->hessian[kSymmetric[c][c]], ridge));
    p->inverse_root[c] = Set(1.0f) / p->root[c];
  }

  F16 binades[3], slope[3], curvature[6], pull[3];
  const F16 weight = p->hessian[0] + p->hessian[3] + p->hessian[5];
  const float inverse_weight = 1.0f / std::max(ReduceSum(weight), 0x1p-60f);
  for (int c = 0; c < 3; ++c) {
    binades[c] = ToBinades(p->target[c], &slope[c]);
    p->centre[c] = std::clamp(ReduceSum(weight * binades[c]) * inverse_weight, 0.0f, 31.0f);
    p->position[c] = binades[c] - Set(p->centre[c]);
    p->mean_target[c] = ReduceSum(p->target[c]) * (1.0f / 16);
    Store(p->target_of[c], p->target[c]);
    Store(p->position_of[c], p->position[c]);
    Store(p->slope_of[c], slope[c]);
  }
  ScaleHessian(p->hessian, slope, curvature);
  Multiply(curvature, p->position, pull);
  for (int q = 0; q < 6; ++q) Store(p->curvature_of[q], curvature[q]);
  for (int c = 0; c < 3; ++c) Store(p->pull_of[c], pull[c]);
  Whiten(curvature, p);
}

}  // namespace
}  // namespace patina::PATINA_SIMD
