// Endpoints by weighted least squares, sixteen regions at once, and their rounding to codes. Works
// in binades with a quadratic model of the cost, so it is an estimate; the palette search has the
// last word. Compiled for each target.

namespace patina::PATINA_SIMD {
namespace {

// Eight partitions with lines for their regions: lane 2*f + r is region r of fit f. Unused lanes
// have no texels.
inline constexpr int kBatchFits = 8;

struct LineBatch {
  int count = 0;
  int partition[kBatchFits] = {};
  uint16_t mask[kBatchFits] = {};  // texels of region 1
  bool one_region[kBatchFits] = {};
  alignas(64) int32_t texels[16] = {};      // bit t: texel t belongs to the lane's region
  alignas(64) float levels[16] = {};        // largest index: 7 or 15
  alignas(64) float origin[3][16] = {};     // a point of the line ...
  alignas(64) float direction[3][16] = {};  // ... and its direction, in the whitened space
  alignas(64) float fixed_ends[16] =
      {};  // 1: the segment is origin..origin + direction; 0: as long as needed

  // Adds a fit of two regions, or of one (mask 0), without its lines. Returns its number.
  int Add(int partition_number, unsigned region_mask, bool is_one_region) {
    const int f = count++;
    partition[f] = partition_number;
    mask[f] = static_cast<uint16_t>(region_mask);
    one_region[f] = is_one_region;
    texels[2 * f] = static_cast<int32_t>(~region_mask & 0xFFFFu);
    texels[2 * f + 1] = static_cast<int32_t>(region_mask);
    levels[2 * f] = levels[2 * f + 1] = is_one_region ? 15.0f : 7.0f;
    return f;
  }
};

// Per texel, a lane each region: membership (0 or 1), and the weight of the second endpoint (0 for
// other texels).
struct TexelWeights {
  F16 member[16];
  F16 weight[16];
};

PATINA_INLINE F16 MemberOf(I16 texels, int t) {
  const I16 bit = SetI(1 << t);
  return ZeroUnless(EqualI(texels & bit, bit), Set(1.0f));
}

// Positions 0..1 to the weight of the nearest index.
PATINA_INLINE F16 WeightOfNearestIndex(F16 position, F16 levels, F16 weights_a_level) {
  const F16 index = ToFloat(RoundToInt(position * levels));
  return ToFloat(RoundToInt(index * weights_a_level)) * Set(1.0f / 64);
}

// Turns region 0 round where texel 0 lies in its second half: the anchor rule. Call for texel 0
// first.
PATINA_INLINE F16 TurnToAnchor(int t, F16 member, F16 weight, M16* turned) {
  if (t == 0) *turned = (member * weight) > Set(0.5f);
  return member * Select(*turned, Set(1.0f) - weight, weight);
}

// Index weights by projection on the lines in the whitened space.
inline void WeightsOnLines(const Problem& p, const LineBatch& batch, TexelWeights* out) {
  const I16 texels = LoadI(batch.texels);
  const F16 levels = Load(batch.levels), weights_a_level = Set(64.0f) / Max(levels, Set(1.0f));
  F16 origin[3], direction[3];
  for (int c = 0; c < 3; ++c) {
    origin[c] = Load(batch.origin[c]);
    direction[c] = Load(batch.direction[c]);
  }
  const F16 per_length = Set(1.0f) / Max(Dot(direction, direction), Set(0x1p-100f));
  const float light = 1e-3f * p.mean_weight;
  F16 along[16], least = Zero(), most = Zero();
  for (int t = 0; t < 16; ++t) {
    F16 offset[3];
    for (int c = 0; c < 3; ++c) offset[c] = Set(p.point_of[c][t]) - origin[c];
    along[t] = Dot(offset, direction) * per_length;
    out->member[t] = MemberOf(texels, t);
    if (p.weight_of[t] < light) continue;  // texels that hardly count do not set the ends
    const F16 own = out->member[t] * along[t];
    least = Min(least, own);
    most = Max(most, own);
  }
  const M16 fixed = Load(batch.fixed_ends) > Set(0.5f);
  least = Select(fixed, Zero(), least);
  const F16 per_range = Select(fixed, Set(1.0f), Set(1.0f) / Max(most - least, Set(0x1p-60f)));
  M16 turned = MaskOf(0);
  for (int t = 0; t < 16; ++t) {
    const F16 position = Min(Max((along[t] - least) * per_range, Zero()), Set(1.0f));
    out->weight[t] = TurnToAnchor(t, out->member[t],
                                  WeightOfNearestIndex(position, levels, weights_a_level), &turned);
  }
}

// The normal equations of a batch, a lane each region. The unknowns are the second endpoint (x, y,
// z), then the first, in binades minus the centre. factor[i*(i-1)/2 + j] is L of L D L^T, pivot is
// D.
struct Systems {
  alignas(64) float solution[6][16];
  alignas(64) float factor[15][16];
  alignas(64) float pivot[6][16];
  alignas(64) float error[16];  // at the solution
};

// Sums over a region's texels with weights 1, v and v^2 (v: of the second endpoint).
struct NormalSums {
  F16 all[6], first[6], second[6];  // of the curvature
  F16 pull_all[3], pull_first[3];
  F16 energy;  // of position . pull
};

PATINA_INLINE void ClearSums(NormalSums* sums) {
  for (int q = 0; q < 6; ++q) sums->all[q] = sums->first[q] = sums->second[q] = Zero();
  for (int c = 0; c < 3; ++c) sums->pull_all[c] = sums->pull_first[c] = Zero();
  sums->energy = Zero();
}

// Sums with the curvature at the target; no energy.
inline void SumAtTarget(const Problem& p, const TexelWeights& w, NormalSums* out) {
  NormalSums sums;
  ClearSums(&sums);
  for (int t = 0; t < 16; ++t) {
    const F16 member = w.member[t], first = w.weight[t], second = first * first;
    Unroll<6>([&](auto q) PATINA_LAMBDA {
      const F16 curvature = Set(p.curvature_of[q][t]);
      sums.all[q] = MulAdd(member, curvature, sums.all[q]);
      sums.first[q] = MulAdd(first, curvature, sums.first[q]);
      sums.second[q] = MulAdd(second, curvature, sums.second[q]);
    });
    Unroll<3>([&](auto c) PATINA_LAMBDA {
      const F16 pull = Set(p.pull_of[c][t]);
      sums.pull_all[c] = MulAdd(member, pull, sums.pull_all[c]);
      sums.pull_first[c] = MulAdd(first, pull, sums.pull_first[c]);
    });
  }
  *out = sums;
}

// The segments of a batch, a lane each region: origin + v * span, in binades minus the centre.
struct Segments {
  F16 origin[3], span[3];
};

PATINA_INLINE Segments SegmentsOf(const Systems& systems) {
  Segments s;
  for (int c = 0; c < 3; ++c) {
    s.origin[c] = Load(systems.solution[3 + c]);
    s.span[c] = Load(systems.solution[c]) - s.origin[c];
  }
  return s;
}

// The best index weights on given segments, by projection in the curvature at the target. Region 0
// is not turned.
inline void ProjectTexels(const Problem& p, const LineBatch& batch, const Segments& s,
                          TexelWeights* w) {
  const F16 levels = Load(batch.levels), weights_a_level = Set(64.0f) / Max(levels, Set(1.0f));
  for (int t = 0; t < 16; ++t) {
    F16 curvature[6], pull[3], image[3];
    for (int q = 0; q < 6; ++q) curvature[q] = Set(p.curvature_of[q][t]);
    for (int c = 0; c < 3; ++c) pull[c] = Set(p.pull_of[c][t]);
    Multiply(curvature, s.span, image);
    const F16 along = Dot(s.span, pull) - Dot(image, s.origin);
    const F16 position =
        Min(Max(along / Max(Dot(s.span, image), Set(0x1p-120f)), Zero()), Set(1.0f));
    w->weight[t] = WeightOfNearestIndex(position, levels, weights_a_level);
  }
}

// Sums with the curvature of secants between the target and the place on the segment: with them the
// quadratic model is exact there, on whichever side of a power of two. Then region 0 is turned to
// its anchor.
inline void SumAtSegments(const Problem& p, const Segments& s, const TexelWeights& w,
                          NormalSums* out) {
  NormalSums sums;
  ClearSums(&sums);
  M16 turned = MaskOf(0);
  const F16 near = Set(0x1p-10f);
  for (int t = 0; t < 16; ++t) {
    F16 run[3], rise[3];
    for (int c = 0; c < 3; ++c) {
      const F16 place = MulAdd(w.weight[t], s.span[c], s.origin[c]);
      const F16 value = FromBinades(Min(Max(place + Set(p.centre[c]), Zero()), Set(31.0f)));
      const F16 distance = place - Set(p.position_of[c][t]);
      const M16 far = Abs(distance) > near;
      run[c] = Select(far, distance, Set(1.0f));
      rise[c] = Select(far, value - Set(p.target_of[c][t]), Set(p.slope_of[c][t]));
    }
    const F16 run01 = run[0] * run[1];
    const F16 inverse = Set(1.0f) / (run01 * run[2]);
    const F16 inverse01 = inverse * run[2];
    const F16 slope[3] = {rise[0] * (run[1] * inverse01), rise[1] * (run[0] * inverse01),
                          rise[2] * (run01 * inverse)};
    const F16 member = w.member[t];
    const F16 first = TurnToAnchor(t, member, w.weight[t], &turned), second = first * first;
    F16 curvature[6], position[3], pull[3];
    Unroll<3>([&](auto r) PATINA_LAMBDA {
      Unroll<3 - r>([&](auto n) PATINA_LAMBDA {
        constexpr int c = r + n, q = kSymmetric[r][c];
        curvature[q] = Set(p.hessian_of[q][t]) * (slope[r] * slope[c]);
        sums.all[q] = MulAdd(member, curvature[q], sums.all[q]);
        sums.first[q] = MulAdd(first, curvature[q], sums.first[q]);
        sums.second[q] = MulAdd(second, curvature[q], sums.second[q]);
      });
      position[r] = Set(p.position_of[r][t]);
    });
    Multiply(curvature, position, pull);
    sums.energy = MulAdd(member, Dot(position, pull), sums.energy);
    Unroll<3>([&](auto c) PATINA_LAMBDA {
      sums.pull_all[c] = MulAdd(member, pull[c], sums.pull_all[c]);
      sums.pull_first[c] = MulAdd(first, pull[c], sums.pull_first[c]);
    });
  }
  *out = sums;
}

inline void SolveSystems(const NormalSums& sums, Systems* out) {
  F16 cc[6], ca[6], aa[6], rhs[6];  // curvature sums with weights v v, (1-v) v and (1-v) (1-v)
  for (int q = 0; q < 6; ++q) {
    cc[q] = sums.second[q];
    ca[q] = sums.first[q] - cc[q];
    aa[q] = sums.all[q] - sums.first[q] - ca[q];
  }
  for (int c = 0; c < 3; ++c) {
    rhs[c] = sums.pull_first[c];
    rhs[3 + c] = sums.pull_all[c] - rhs[c];
  }

  // A weak spring holds the endpoints together, and a weaker one holds both at the centre, where
  // the data do not say.
  const F16 trace = (aa[0] + aa[3] + aa[5]) + (cc[0] + cc[3] + cc[5]);
  const F16 spring = trace * Set(1e-6f), anchor = MulAdd(trace, Set(1e-7f), Set(1e-30f));
  F16 g[6][6];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c <= r; ++c) {
      const int q = kSymmetric[r][c];
      const F16 add = r == c ? spring + anchor : Zero();
      g[r][c] = cc[q] + add;
      g[3 + r][3 + c] = aa[q] + add;
      g[3 + r][c] = r == c ? ca[q] - spring : ca[q];
      g[3 + c][r] = g[3 + r][c];
    }
  }
  F16 l[6][6], ld[6][6], d[6], inverse[6];
  Unroll<6>([&](auto j) PATINA_LAMBDA {
    F16 pivot = g[j][j];
    Unroll<j>([&](auto k) PATINA_LAMBDA { pivot = NegMulAdd(l[j][k], ld[j][k], pivot); });
    d[j] = Max(pivot, MulAdd(g[j][j], Set(1e-7f), Set(1e-34f)));
    inverse[j] = Set(1.0f) / d[j];
    Unroll<5 - j>([&](auto step) PATINA_LAMBDA {
      constexpr int i = j + 1 + step;
      F16 sum = g[i][j];
      Unroll<j>([&](auto k) PATINA_LAMBDA { sum = NegMulAdd(ld[i][k], l[j][k], sum); });
      ld[i][j] = sum;
      l[i][j] = sum * inverse[j];
    });
  });
  F16 x[6];
  Unroll<6>([&](auto i) PATINA_LAMBDA {
    x[i] = rhs[i];
    Unroll<i>([&](auto k) PATINA_LAMBDA { x[i] = NegMulAdd(l[i][k], x[k], x[i]); });
  });
  F16 gained = Zero();
  Unroll<6>([&](auto i) PATINA_LAMBDA {
    const F16 z = x[i];
    x[i] = z * inverse[i];
    gained = MulAdd(z, x[i], gained);
  });
  Unroll<6>([&](auto back) PATINA_LAMBDA {
    constexpr int i = 5 - back;
    Unroll<5 - i>([&](auto step) PATINA_LAMBDA {
      constexpr int k = i + 1 + step;
      x[i] = NegMulAdd(l[k][i], x[k], x[i]);
    });
  });
  Store(out->error, Max(sums.energy - gained, Zero()));
  Unroll<6>([&](auto i) PATINA_LAMBDA {
    Store(out->solution[i], x[i]);
    Store(out->pivot[i], d[i]);
    Unroll<i>([&](auto k) PATINA_LAMBDA { Store(out->factor[i * (i - 1) / 2 + k], l[i][k]); });
  });
}

