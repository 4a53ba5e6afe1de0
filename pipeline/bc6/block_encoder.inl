// The encoder: candidates, ranking, descent. Compiled for each target; see block_encoder.h for what
// it promises.
//
// A funnel, each stage dearer and surer than the one before: 32 partitions by the residual of their
// principal lines; sixteen by least squares; their modes by the cost of rounding; sixteen by exact
// error; eight, four and three by steepest descent on the codes, the last with another round of
// least squares. The sizes were tuned on the blocks of tests/pipeline/bc6/block_samples.h for the
// best error within 25 us.

namespace patina::PATINA_SIMD {
namespace {

using bc6::SearchResult;

inline constexpr int kBatches = 2;
inline constexpr int kFits =
    kBatches * kBatchFits;  // the current partition, one region, and the best of the lines
inline constexpr int kRoundedFits = 10;   // of those, the ones whose modes are looked at
inline constexpr int kExamined = 16;      // rounded fits whose exact error is taken
inline constexpr int kStarted = 8;        // of those, the ones that descend a little, ...
inline constexpr int kContinued = 4;      // ... a little more, ...
inline constexpr int kFinished = 3;       // ... and to the end,
inline constexpr int kQuickStarted = 2;   // the same of a quick encode, which finishes one
inline constexpr float kNearBest = 1.1f;  // if they are as near to the best as that
inline constexpr int kFewSteps = 3;       // channels
inline constexpr int kManySteps = 30;

// What rounding to eight indices leaves of the variance along a line: 1/49 for evenly spread
// points, less for others.
inline constexpr float kIndexStepShare = 0.013f;

inline constexpr float kMinBinades = 1.0f, kMaxBinades = 30.9f;  // of a soft block's endpoints

PATINA_INLINE bool IsOneRegion(const Codes& s) { return s.mode >= 10; }

inline I16 Evaluate(const Problem& p, const BlockTables& tables, Codes* s) {
  return IsOneRegion(*s) ? SearchIndices<16>(p, tables, s) : SearchIndices<8>(p, tables, s);
}

inline void Descend(const Problem& p, const BlockTables& tables, int max_steps, Codes* s) {
  if (IsOneRegion(*s)) {
    DescendCodes<16>(p, tables, max_steps, s);
  } else {
    DescendCodes<8>(p, tables, max_steps, s);
  }
}

inline void DescendFurther(const Problem& p, const BlockTables& tables, Codes* s) {
  if (IsOneRegion(*s)) {
    DescendByStrides<16>(p, tables, kManySteps, s);
  } else {
    DescendByStrides<8>(p, tables, kManySteps, s);
  }
}

// order[k] is the place of the k-th smallest of 16 or 32 values, equals by place. Values must not
// be NaN.
template <int kCount>
PATINA_INLINE void RankValues(const float* value, uint8_t order[kCount]) {
  const F16 low = Load(value), high = Load(value + kCount - 16);
  for (int n = 0; n < kCount; ++n) {
    const F16 own = Set(value[n]);
    uint32_t less = Bits(low < own), greater = Bits(low > own);
    if constexpr (kCount == 32) {
      less |= Bits(high < own) << 16;
      greater |= Bits(high > own) << 16;
    }
    order[__builtin_popcount(less | (~greater & ((1u << n) - 1)))] = static_cast<uint8_t>(n);
  }
}

// Sorts the first `count` by error, equals by place.
inline void SortByError(Codes* codes, int count) {
  for (int n = 1; n < count; ++n) {
    const Codes moved = codes[n];
    int at = n;
    for (; at > 0 && moved.Total() < codes[at - 1].Total(); --at) codes[at] = codes[at - 1];
    codes[at] = moved;
  }
}

PATINA_INLINE float SoftEndpoint(const bc6::SoftBlock& block, int e, int c) {
  return std::max(kMinBinades,
                  std::min(kMaxBinades, block.endpoint[e][c]));  // NaN becomes kMaxBinades
}

// The trainer's block with its endpoints rounded to the nearest codes, in each mode that holds it,
// with either end of region 0 as the base. Returns the best.
inline Codes BestRounding(const Problem& p, const BlockTables& tables,
                          const bc6::SoftBlock& current, int partition) {
  Codes best;
  bool found = false;
  for (int mode = 0; mode < 10; ++mode) {
    const ModeLimits& limits = tables.mode[mode];
    Codes s;
    s.mode = mode;
    s.partition = partition;
    s.mask = tables.mask[partition];
    for (int e = 0; e < 4; ++e) {
      for (int c = 0; c < 3; ++c) {
        // floor(endpoint / step - offset + 0.5), and the offset of these modes is 0.5
        const auto code =
            static_cast<float>(static_cast<int>(SoftEndpoint(current, e, c) * limits.inverse_step));
        s.code[e][c] = std::min(code, limits.max_code);
      }
    }
    if (!Holds<8>(limits, s)) {
      // Where both ends can be the base, they decode the same: SearchIndices then leaves the anchor
      // free.
      for (int c = 0; c < 3; ++c) std::swap(s.code[0][c], s.code[1][c]);
      if (!Holds<8>(limits, s)) continue;
    }
    SearchIndices<8>(p, tables, &s);
    if (!found || s.Total() < best.Total()) best = s;
    found = true;
  }
  return best;
}

// Least squares for the indices that the codes have, rounded to the same modes, with new indices.
// At most eight codes.
inline void Resolve(const Problem& p, const BlockTables& tables, const Codes* codes, int count,
                    Codes* out) {
  LineBatch batch;
  alignas(64) float weight[16][16] = {}, origin[3][16] = {}, span[3][16] = {};
  for (int f = 0; f < count; ++f) {
    Codes s = codes[f];
    const bool one_region = IsOneRegion(s);
    batch.Add(s.partition, s.mask, one_region);
    alignas(64) float own[16];
    Store(own, Lookup(Load(tables.weight[one_region]), Evaluate(p, tables, &s)) * Set(1.0f / 64));
    for (int t = 0; t < 16; ++t) weight[t][2 * f] = weight[t][2 * f + 1] = own[t];
    const ModeLimits& mode = tables.mode[s.mode];
    for (int r = 0; r < (one_region ? 1 : 2); ++r) {
      for (int c = 0; c < 3; ++c) {
        origin[c][2 * f + r] = (s.code[2 * r][c] + mode.offset) * mode.step - p.centre[c];
        span[c][2 * f + r] = (s.code[2 * r + 1][c] - s.code[2 * r][c]) * mode.step;
      }
    }
  }
  TexelWeights w;
  const I16 texels = LoadI(batch.texels);
  for (int t = 0; t < 16; ++t) {
    w.member[t] = MemberOf(texels, t);
    w.weight[t] = Load(weight[t]);
  }
  Segments segments;
  for (int c = 0; c < 3; ++c) {
    segments.origin[c] = Load(origin[c]);
    segments.span[c] = Load(span[c]);
  }
  NormalSums sums;
  SumAtSegments(p, segments, w, &sums);
  Systems systems;
  SolveSystems(sums, &systems);
  for (int f = 0; f < count; ++f) {
    out[f] = {};
    out[f].mode = codes[f].mode;
    out[f].partition = codes[f].partition;
    out[f].mask = codes[f].mask;
    const ModeLimits& mode = tables.mode[codes[f].mode];
    if (IsOneRegion(codes[f])) {
      RoundVariants<1>(systems, f, mode, p.centre, out[f].code);
    } else {
      RoundVariants<2>(systems, f, mode, p.centre, out[f].code);
    }
    Evaluate(p, tables, &out[f]);
  }
}

// Resolves codes that have descended to the end, descends again, and keeps what is better.
inline void ResolveAndDescend(const Problem& p, const BlockTables& tables, Codes* codes,
                              int count) {
  Codes resolved[kBatchFits];
  Resolve(p, tables, codes, count, resolved);
  for (int n = 0; n < count; ++n) {
    Descend(p, tables, kManySteps, &resolved[n]);
    if (resolved[n].Total() < codes[n].Total()) codes[n] = resolved[n];
  }
}

// The exact error with the best indices, as given to the caller; and the fields, with anchors
// fixed.
inline float WriteFields(const Problem& p, const BlockTables& tables, Codes s,
                         bc6h::BlockFields* fields) {
  alignas(64) int32_t lane[16];
  const I16 index = Evaluate(p, tables, &s);
  const float error =
      IsOneRegion(s) ? ExactError<16>(p, tables, s, index) : ExactError<8>(p, tables, s, index);
  StoreI(lane, IsOneRegion(s) ? index : index & SetI(7));
  *fields = {};
  fields->mode = s.mode;
  fields->partition = IsOneRegion(s) ? 0 : s.partition;
  for (int e = 0; e < (IsOneRegion(s) ? 2 : 4); ++e) {
    for (int c = 0; c < 3; ++c) fields->endpoints[e][c] = static_cast<int32_t>(s.code[e][c]);
  }
  for (int t = 0; t < 16; ++t) fields->indices[t] = static_cast<uint8_t>(lane[t]);
  bc6h::FixAnchors(fields);
  return std::max(error * p.inverse_scale, 0.0f);
}

// The fits of a block: sixteen partitions with least-squares endpoints.
struct Fits {
  LineBatch batches[kBatches];
  Systems systems[kBatches];
  int count = 0;

