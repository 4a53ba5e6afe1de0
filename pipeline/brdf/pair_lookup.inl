// Sixteen pairs of directions to corners, weights and scalars: LookUpPair of sample_pool.h with the
// bilinear rule. Included inside a target section, after simd16.h, unroll.h and math16.inl.

namespace patina::PATINA_SIMD {
namespace {

struct Directions16 {
  F16 x, y, z;
};

struct Corners16 {
  I16 index[4];  // north, east, south, west
  F16 weight[4];
};

PATINA_INLINE F16 Length(F16 x, F16 y) { return Sqrt(MulAdd(x, x, y * y)); }
PATINA_INLINE M16 Below(I16 a, I16 b) {
  return ToFloat(a) < ToFloat(b);
}  // whole numbers below 2^24
// For -1 < x.
PATINA_INLINE I16 FloorToInt(F16 x) { return TruncateToInt(x + Set(1.0f)) - SetI(1); }
PATINA_INLINE I16 WrapOnce(I16 j, I16 length) { return SelectI(Below(j, length), j, j - length); }

// healpix::LocatePixel and PixelCorners, both halves of the hemisphere computed and one chosen.
PATINA_INLINE void LookUpCorners(int nside, const Directions16& w, bool azimuth_zero,
                                 Corners16* out) {
  const F16 n = Set(static_cast<float>(nside));
  const I16 ni = SetI(nside), one = SetI(1), zero = SetI(0);
  const F16 z = Max(w.z, Zero());
  I16 quadrant = zero;
  F16 t = Zero();
  if (!azimuth_zero) {
    const F16 upper = Atan2Upper(Abs(w.y), w.x);
    const F16 turns = Set(0.63661977f) * Select(w.y < Zero(), Set(6.28318531f) - upper, upper);
    quadrant = MinI(TruncateToInt(turns), SetI(3));
    t = Min(Max(turns - ToFloat(quadrant), Zero()), Set(1.0f));
  }

  // Cap.
  const F16 radius = Min(n * Length(w.x, w.y) / Sqrt((Set(1.0f) + z) * Set(1.0f / 3)), n);
  const F16 ca = t * radius, cb = (Set(1.0f) - t) * radius;
  I16 cp = TruncateToInt(ca), cm = TruncateToInt(cb);
  const M16 inside = Below(cp + cm, ni);
  const M16 has_p = Below(zero, cp);
  cp = SelectI(inside, cp, SelectI(has_p, cp - one, cp));
  cm = SelectI(inside, cm, SelectI(has_p, cm, cm - one));
  const I16 cap_ring = cp + cm + one;

  // Belt.
  const F16 middle = n * (Set(0.5f) + t), rise = Set(0.75f) * n * z;
  const F16 ba = middle - rise, bb = middle + rise;
  const I16 bm = FloorToInt(bb);
  const I16 bp_free = FloorToInt(ba);
  const I16 bp = SelectI(Below(ni, bm - bp_free), bm - ni, bp_free);
  const I16 length = SetI(4 * nside);
  const I16 twice =
      bp + bm + ShiftLeft<1>(quadrant * ni) - ni + SetI(2) - ((ni + one + bp - bm) & one);
  const I16 belt_j = WrapOnce(WrapOnce(ShiftRight<1>(twice + SetI(8 * nside)), length), length);

  const M16 cap = z > Set(2.0f / 3);
  const I16 ring = SelectI(cap, cap_ring, SetI(2 * nside) + bp - bm);
  const I16 j = SelectI(cap, quadrant * cap_ring + cp, belt_j);
  const F16 u = Min(Max(Select(cap, ca - ToFloat(cp), ba - ToFloat(bp)), Zero()), Set(1.0f));
  const F16 v =
      Min(Max(Select(cap, cb - ToFloat(cm), Set(1.0f) - (bb - ToFloat(bm))), Zero()), Set(1.0f));

  // Corners by rings up to N, the last of which reaches into the belt.
  const I16 q = TruncateToInt((ToFloat(j) + Set(0.5f)) / ToFloat(ring));
  const I16 m = j - q * ring;
  const I16 above = ring - one, below = ring + one;
  const int belt_first = 1 + 2 * nside * (nside - 1);  // index of the first corner of ring N
  const I16 cap_start = one + ShiftLeft<1>(ring * above);
  const I16 cap_north = SelectI(
      EqualI(ring, one), zero,
      one + ShiftLeft<1>(above * (above - one)) + WrapOnce(q * above + m, ShiftLeft<2>(above)));
  const I16 cap_east = cap_start + WrapOnce(j + one, ShiftLeft<2>(ring));
  const I16 cap_south = SelectI(EqualI(ring, ni), SetI(belt_first + 4 * nside) + j,
                                one + ShiftLeft<1>(below * ring) + q * below + m + one);
  // And by rings beyond.
  const I16 belt_start = SetI(belt_first) + length * (ring - ni);
  const I16 shift = (ring - ni) & one;
  const I16 belt_east = belt_start + WrapOnce(j + one - shift, length);
  const I16 belt_west = belt_start + WrapOnce(j - shift + length, length);

  const M16 beyond = Below(ni, ring);
  out->index[0] = SelectI(beyond, belt_start - length + j, cap_north);
  out->index[1] = SelectI(beyond, belt_east, cap_east);
  out->index[2] = SelectI(beyond, belt_start + length + j, cap_south);
  out->index[3] = SelectI(beyond, belt_west, cap_start + j);
  const F16 u1 = Set(1.0f) - u, v1 = Set(1.0f) - v;
  out->weight[0] = u1 * v1;
  out->weight[1] = u * v1;
  out->weight[2] = u * v;
  out->weight[3] = u1 * v;
}

// brdf::AngleInputs.
PATINA_INLINE void AngleInputs16(const Directions16& wi, const Directions16& wo, F16 out[3]) {
  const F16 sx = wi.x + wo.x, sy = wi.y + wo.y, sz = wi.z + wo.z;
  const F16 ex = wi.x - wo.x, ey = wi.y - wo.y, ez = wi.z - wo.z;
  const F16 length = Sqrt(MulAdd(sz, sz, MulAdd(sx, sx, sy * sy)));
  const F16 inverse = Set(1.0f) / Max(length, Set(1e-12f));
  const F16 hx = sx * inverse, hy = sy * inverse, hz = sz * inverse;
  const F16 sine = Length(hx, hy);
  const F16 theta_h = Atan2Upper(sine, hz);
  const F16 theta_d = Atan2Upper(Sqrt(MulAdd(ez, ez, MulAdd(ex, ex, ey * ey))), length);
  const M16 pole = sine < Set(1e-7f);
  const F16 inverse_sine = Set(1.0f) / Max(sine, Set(1e-7f));
  const F16 c = Select(pole, Set(1.0f), hx * inverse_sine),
            s = Select(pole, Zero(), hy * inverse_sine);
  const F16 along = MulAdd(c, ex, s * ey);
  const F16 dx = MulAdd(hz, along, Zero() - sine * ez), dy = MulAdd(c, ey, Zero() - s * ex);
  const F16 squared = MulAdd(dx, dx, dy * dy);
  out[0] = MulAdd(Set(2 / 5.75f), Log(MulAdd(Set(200.0f), theta_h, Set(1.0f))), Set(-1.0f));
  out[1] = MulAdd(Set(1.27323954f), theta_d, Set(-1.0f));
  out[2] = ZeroUnless(squared > Set(4e-12f), Set(2.0f) * dx * dy / Max(squared, Set(1e-30f)));
}

PATINA_INLINE F16 SignedLog16(F16 v) {
  const F16 size = Log(MulAdd(Set(200.0f), Abs(v), Set(1.0f))) * Set(1 / 5.30330491f);
  return Select(v < Zero(), Zero() - size, size);
}

// brdf::HalfVectorInputs.
PATINA_INLINE void HalfVectorInputs16(const Directions16& wi, const Directions16& wo, F16 out[2]) {
  const F16 sx = wi.x + wo.x, sy = wi.y + wo.y, sz = wi.z + wo.z;
  const F16 length = Sqrt(MulAdd(sz, sz, MulAdd(sx, sx, sy * sy)));
  const F16 inverse = Set(1.0f) / Max(length, Set(1e-12f));
  out[0] = SignedLog16(sx * inverse);
  out[1] = SignedLog16(sy * inverse);
}

PATINA_STAGE void LookUpPairs(const brdf::LookUpGrid& grid, const brdf::Direction* wi,
                              const brdf::Direction* wo, int count, brdf::PairLookups* pairs) {
  alignas(64) float lanes[6][16];
  for (int first = 0; first < brdf::kChunkRows; first += 16) {
    for (int l = 0; l < 16; ++l) {
      const int at = first + (first + l < count ? l : 0);
      lanes[0][l] = wi[at].x, lanes[1][l] = wi[at].y, lanes[2][l] = wi[at].z;
      lanes[3][l] = wo[at].x, lanes[4][l] = wo[at].y, lanes[5][l] = wo[at].z;
    }
    Directions16 in = {Load(lanes[0]), Load(lanes[1]), Load(lanes[2])},
                 out = {Load(lanes[3]), Load(lanes[4]), Load(lanes[5])};
    if (grid.canonical_order) {
      const M16 exchange = out.z > in.z;
      const Directions16 a = in;
      in = {Select(exchange, out.x, in.x), Select(exchange, out.y, in.y),
            Select(exchange, out.z, in.z)};
      out = {Select(exchange, a.x, out.x), Select(exchange, a.y, out.y),
             Select(exchange, a.z, out.z)};
    }
    F16 extra[brdf::kMaxExtraInputs];
    int extras = 0;
    if (grid.angle_inputs) {
      AngleInputs16(in, out, extra);
      extras = 3;
    }
    if (grid.half_vector_inputs) {
      HalfVectorInputs16(in, out, extra + 3);
      extras = 5;
    }
    if (grid.isotropic) {
      const F16 radius = Length(in.x, in.y);
      const M16 pole = radius < Set(1e-7f);
      const F16 inverse = Set(1.0f) / Max(radius, Set(1e-7f));
      const F16 c = in.x * inverse, s = in.y * inverse;
      const F16 x = MulAdd(c, out.x, s * out.y), y = Abs(MulAdd(c, out.y, Zero() - s * out.x));
      out.x = Select(pole, Length(out.x, out.y), x);
      out.y = ZeroUnless(radius > Set(1e-7f), y);
      in.x = radius;
      in.y = Zero();
    }
    Corners16 near, far;
    LookUpCorners(grid.nside, in, grid.isotropic, &near);
    LookUpCorners(grid.nside, out, false, &far);
    const I16 second = SetI(grid.corners);
    Unroll<4>([&](auto c) PATINA_LAMBDA {
      StoreI(pairs->corner[c] + first, near.index[c]);
      StoreI(pairs->corner[4 + c] + first, far.index[c] + second);
      Store(pairs->weight[c] + first, near.weight[c]);
      Store(pairs->weight[4 + c] + first, far.weight[c]);
    });
    for (int e = 0; e < extras; ++e) Store(pairs->extra[e] + first, extra[e]);
  }
}

// rgb [count][3] of the outputs of a forward pass.
PATINA_STAGE void OutputValues(const float* outputs, const brdf::Direction* wi,
                               const brdf::Direction* wo, int count, float* rgb) {
  // Four of the sixteen outputs of a sample, the last one padding; a vector is four samples.
  alignas(64) float values[4 * brdf::kChunkRows] = {};
  for (int s = 0; s < count; ++s) _mm_storeu_ps(values + 4 * s, _mm_loadu_ps(outputs + 16 * s));
  for (int s = 0; s < count; s += 4) {
    // NaN, which only absurd weights can give, becomes 0, as in the decoder.
    const F16 y = Min(Max(Load(values + 4 * s), Zero()), Set(brdf::kMaxLogValue));
    Store(values + 4 * s, Exp(y) - Set(1.0f));
  }
  for (int s = 0; s < count; ++s) {
    const bool above = wi[s].z > 0 && wo[s].z > 0;
    for (int c = 0; c < 3; ++c) rgb[3 * s + c] = above ? values[4 * s + c] : 0.0f;
  }
}

}  // namespace
}  // namespace patina::PATINA_SIMD
