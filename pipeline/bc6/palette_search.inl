// The exact part: what a decoder makes of endpoint codes, the best index of every texel, and the
// search over codes. Compiled for each target.

namespace patina::PATINA_SIMD {
namespace {

// Legal endpoint codes with a partition; endpoint 0 is the base of the deltas. Codes are whole
// numbers in floats.
struct Codes {
  int mode = 0;
  int partition = 0;
  unsigned mask = 0;  // texels of region 1
  float code[4][3] = {};
  float error[2] = {};  // of each region, with the best indices
  int channel = 0;      // the next one to step
  int idle = 0;  // channels stepped without gain since the last gain; 3: nothing left to gain

  float Total() const { return error[0] + error[1]; }
};

// Codes to the decoder's interpolation scale, over 64: exact, as the results are whole numbers of
// at most 16 bits.
PATINA_INLINE F16 Unquantized(const ModeLimits& mode, F16 code) {
  const F16 inner = (code + Set(mode.offset)) * Set(mode.wide_step);
  const F16 above = Select(code > Set(mode.max_code - 0.5f), Set(65535.0f / 64), inner);
  return Select(code < Set(0.5f), Zero(), above);
}

// Whether endpoints 0..kEndpoints-1 are in reach of endpoint `base` by `slack` codes more than
// needed, in channel c.
template <int kEndpoints>
PATINA_INLINE bool InReach(const ModeLimits& mode, const Codes& s, int c, int base, float slack) {
  float low = std::min(s.code[0][c], s.code[1][c]), high = std::max(s.code[0][c], s.code[1][c]);
  if constexpr (kEndpoints == 4) {
    low = std::min(low, std::min(s.code[2][c], s.code[3][c]));
    high = std::max(high, std::max(s.code[2][c], s.code[3][c]));
  }
  const float half = mode.half_range[c];
  return (low - s.code[base][c] >= slack - half) & (high - s.code[base][c] <= half - 1 - slack);
}

// Whether the deltas of the codes fit the mode.
template <int kEntries>
PATINA_INLINE bool Holds(const ModeLimits& mode, const Codes& s) {
  constexpr int kEndpoints = kEntries == 8 ? 4 : 2;
  return !mode.transformed ||
         (InReach<kEndpoints>(mode, s, 0, 0, 0) && InReach<kEndpoints>(mode, s, 1, 0, 0) &&
          InReach<kEndpoints>(mode, s, 2, 0, 0));
}

// Whether the index of texel 0 must stay in the lower half: true unless the mode can hold region 0
// turned round, also after both endpoints moved by `stride` codes in channel `moving`.
template <int kEntries>
PATINA_INLINE bool AnchorIsBound(const ModeLimits& mode, const Codes& s, int moving = -1,
                                 float stride = 0) {
  constexpr int kEndpoints = kEntries == 8 ? 4 : 2;
  if (!mode.transformed) return false;
  bool free = true;
  for (int c = 0; c < 3; ++c)
    free &= InReach<kEndpoints>(mode, s, c, 1, c == moving ? 2 * stride : 0.0f);
  return !free;
}

// The palette entries of one channel: those of region 0 in lanes 0..7 and of region 1 in
// lanes 8..15, or sixteen. `sum` is (a*(64-w) + b*w + 32) / 64 of unquantised a and b, exact in
// single precision.
PATINA_INLINE F16 PaletteOfSums(F16 sum) {
  const I16 value = TruncateToInt(sum);
  return HalfBitsToFloat(ShiftRight<6>(ShiftLeft<5>(value) - value));
}

template <int kEntries>
PATINA_INLINE F16 Sides(float region0, float region1) {
  if constexpr (kEntries == 16) return Set(region0);
  return Select(MaskOf(0xFF00u), Set(region1), Set(region0));
}

template <int kEntries>
PATINA_INLINE F16 Palette(const BlockTables& tables, const ModeLimits& mode, const Codes& s,
                          int c) {
  const F16 weight = Load(tables.weight[kEntries == 16]);
  const F16 a = Unquantized(mode, Sides<kEntries>(s.code[0][c], s.code[2][c]));
  const F16 b = Unquantized(mode, Sides<kEntries>(s.code[1][c], s.code[3][c]));
  return PaletteOfSums(MulAdd(a, Set(64.0f) - weight, MulAdd(b, weight, Set(0.5f))));
}

// The palette lane of entry 0 for each texel.
template <int kEntries>
PATINA_INLINE I16 FirstEntry(unsigned mask) {
  if constexpr (kEntries == 16) return SetI(0);
  return SelectI(MaskOf(mask), SetI(8), SetI(0));
}

PATINA_INLINE F16 Quadratic(const F16 h[6], const F16 d[3]) {
  const F16 two = Set(2.0f);
  const F16 z = h[5] * d[2];
  const F16 y = MulAdd(two * h[4], d[2], h[3] * d[1]);
  const F16 x = MulAdd(two * h[2], d[2], MulAdd(two * h[1], d[1], h[0] * d[0]));
  return MulAdd(z, d[2], MulAdd(y, d[1], x * d[0]));
}

inline constexpr float kForbidden = 1e30f;
// Gains below this share of the error are taken for rounding.
inline constexpr float kLeastGain = 1e-5f;

// Chooses every texel's index, the lowest of equals, and sets s->error. Returns the indices as
// palette lanes.
template <int kEntries>
inline I16 SearchIndices(const Problem& p, const BlockTables& tables, Codes* s) {
  const ModeLimits& mode = tables.mode[s->mode];
  F16 palette[3];
  for (int c = 0; c < 3; ++c) palette[c] = Palette<kEntries>(tables, mode, *s, c);
  const I16 first = FirstEntry<kEntries>(s->mask);
  const F16 forbidden =
      AnchorIsBound<kEntries>(mode, *s) ? ZeroUnless(MaskOf(1u), Set(kForbidden)) : Zero();
  F16 best = Set(3e38f);
  I16 index = first;
  Unroll<kEntries>([&](auto k) PATINA_LAMBDA {
    const I16 lane = first + SetI(k);
    F16 d[3];
    for (int c = 0; c < 3; ++c) d[c] = Lookup(palette[c], lane) - p.target[c];
    F16 error = Quadratic(p.hessian, d);
    if constexpr (k >= kEntries / 2) error = error + forbidden;
    index = SelectI(error < best, lane, index);
    best = Min(best, error);
  });
  const M16 in_one = MaskOf(s->mask);
  s->error[1] = ReduceSum(ZeroUnless(in_one, best));
  s->error[0] = ReduceSum(Select(in_one, Zero(), best));
  return index;
}

// The error at given indices, with the Hessian as given.
template <int kEntries>
inline float ExactError(const Problem& p, const BlockTables& tables, const Codes& s, I16 index) {
  F16 d[3];
  for (int c = 0; c < 3; ++c) {
    d[c] = Lookup(Palette<kEntries>(tables, tables.mode[s.mode], s, c), index) - p.target[c];
  }
  return ReduceSum(Quadratic(p.cost, d));
}

// The eight neighbours of a pair of codes.
inline constexpr int kNeighbours[8][2] = {{-1, -1}, {-1, 0}, {-1, 1}, {0, -1},
                                          {0, 1},   {1, -1}, {1, 0},  {1, 1}};

// Sets of neighbours by the step of the first code, of the second, and by the difference of the
// two.
inline constexpr unsigned kFirstStep[3] = {0x07, 0x18, 0xE0};
inline constexpr unsigned kSecondStep[3] = {0x29, 0x42, 0x94};
inline constexpr unsigned kDifference[5] = {0x20, 0x48, 0x81, 0x12, 0x04};

// Bit n is set where neighbour n of (code[2r][c], code[2r+1][c]) is legal while the other region
// stays.
template <int kEntries>
PATINA_INLINE unsigned LegalNeighbours(const ModeLimits& mode, const Codes& s, int c, int r,
                                       float stride) {
  const float a = s.code[2 * r][c], b = s.code[2 * r + 1][c];
  float a_low = 0, a_high = mode.max_code, b_low = 0, b_high = mode.max_code;
  unsigned legal = 0xFF;
  if (mode.transformed) {
    const float half = mode.half_range[c];
    if (r == 0) {
      if (kEntries == 8) {  // region 1 must stay in reach of a
        a_low = std::max(a_low, std::max(s.code[2][c], s.code[3][c]) - (half - 1));
        a_high = std::min(a_high, std::min(s.code[2][c], s.code[3][c]) + half);
      }
      for (int n = 0; n < 5; ++n) {
        const float delta = b - a + stride * static_cast<float>(n - 2);
        if ((delta < -half) | (delta > half - 1)) legal &= ~kDifference[n];
      }
    } else {
      a_low = b_low = std::max(a_low, s.code[0][c] - half);
      a_high = b_high = std::min(a_high, s.code[0][c] + half - 1);
    }
  }
  if (a - stride < a_low) legal &= ~kFirstStep[0];
  if (a + stride > a_high) legal &= ~kFirstStep[2];
  if (b - stride < b_low) legal &= ~kSecondStep[0];
  if (b + stride > b_high) legal &= ~kSecondStep[2];
  return legal;
}

// Tries all moves of one or both endpoints by `stride` codes in the next channel, for both regions
// at once and with new indices for each, and takes the best.
template <int kEntries>
inline void StepChannel(const Problem& p, const BlockTables& tables, float stride, Codes* s) {
  constexpr int kRegions = kEntries == 8 ? 2 : 1;
  const ModeLimits& mode = tables.mode[s->mode];
  const int c = s->channel;
  s->channel = c == 2 ? 0 : c + 1;
  const int c1 = c == 0 ? 1 : 0, c2 = c == 2 ? 1 : 2;
  const F16 two = Set(2.0f);

  // Per texel and entry, the error is (root P - centre)^2 + rest, where only P, the channel's
  // entry, changes. P is taken relative to the block's mean target, for the sake of rounding.
  const I16 first = FirstEntry<kEntries>(s->mask);
  const F16 target = p.target[c] - Set(p.mean_target[c]);
  const F16 root = p.root[c], inverse_root = p.inverse_root[c];
  alignas(64) float centre[kEntries][16], rest[kEntries][16];
  {
    const F16 with1 = p.hessian[kSymmetric[c][c1]] * inverse_root,
              with2 = p.hessian[kSymmetric[c][c2]] * inverse_root;
    const F16 h11 = p.hessian[kSymmetric[c1][c1]], h12 = two * p.hessian[kSymmetric[c1][c2]];
    const F16 h22 = p.hessian[kSymmetric[c2][c2]];
    const F16 forbidden = AnchorIsBound<kEntries>(mode, *s, c, stride)
                              ? ZeroUnless(MaskOf(1u), Set(kForbidden))
                              : Zero();
    const F16 palette1 = Palette<kEntries>(tables, mode, *s, c1),
              palette2 = Palette<kEntries>(tables, mode, *s, c2);
    const F16 target1 = p.target[c1], target2 = p.target[c2], target_root = target * root;
    Unroll<kEntries>([&](auto k) PATINA_LAMBDA {
      const I16 lane = first + SetI(k);
      const F16 d1 = Lookup(palette1, lane) - target1, d2 = Lookup(palette2, lane) - target2;
      const F16 half_slope = MulAdd(with2, d2, with1 * d1);
      const F16 other = MulAdd(h22 * d2, d2, MulAdd(h12, d2, h11 * d1) * d1);
      const F16 left = NegMulAdd(half_slope, half_slope, other);
      Store(centre[k], half_slope - target_root);
      Store(rest[k], k >= kEntries / 2 ? left + forbidden : left);
    });
  }

  const F16 weight = Load(tables.weight[kEntries == 16]), counter_weight = Set(64.0f) - weight;
  const F16 code_a = Sides<kEntries>(s->code[0][c], s->code[2][c]);
  const F16 code_b = Sides<kEntries>(s->code[1][c], s->code[3][c]);
  F16 a[3], b[3];  // the two terms of the palette's sums for each step
  Unroll<3>([&](auto n) PATINA_LAMBDA {
    const F16 step = Set(stride * static_cast<float>(n - 1));
    a[n] = MulAdd(Unquantized(mode, code_a + step), counter_weight, Set(0.5f));
    b[n] = Unquantized(mode, code_b + step) * weight;
  });
  const M16 in_one = MaskOf(s->mask), in_zero = MaskOf(~s->mask & 0xFFFFu);
  const F16 mean_target = Set(p.mean_target[c]);
  F16 sums[16];
  Unroll<8>([&](auto n) PATINA_LAMBDA {
    const F16 palette =
        PaletteOfSums(a[kNeighbours[n][0] + 1] + b[kNeighbours[n][1] + 1]) - mean_target;
    F16 best = Set(3e38f);
    Unroll<kEntries>([&](auto k) PATINA_LAMBDA {
      const F16 d = MulAdd(Lookup(palette, first + SetI(k)), root, Load(centre[k]));
      best = Min(best, MulAdd(d, d, Load(rest[k])));
    });
    sums[n] = ZeroUnless(in_zero, best);
    sums[8 + n] = ZeroUnless(in_one, best);
  });
  const F16 errors = ReduceSums(sums);
  const F16 wanted =
      Select(MaskOf(0xFF00u), Set(s->error[1]), Set(s->error[0])) * Set(1 - kLeastGain);
  const unsigned better = Bits(errors < wanted);
  int chosen[2] = {-1, -1};
  float gain[2] = {};
  alignas(64) float error[16];
  if (better != 0) {
    Store(error, errors);
    for (int r = 0; r < kRegions; ++r) {
      unsigned open = (better >> (8 * r)) & 0xFFu;
      if (open == 0) continue;
      open &= LegalNeighbours<kEntries>(mode, *s, c, r, stride);
      float least = s->error[r];
      for (; open != 0; open &= open - 1) {
        const int n = __builtin_ctz(open);
        if (error[8 * r + n] < least) {
          least = error[8 * r + n];
          chosen[r] = n;
        }
      }
      gain[r] = s->error[r] - least;
    }
  }
  if (chosen[0] < 0 && chosen[1] < 0) {
    ++s->idle;
    return;
  }
  s->idle = 0;
  const auto take = [&](int r) {
    for (int side = 0; side < 2; ++side) {
      s->code[2 * r + side][c] += stride * static_cast<float>(kNeighbours[chosen[r]][side]);
    }
    s->error[r] = error[8 * r + chosen[r]];
  };
  if (chosen[0] >= 0 && chosen[1] >= 0) {
    // Each step is legal alone; together they may part endpoint 0 from region 1.
    const Codes before = *s;
    take(0);
    take(1);
    if (Holds<kEntries>(mode, *s)) return;
    *s = before;
    take(gain[0] >= gain[1] ? 0 : 1);
  } else {
    take(chosen[0] >= 0 ? 0 : 1);
  }
}

// Steps through the channels until none gains, or for `max_steps` channels.
template <int kEntries>
inline void DescendCodes(const Problem& p, const BlockTables& tables, int max_steps, Codes* s) {
  for (int n = 0; n < max_steps && s->idle < 3; ++n) StepChannel<kEntries>(p, tables, 1.0f, s);
}

// The same, with steps of two and of three codes where steps of one gain nothing more.
template <int kEntries>
inline void DescendByStrides(const Problem& p, const BlockTables& tables, int max_steps, Codes* s) {
  for (int n = 0; n < max_steps && s->idle < 9; ++n) {
    StepChannel<kEntries>(p, tables, s->idle < 3 ? 1.0f : s->idle < 6 ? 2.0f : 3.0f, s);
  }
}

}  // namespace
}  // namespace patina::PATINA_SIMD