  const LineBatch& Batch(int fit) const { return batches[fit / kBatchFits]; }
};

inline void AddLine(const BlockTables& tables, const PrincipalLines& lines, int entry, Fits* fits) {
  const bool one_region = entry == kWholeBlock;
  LineBatch& batch = fits->batches[fits->count++ / kBatchFits];
  const int f = batch.Add(one_region ? 0 : entry, one_region ? 0u : tables.mask[entry], one_region);
  for (int r = 0; r < 2; ++r) {
    for (int c = 0; c < 3; ++c) {
      batch.origin[c][2 * f + r] = lines.mean[r][c][entry];
      batch.direction[c][2 * f + r] = lines.direction[r][c][entry];
    }
  }
}

// The trainer's own segments, whitened.
inline void AddCurrent(const Problem& p, const BlockTables& tables, const bc6::SoftBlock& current,
                       int partition, Fits* fits) {
  LineBatch& batch = fits->batches[fits->count++ / kBatchFits];
  const int f = batch.Add(partition, tables.mask[partition], false);
  for (int r = 0; r < 2; ++r) {
    float a[3], d[3];
    for (int c = 0; c < 3; ++c) {
      a[c] = SoftEndpoint(current, 2 * r, c) - p.centre[c];
      d[c] = SoftEndpoint(current, 2 * r + 1, c) - SoftEndpoint(current, 2 * r, c);
    }
    const float* l = p.whiten;
    batch.origin[0][2 * f + r] = l[0] * a[0] + l[1] * a[1] + l[2] * a[2];
    batch.origin[1][2 * f + r] = l[3] * a[1] + l[4] * a[2];
    batch.origin[2][2 * f + r] = l[5] * a[2];
    batch.direction[0][2 * f + r] = l[0] * d[0] + l[1] * d[1] + l[2] * d[2];
    batch.direction[1][2 * f + r] = l[3] * d[1] + l[4] * d[2];
    batch.direction[2][2 * f + r] = l[5] * d[2];
    batch.fixed_ends[2 * f + r] = 1.0f;
  }
}

inline void MakeFits(const Problem& p, const BlockTables& tables, const bc6::SoftBlock& current,
                     int partition, Fits* fits) {
  PrincipalLines lines;
  const F16 points[3] = {Load(p.point_of[0]), Load(p.point_of[1]), Load(p.point_of[2])};
  FindPrincipalLines(tables, points, Load(p.weight_of), kIndexStepShare, &lines);
  AddCurrent(p, tables, current, partition, fits);
  AddLine(tables, lines, kWholeBlock, fits);
  uint8_t order[32];
  RankValues<32>(lines.residual, order);
  for (int n = 0; fits->count < kFits; ++n) {
    if (order[n] != partition) AddLine(tables, lines, order[n], fits);
  }
  for (int g = 0; g < kBatches; ++g) {
    Systems& systems = fits->systems[g];
    TexelWeights weights;
    NormalSums sums;
    WeightsOnLines(p, fits->batches[g], &weights);
    SumAtTarget(p, weights, &sums);
    SolveSystems(sums, &systems);
    const Segments segments = SegmentsOf(systems);
    ProjectTexels(p, fits->batches[g], segments, &weights);
    SumAtSegments(p, segments, weights, &sums);
    SolveSystems(sums, &systems);
  }
}

// The fits in the modes that cost them least, by estimate, at most two modes a fit: kExamined codes
// in the order of their exact errors. Returns their number; *soft_partition becomes the best
// two-region fit's partition.
inline int ExamineModes(const Problem& p, const BlockTables& tables, const Fits& fits,
                        Codes codes[kExamined], int* soft_partition) {
  static_assert(kFits == 16);
  alignas(64) float fit_error[16];
  for (int n = 0; n < 16; ++n) {
    const float* error =
        fits.systems[n / kBatchFits].error + 2 * (n % kBatchFits);  // zero without texels
    // One region has finer indices and codes, so its modes are always worth a look.
    fit_error[n] = fits.Batch(n).one_region[n % kBatchFits] ? 0.0f : error[0] + error[1];
  }
  uint8_t fit_order[16];
  RankValues<16>(fit_error, fit_order);

  RoundedModes rounded[kRoundedFits];
  alignas(64) float estimate[32];
  uint8_t lane[32];
  std::fill(estimate, estimate + 32, 3e38f);
  *soft_partition = -1;
  for (int n = 0; n < kRoundedFits; ++n) {
    const int f = fit_order[n] % kBatchFits;
    const LineBatch& batch = fits.Batch(fit_order[n]);
    const Systems& systems = fits.systems[fit_order[n] / kBatchFits];
    const ModeLanes& modes = tables.lanes[batch.one_region[f]];
    if (batch.one_region[f]) {
      RoundToModes<1>(systems, f, modes, p.centre, &rounded[n]);
    } else {
      RoundToModes<2>(systems, f, modes, p.centre, &rounded[n]);
      if (*soft_partition < 0) *soft_partition = batch.partition[f];
    }
    F16 left = Select(MaskOf((1u << modes.count) - 1), Load(rounded[n].estimate), Set(3e38f));
    for (int k = 0; k < 2; ++k) {
      const float least = -ReduceMax(Zero() - left);
      const unsigned at = ~Bits(left > Set(least)) & 0xFFFFu;
      const int l = __builtin_ctz(at | 0x10000u) & 15;
      estimate[2 * n + k] = least;
      lane[2 * n + k] = static_cast<uint8_t>(l);
      left = Select(MaskOf(1u << l), Set(3e38f), left);
    }
  }
  uint8_t order[32];
  RankValues<32>(estimate, order);
  static_assert(2 * kRoundedFits >= kExamined);
  for (int k = 0; k < kExamined; ++k) {
    const int n = order[k] / 2, l = lane[order[k]];
    const int f = fit_order[n] % kBatchFits;
    const LineBatch& batch = fits.Batch(fit_order[n]);
    Codes& s = codes[k];
    s.mode = tables.lanes[batch.one_region[f]].first_mode + l;
    s.partition = batch.partition[f];
    s.mask = batch.mask[f];
    for (int e = 0; e < (batch.one_region[f] ? 2 : 4); ++e) {
      for (int c = 0; c < 3; ++c) s.code[e][c] = rounded[n].code[e][c][l];
    }
    Evaluate(p, tables, &s);
  }
  SortByError(codes, kExamined);
  return kExamined;
}

// From kExamined codes in order to the best of them, descended to the end, in front.
inline void DescendByElimination(const Problem& p, const BlockTables& tables, Codes* codes) {
  int count = kStarted;
  for (int n = 0; n < count; ++n) Descend(p, tables, kFewSteps, &codes[n]);
  SortByError(codes, count);
  count = kContinued;
  for (int n = 0; n < count; ++n) Descend(p, tables, kFewSteps, &codes[n]);
  SortByError(codes, count);
  count = 1;
  while (count < kFinished && codes[count].Total() < codes[0].Total() * kNearBest) ++count;
  for (int n = 0; n < count; ++n) Descend(p, tables, kManySteps, &codes[n]);
  ResolveAndDescend(p, tables, codes, count);
  SortByError(codes, count);
  DescendFurther(p, tables, &codes[0]);
}

inline void EncodeKernel(const WeightedTarget& target, const bc6::SoftBlock& current,
                         bc6::Effort effort, SearchResult* result) noexcept {
  const BlockTables& tables = bc6::Tables();
  const int partition = std::clamp(current.partition, 0, bc6h::kPartitionCount - 1);
  Problem p;
  PrepareProblem(target, &p);
  Fits fits;
  MakeFits(p, tables, current, partition, &fits);
  Codes codes[kExamined];
  ExamineModes(p, tables, fits, codes, &result->soft_partition);

  if (effort == bc6::Effort::kQuick) {
    for (int n = 0; n < kQuickStarted; ++n) Descend(p, tables, kFewSteps, &codes[n]);
    SortByError(codes, kQuickStarted);
    Descend(p, tables, kManySteps, &codes[0]);
  } else {
    DescendByElimination(p, tables, codes);
  }
  result->error = WriteFields(p, tables, codes[0], &result->fields);

  bc6h::BlockFields plain;
  const float plain_error =
      WriteFields(p, tables, BestRounding(p, tables, current, partition), &plain);
  if (plain_error < result->error) {
    result->error = plain_error;
    result->fields = plain;
  }
}

inline void RefineKernel(const WeightedTarget& target, const bc6h::BlockFields& current,
                         SearchResult* result) noexcept {
  const BlockTables& tables = bc6::Tables();
  Problem p;
  PrepareProblem(target, &p);
  Codes start;
  start.mode = current.mode;
  start.partition = current.partition;
  start.mask = IsOneRegion(start) ? 0u : tables.mask[current.partition];
  for (int e = 0; e < (IsOneRegion(start) ? 2 : 4); ++e) {
    for (int c = 0; c < 3; ++c) start.code[e][c] = static_cast<float>(current.endpoints[e][c]);
  }
  alignas(64) int32_t given[16];
  for (int t = 0; t < 16; ++t)
    given[t] = current.indices[t] + 8 * static_cast<int>((start.mask >> t) & 1);
  const float given_error = IsOneRegion(start) ? ExactError<16>(p, tables, start, LoadI(given))
                                               : ExactError<8>(p, tables, start, LoadI(given));
  result->fields = current;
  result->error = std::max(given_error * p.inverse_scale, 0.0f);
  result->soft_partition = current.partition;

  const ModeLimits& mode = tables.mode[start.mode];
  // Blocks of others may use that deltas wrap round; those stay as they are.
  if (!(IsOneRegion(start) ? Holds<16>(mode, start) : Holds<8>(mode, start))) return;
  Evaluate(p, tables, &start);
  Codes codes[2] = {start, {}};
  Resolve(p, tables, codes, 1, codes + 1);
  for (Codes& s : codes) Descend(p, tables, kManySteps, &s);
  SortByError(codes, 2);
  ResolveAndDescend(p, tables, codes, 1);
  DescendFurther(p, tables, &codes[0]);
  bc6h::BlockFields found;
  const float error = WriteFields(p, tables, codes[0], &found);
  if (error < result->error) {
    result->error = error;
    result->fields = found;
  }
}

}  // namespace
}  // namespace patina::PATINA_SIMD