// The endpoints of a fit rounded to the codes of every mode, a mode a lane.
struct RoundedModes {
  alignas(64) float code[4][3][16];
  alignas(64) float estimate[16];  // the fit's error plus what the rounding costs at these index
                                   // weights
};

// Successive rounding (Babai's nearest plane): each unknown takes the code nearest to its optimum
// given those already taken, within the reach of the deltas. Endpoint 0 goes first because the
// reach starts there.
template <int kRegions>
inline void RoundToModes(const Systems& systems, int f, const ModeLanes& lanes,
                         const float centre[3], RoundedModes* out) {
  const F16 step = Load(lanes.step), inverse_step = Load(lanes.inverse_step),
            offset = Load(lanes.offset);
  const F16 max_code = Load(lanes.max_code);
  F16 cost = Set(systems.error[2 * f]) + Set(kRegions == 2 ? systems.error[2 * f + 1] : 0.0f);
  F16 base[3];
  Unroll<kRegions>([&](auto r) PATINA_LAMBDA {
    const int s = 2 * f + r;
    F16 miss[6];
    Unroll<6>([&](auto back) PATINA_LAMBDA {
      constexpr int i = 5 - back;
      constexpr int c = i % 3;
      const F16 half_range = Load(lanes.half_range[c]);
      const float solution = systems.solution[i][s];
      F16 wanted = Set(solution);
      Unroll<5 - i>([&](auto ahead) PATINA_LAMBDA {
        constexpr int k = i + 1 + ahead;
        wanted = NegMulAdd(Set(systems.factor[k * (k - 1) / 2 + i][s]), miss[k], wanted);
      });
      F16 code = MulAdd(wanted + Set(centre[c]), inverse_step, Zero() - offset);
      F16 low = Zero(), high = max_code;
      if constexpr (r == 0 && i >= 3) {
        // The codes from which every other endpoint is in reach, as far as there are any.
        const float* second = systems.solution[c] + 2 * f;
        const float* first = systems.solution[3 + c] + 2 * f;
        const int last = kRegions - 1;
        const float least =
            std::min(std::min(first[0], second[0]), std::min(first[last], second[last]));
        const float most =
            std::max(std::max(first[0], second[0]), std::max(first[last], second[last]));
        const F16 from =
            MulAdd(Set(most + centre[c]), inverse_step, Set(1.0f) - half_range - offset);
        const F16 to = MulAdd(Set(least + centre[c]), inverse_step, half_range - offset);
        code = Min(Max(code, Min(from, to)), Max(from, to));
      } else {
        low = Max(low, base[c] - half_range);
        high = Min(high, base[c] + half_range - Set(1.0f));
      }
      code = Min(Max(ToFloat(RoundToInt(code)), low), high);
      if constexpr (r == 0 && i >= 3) base[c] = code;
      const F16 value = MulAdd(code + offset, step, Set(-centre[c]));
      miss[i] = value - Set(solution);
      const F16 slip = value - wanted;
      cost = MulAdd(Set(systems.pivot[i][s]) * slip, slip, cost);
      Store(out->code[2 * r + (i < 3 ? 1 : 0)][c], code);
    });
  });
  Store(out->estimate, cost);
}

