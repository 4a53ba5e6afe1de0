// Principal lines of the two regions of all 32 partitions at once, a partition a lane. Compiled for
// each target.

namespace patina::PATINA_SIMD {
namespace {

// For each partition and region, the line through weighted points that leaves the least squared
// distance. Entry 32 is the whole block as region 0.
inline constexpr int kWholeBlock = 32;

struct PrincipalLines {
  alignas(64) float residual[48];         // weighted squared distances, both regions
  alignas(64) float mean[2][3][48];       // [region][axis][partition]
  alignas(64) float direction[2][3][48];  // unit, or zero where all points coincide
};

// One region's line from its moments: m0 = sum w, m1 = sum w z, m2 = sum w z z^T. Returns the
// squared distance left, and `share_along` of the variance along the line.
PATINA_INLINE F16 LineOfMoments(F16 m0, const F16 m1[3], const F16 m2[6], float share_along,
                                F16 mean[3], F16 direction[3]) {
  const F16 tiny = Set(0x1p-100f);
  const F16 inverse = Set(1.0f) / Max(m0, tiny);
  for (int c = 0; c < 3; ++c) mean[c] = m1[c] * inverse;
  F16 cov[6];
  for (int q = 0, r = 0; r < 3; ++r) {
    for (int c = r; c < 3; ++c, ++q) cov[q] = NegMulAdd(m1[r], mean[c], m2[q]);
  }
  const F16 trace = Max(cov[0], Zero()) + Max(cov[3], Zero()) + Max(cov[5], Zero());
  const F16 normalise = Set(1.0f) / Max(trace, tiny);
  F16 m[6];
  for (int q = 0; q < 6; ++q) m[q] = cov[q] * normalise;
  // The 32nd power of a matrix of trace 1 is nearly the projector on its principal axis.
  for (int k = 0; k < 5; ++k) {
    const F16 xx = MulAdd(m[2], m[2], MulAdd(m[1], m[1], m[0] * m[0]));
    const F16 xy = MulAdd(m[2], m[4], MulAdd(m[1], m[3], m[0] * m[1]));
    const F16 xz = MulAdd(m[2], m[5], MulAdd(m[1], m[4], m[0] * m[2]));
    const F16 yy = MulAdd(m[4], m[4], MulAdd(m[3], m[3], m[1] * m[1]));
    const F16 yz = MulAdd(m[4], m[5], MulAdd(m[3], m[4], m[1] * m[2]));
    const F16 zz = MulAdd(m[5], m[5], MulAdd(m[4], m[4], m[2] * m[2]));
    m[0] = xx, m[1] = xy, m[2] = xz, m[3] = yy, m[4] = yz, m[5] = zz;
  }
  const M16 y_over_x = m[3] > m[0];
  const M16 z_over = m[5] > Max(m[0], m[3]);
  F16 v[3] = {Select(z_over, m[2], Select(y_over_x, m[1], m[0])),
              Select(z_over, m[4], Select(y_over_x, m[3], m[1])),
              Select(z_over, m[5], Select(y_over_x, m[4], m[2]))};
  const F16 length2 = Dot(v, v);
  const F16 unit = Set(1.0f) / Sqrt(Max(length2, tiny));
  // Where all points coincide, rounding may leave products of the axes and no variance: the powers of such a matrix overflow.
  const M16 meaningful = length2 < Set(0x1p60f);  // false for NaN
  for (int c = 0; c < 3; ++c) direction[c] = ZeroUnless(meaningful, v[c] * unit);
  F16 image[3];
  Multiply(cov, direction, image);
  const F16 along = Dot(direction, image);
  return Max(MulAdd(along, Set(share_along), trace - along), Zero());
}

// points: [axis][texel]; weight: [texel], not negative; share_along: how much variance along the
// lines counts.
inline void FindPrincipalLines(const BlockTables& tables, const F16 points[3], F16 weight,
                               float share_along, PrincipalLines* lines) {
  alignas(64) float value[10][16];
  F16 weighted[3];
  Store(value[0], weight);
  for (int c = 0; c < 3; ++c) Store(value[1 + c], weighted[c] = weight * points[c]);
  for (int q = 4, r = 0; r < 3; ++r) {
    for (int c = r; c < 3; ++c, ++q) Store(value[q], weighted[r] * points[c]);
  }
  float total[10];
  for (int q = 0; q < 10; ++q) total[q] = ReduceSum(Load(value[q]));
  for (int half = 0; half < 3; ++half) {
    F16 one[10];
    Unroll<10>([&](auto q) PATINA_LAMBDA { one[q] = Zero(); });
    for (int t = 0; t < 16 && half < 2; ++t) {
      const F16 member = Load(tables.member[half][t]);
      Unroll<10>([&](auto q) PATINA_LAMBDA { one[q] = MulAdd(member, Set(value[q][t]), one[q]); });
    }
    F16 zero[10], residual = Zero();
    for (int q = 0; q < 10; ++q) zero[q] = Set(total[q]) - one[q];
    for (int region = 0; region < 2; ++region) {
      const F16* moments = region == 0 ? zero : one;
      F16 mean[3], direction[3];
      residual = residual +
                 LineOfMoments(moments[0], moments + 1, moments + 4, share_along, mean, direction);
      for (int c = 0; c < 3; ++c) {
        Store(lines->mean[region][c] + 16 * half, mean[c]);
        Store(lines->direction[region][c] + 16 * half, direction[c]);
      }
    }
    Store(lines->residual + 16 * half, residual);
  }
}

inline void FitTexelsKernel(const float texels[3][16], bc6::SoftBlock* block) noexcept {
  const BlockTables& tables = bc6::Tables();
  F16 points[3], slope;
  float centre[3];
  for (int c = 0; c < 3; ++c) {
    const F16 value = Min(Max(LoadU(texels[c]), Set(0x1p-14f)), Set(60000.0f));
    const F16 binades = ToBinades(value, &slope);
    centre[c] = ReduceSum(binades) * (1.0f / 16);
    points[c] = binades - Set(centre[c]);
  }
  PrincipalLines lines;
  FindPrincipalLines(tables, points, Set(1.0f), 0.0f, &lines);
  int best = 0;
  for (int p = 1; p < bc6h::kPartitionCount; ++p) {
    if (lines.residual[p] < lines.residual[best]) best = p;
  }
  const M16 in_one = MaskOf(tables.mask[best]), in_zero = MaskOf(~tables.mask[best] & 0xFFFFu);
  F16 along = Zero();
  for (int c = 0; c < 3; ++c) {
    const F16 mean = Select(in_one, Set(lines.mean[1][c][best]), Set(lines.mean[0][c][best]));
    const F16 direction =
        Select(in_one, Set(lines.direction[1][c][best]), Set(lines.direction[0][c][best]));
    along = MulAdd(direction, points[c] - mean, along);
  }
  float ends[2][2];
  for (int region = 0; region < 2; ++region) {
    const F16 own =
        ZeroUnless(region == 0 ? in_zero : in_one, along);  // zero is the mean: within the range
    ends[region][0] = -ReduceMax(Zero() - own);
    ends[region][1] = ReduceMax(own);
  }
  const F16 least = Select(in_one, Set(ends[1][0]), Set(ends[0][0]));
  const F16 greatest = Select(in_one, Set(ends[1][1]), Set(ends[0][1]));
  StoreU(block->index,
         Min(Max((along - least) / Max(greatest - least, Set(0x1p-60f)), Zero()), Set(1.0f)));
  block->partition = best;
  for (int e = 0; e < 4; ++e) {
    for (int c = 0; c < 3; ++c) {
      const float at =
          lines.mean[e / 2][c][best] + ends[e / 2][e % 2] * lines.direction[e / 2][c][best];
      block->endpoint[e][c] = std::clamp(centre[c] + at, 1.0f, 30.9f);
    }
  }
}

}  // namespace
}  // namespace patina::PATINA_SIMD