// As RoundToModes for one mode, but with sixteen variants a region: the four unknowns that are
// decided first, the cheapest to miss, take the nearest code or the second nearest. Keeps the best
// variant. Returns its estimate.
template <int kRegions>
inline float RoundVariants(const Systems& systems, int f, const ModeLimits& mode,
                           const float centre[3], float code_out[4][3]) {
  const float step = mode.step, inverse_step = mode.inverse_step;
  F16 base[3];
  float total = 0;
  Unroll<kRegions>([&](auto r) PATINA_LAMBDA {
    const int s = 2 * f + r;
    F16 miss[6], codes[6];
    F16 cost = Set(systems.error[s]);
    Unroll<6>([&](auto back) PATINA_LAMBDA {
      constexpr int i = 5 - back;
      constexpr int c = i % 3;
      const float solution = systems.solution[i][s];
      F16 wanted = Set(solution);
      Unroll<5 - i>([&](auto ahead) PATINA_LAMBDA {
        constexpr int k = i + 1 + ahead;
        wanted = NegMulAdd(Set(systems.factor[k * (k - 1) / 2 + i][s]), miss[k], wanted);
      });
      F16 code = MulAdd(wanted + Set(centre[c]), Set(inverse_step), Set(-mode.offset));
      F16 low = Zero(), high = Set(mode.max_code);
      if (mode.transformed) {
        const float half_range = mode.half_range[c];
        if constexpr (r == 0 && i >= 3) {
          const float* second = systems.solution[c] + 2 * f;
          const float* first = systems.solution[3 + c] + 2 * f;
          const int last = kRegions - 1;
          const float least =
              std::min(std::min(first[0], second[0]), std::min(first[last], second[last]));
          const float most =
              std::max(std::max(first[0], second[0]), std::max(first[last], second[last]));
          const float from = (most + centre[c]) * inverse_step + 1.0f - half_range - mode.offset;
          const float to = (least + centre[c]) * inverse_step + half_range - mode.offset;
          code = Min(Max(code, Set(std::min(from, to))), Set(std::max(from, to)));
        } else {
          low = Max(low, base[c] - Set(half_range));
          high = Min(high, base[c] + Set(half_range - 1));
        }
      }
      F16 rounded = ToFloat(RoundToInt(code));
      if constexpr (i >= 2) {
        constexpr unsigned kFlip[4] = {0xAAAA, 0xCCCC, 0xF0F0, 0xFF00};
        const F16 other = Select(code > rounded, rounded + Set(1.0f), rounded - Set(1.0f));
        rounded = Select(MaskOf(kFlip[5 - i]), other, rounded);
      }
      rounded = Min(Max(rounded, low), high);
      if constexpr (r == 0 && i >= 3) base[c] = rounded;
      const F16 value = MulAdd(rounded + Set(mode.offset), Set(step), Set(-centre[c]));
      miss[i] = value - Set(solution);
      const F16 slip = value - wanted;
      cost = MulAdd(Set(systems.pivot[i][s]) * slip, slip, cost);
      codes[i] = rounded;
    });
    alignas(64) float by_lane[16];
    Store(by_lane, cost);
    int best = 0;
    for (int l = 1; l < 16; ++l) {
      if (by_lane[l] < by_lane[best]) best = l;
    }
    total += by_lane[best];
    const I16 pick = SetI(best);
    Unroll<6>([&](auto i) PATINA_LAMBDA {
      alignas(64) float picked[16];
      codes[i] = Lookup(codes[i], pick);
      Store(picked, codes[i]);
      code_out[2 * r + (i < 3 ? 1 : 0)][i % 3] = picked[0];
      if constexpr (r == 0 && i >= 3) base[i % 3] = codes[i];
    });
  });
  return total;
}

}  // namespace
}  // namespace patina::PATINA_SIMD
