// A window from features to loss and back, in SIMD, for one target. See window_kernels.h and window.h.

namespace patina::PATINA_SIMD {

inline constexpr int kPitch = WindowScratch::kTilePitch;
inline constexpr int kTilePlane = WindowScratch::kTileRows * kPitch;
inline constexpr int kSlack = 4;  // texels of room on each side of a tile, so that whole blocks can be written

// --- forward: blocks -> tile -> rows -> network inputs ---

// Four texels: row kRow of a block.
template <int kRow>
PATINA_INLINE __m128 TexelRow(F16 texels) {
#if defined(PATINA_SIMD_IS_AVX512)
  return _mm512_extractf32x4_ps(texels.v, kRow);
#else
  return _mm256_extractf128_ps(kRow < 2 ? texels.lo : texels.hi, kRow % 2);
#endif
}

// Decodes the blocks around a window into scratch->tile: [3][extent_y][kPitch], column kSlack is texel x.first.
template <BlockForm kForm>
PATINA_STAGE void DecodeTile(const LevelTaps& taps, AddressMode address, WindowScratch* scratch) {
  const FeatureLevel& level = *taps.level;
  for (int j = 0; j < taps.y.decode_count; ++j) {
    const AxisTaps::BlockSpan& ys = taps.y.decode[j];
    const int row0 = ys.start - taps.y.first;
    for (int i = 0; i < taps.x.decode_count; ++i) {
      const AxisTaps::BlockSpan& xs = taps.x.decode[i];
      const int block = ys.block * level.blocks_x + xs.block;
      F16 value[3];
      DecodeTexels<kForm>(level.params.data() + static_cast<size_t>(block) * BlockStride(kForm),
                          kPartitionMasks[level.partition[block]], value);
      float* at = scratch->tile + row0 * kPitch + kSlack + xs.start - taps.x.first;
      if (row0 >= 0 && row0 + 4 <= taps.y.extent && ys.count == 4) {
        Unroll<3>([&](auto c) PATINA_LAMBDA {
          Unroll<4>([&](auto r) PATINA_LAMBDA { _mm_storeu_ps(at + c * kTilePlane + r * kPitch, TexelRow<r>(value[c])); });
        });
        continue;
      }
      Unroll<3>([&](auto c) PATINA_LAMBDA {
        Unroll<4>([&](auto r) PATINA_LAMBDA {
          if (r < ys.count && static_cast<unsigned>(row0 + r) < static_cast<unsigned>(taps.y.extent)) {
            _mm_storeu_ps(at + c * kTilePlane + r * kPitch, TexelRow<r>(value[c]));
          }
        });
      });
    }
  }
  if (address != AddressMode::kClamp) return;
  // Texels beyond the edge repeat the edge.
  const int x0 = taps.x.canonical_first - taps.x.first, x1 = x0 + taps.x.canonical_extent;
  const int y0 = taps.y.canonical_first - taps.y.first, y1 = y0 + taps.y.canonical_extent;
  for (int c = 0; c < 3; ++c) {
    float* plane = scratch->tile + c * kTilePlane + kSlack;
    for (int y = y0; y < y1; ++y) {
      for (int x = 0; x < x0; ++x) plane[y * kPitch + x] = plane[y * kPitch + x0];
      for (int x = x1; x < taps.x.extent; ++x) plane[y * kPitch + x] = plane[y * kPitch + x1 - 1];
    }
    for (int y = 0; y < taps.y.extent; ++y) {
      if (y >= y0 && y < y1) continue;
      const float* from = plane + (y < y0 ? y0 : y1 - 1) * kPitch;
      for (int x = 0; x < taps.x.extent; ++x) plane[y * kPitch + x] = from[x];
    }
  }
}

// scratch->tile -> rows [3][extent_y][64], interpolated along x.
PATINA_STAGE void InterpolateX(const LevelTaps& taps, int cols, const float* tile, float* rows) {
  const AxisTaps& x = taps.x;
  for (int g = 0; g < cols / 16; ++g) {
    const int base = x.index[16 * g];
    const F16 weight = Load(x.weight + 16 * g);
    const I16 left = LoadI(x.index + 16 * g) - SetI(base);
    const I16 right = left + SetI(1);
    const bool narrow = x.index[16 * g + 15] - base < 15;
    for (int c = 0; c < 3; ++c) {
      const float* in = tile + c * kTilePlane + kSlack + base;
      float* out = rows + c * taps.y.extent * kWindowSide + 16 * g;
      for (int r = 0; r < taps.y.extent; ++r, in += kPitch, out += kWindowSide) {
        if (x.identity) {
          Store(out, LoadU(in));
        } else if (x.contiguous) {
          const F16 a = LoadU(in), b = LoadU(in + 1);
          Store(out, MulAdd(weight, b - a, a));
        } else if (narrow) {
          const F16 texels = LoadU(in);
          const F16 a = Lookup(texels, left), b = Lookup(texels, right);
          Store(out, MulAdd(weight, b - a, a));
        } else {
          const F16 low = LoadU(in), high = LoadU(in + 16);
          const F16 a = Lookup2(low, high, left), b = Lookup2(low, high, right);
          Store(out, MulAdd(weight, b - a, a));
        }
      }
    }
  }
}

PATINA_INLINE F16 InterpolateY(const AxisTaps& y, const float* column, int r) {
  const float* at = column + y.index[r] * kWindowSide;
  const F16 a = Load(at);
  if (y.identity) return a;
  return MulAdd(Set(y.weight[r]), Load(at + kWindowSide) - a, a);
}

// Network inputs of vectors first .. first+count-1 of the window; a vector is 16 columns of a sample row.
PATINA_STAGE void GatherInputs(const WindowPlan& plan, const WindowScratch& scratch, int first, int count, float* x) {
  const int groups = plan.cols / 16;
  int row[kChunkVectors], column[kChunkVectors];
  for (int v = 0, r = first / groups, g = first % groups; v < count; ++v) {
    row[v] = r;
    column[v] = 16 * g;
    if (++g == groups) {
      g = 0;
      ++r;
    }
  }
  for (int k = 0; k < plan.level_count; ++k) {
    const LevelTaps& taps = plan.levels[k];
    const size_t plane = static_cast<size_t>(taps.y.extent) * kWindowSide;
    const bool blended = k > 0 && plan.levels[k - 1].texture == taps.texture;
    const bool whole = taps.weight == 1.0f;
    const F16 weight = Set(taps.weight);
    for (int v = 0; v < count; ++v) {
      Unroll<3>([&](auto c) PATINA_LAMBDA {
        const F16 value = InterpolateY(taps.y, scratch.rows[k] + c * plane + column[v], row[v]);
        float* out = x + (3 * taps.texture + c) * kChunkSamples + v * 16;
        if (whole) {
          Store(out, value);
        } else if (blended) {
          Store(out, MulAdd(weight, value, Load(out)));
        } else {
          Store(out, weight * value);
        }
      });
    }
  }
  for (int v = count; v < kChunkVectors; ++v) {
    for (int i = 0; i < mlp::kInputs; ++i) Store(x + i * kChunkSamples + v * 16, Zero());
  }
}

template <BlockForm kForm>
PATINA_INLINE void PrepareRows(const WindowPlan& plan, WindowScratch* scratch) {
  for (int k = 0; k < plan.level_count; ++k) {
    DecodeTile<kForm>(plan.levels[k], plan.address, scratch);
    InterpolateX(plan.levels[k], plan.cols, scratch->tile, scratch->rows[k]);
  }
}

// --- the target ---

// One line of a target channel from unwrapped column `first`, `count` texels, to `out`.
PATINA_INLINE void TargetLine(const TargetLevel& level, AddressMode address, int row, int channel, int first, int count,
                              float* out) {
  if (address == AddressMode::kWrap && first < 0) first += level.width * ((level.width - 1 - first) / level.width);
  if (first >= 0 && first + count <= level.row_blocks * 16) {
    const float* in = level.Block(first >> 4, row) + channel * 16;
    const int shift = first & 15, step = level.channels * 16;
    for (int k = -shift; k < count; k += 16, in += step) StoreU(out + k, Load(in));
    return;
  }
  for (int k = 0; k < count; ++k) {
    int x = first + k;
    x = address == AddressMode::kWrap ? x % level.width : (x < 0 ? 0 : (x >= level.width ? level.width - 1 : x));
    out[k] = level.At(x, row, channel);
  }
}

PATINA_INLINE int AddressRow(int row, int height, AddressMode address) {
  if (address == AddressMode::kClamp) return row < 0 ? 0 : (row >= height ? height - 1 : row);
  row %= height;
  return row < 0 ? row + height : row;
}

// Bicubic (Catmull-Rom) within each of up to two mips, linear between them: F(M)(u, v, s) of Weinreich 2024, section 5.1.
PATINA_STAGE void FilterTarget(const WindowPlan& plan, WindowScratch* scratch, float* out) {
  const int groups = plan.cols / 16, channels = plan.target->channels;
  for (int k = 0; k < (plan.target_next ? 2 : 1); ++k) {
    const TargetLevel& level = k == 0 ? *plan.target : *plan.target_next;
    const FilterTaps& fx = plan.filter_x[k];
    const FilterTaps& fy = plan.filter_y[k];
    float* line = scratch->filter_line + 16;
    for (int r = 0; r < fy.extent; ++r) {
      const int row = AddressRow(fy.first + r, level.height, plan.address);
      for (int c = 0; c < channels; ++c) {
        TargetLine(level, plan.address, row, c, fx.first, fx.extent, line);
        for (int g = 0; g < groups; ++g) {
          const int base = fx.index[16 * g];
          const I16 at = LoadI(fx.index + 16 * g) - SetI(base);
          const F16 low = LoadU(line + base), high = LoadU(line + base + 16);
          F16 sum = Load(fx.weight[0] + 16 * g) * Lookup2(low, high, at);
          sum = MulAdd(Load(fx.weight[1] + 16 * g), Lookup2(low, high, at + SetI(1)), sum);
          sum = MulAdd(Load(fx.weight[2] + 16 * g), Lookup2(low, high, at + SetI(2)), sum);
          sum = MulAdd(Load(fx.weight[3] + 16 * g), Lookup2(low, high, at + SetI(3)), sum);
          Store(scratch->filter_rows[r] + (g * channels + c) * 16, sum);
        }
      }
    }
    const F16 blend = Set(plan.filter_weight[k]);
    for (int r = 0; r < plan.rows; ++r) {
      const float* in = scratch->filter_rows[fy.index[r]];
      const size_t step = &scratch->filter_rows[1][0] - &scratch->filter_rows[0][0];
      for (int v = 0; v < groups * channels; ++v) {
        F16 sum = Set(fy.weight[0][r]) * Load(in + v * 16);
        sum = MulAdd(Set(fy.weight[1][r]), Load(in + step + v * 16), sum);
        sum = MulAdd(Set(fy.weight[2][r]), Load(in + 2 * step + v * 16), sum);
        sum = MulAdd(Set(fy.weight[3][r]), Load(in + 3 * step + v * 16), sum);
        float* to = out + (static_cast<size_t>(r) * groups * channels + v) * 16;
        Store(to, k == 0 ? blend * sum : MulAdd(blend, sum, Load(to)));
      }
    }
  }
}

// Where the target of vector v of the window is: [channels][16].
PATINA_INLINE const float* TargetVector(const WindowPlan& plan, const WindowScratch& scratch, int v) {
  const int groups = plan.cols / 16;
  const int r = v / groups, g = v % groups;
  if (!plan.on_grid) return scratch.target + static_cast<size_t>(v) * plan.target->channels * 16;
  return plan.target->Block(plan.target_block + g, AddressRow(plan.target_row + r, plan.target->height, plan.address));
}

// --- backward: input gradients -> tile -> blocks ---

PATINA_INLINE void Transpose16(const float* in, int in_pitch, float* out, int out_pitch) {
#if defined(PATINA_SIMD_IS_AVX512)
  __m512 a[16], b[16];
  Unroll<16>([&](auto k) PATINA_LAMBDA { a[k] = _mm512_load_ps(in + k * in_pitch); });
  Unroll<8>([&](auto k) PATINA_LAMBDA {
    b[2 * k] = _mm512_unpacklo_ps(a[2 * k], a[2 * k + 1]);
    b[2 * k + 1] = _mm512_unpackhi_ps(a[2 * k], a[2 * k + 1]);
  });
  Unroll<4>([&](auto q) PATINA_LAMBDA {
    Unroll<2>([&](auto h) PATINA_LAMBDA {
      const __m512d lo = _mm512_castps_pd(b[4 * q + h]), hi = _mm512_castps_pd(b[4 * q + 2 + h]);
      a[4 * q + 2 * h] = _mm512_castpd_ps(_mm512_unpacklo_pd(lo, hi));
      a[4 * q + 2 * h + 1] = _mm512_castpd_ps(_mm512_unpackhi_pd(lo, hi));
    });
  });
  // a[4q + j], 128-bit lane p: rows 4q .. 4q+3 of column 4p + j.
  Unroll<4>([&](auto j) PATINA_LAMBDA {
    const __m512 lo01 = _mm512_shuffle_f32x4(a[j], a[4 + j], 0x44), hi01 = _mm512_shuffle_f32x4(a[j], a[4 + j], 0xEE);
    const __m512 lo23 = _mm512_shuffle_f32x4(a[8 + j], a[12 + j], 0x44), hi23 = _mm512_shuffle_f32x4(a[8 + j], a[12 + j], 0xEE);
    _mm512_store_ps(out + j * out_pitch, _mm512_shuffle_f32x4(lo01, lo23, 0x88));
    _mm512_store_ps(out + (4 + j) * out_pitch, _mm512_shuffle_f32x4(lo01, lo23, 0xDD));
    _mm512_store_ps(out + (8 + j) * out_pitch, _mm512_shuffle_f32x4(hi01, hi23, 0x88));
    _mm512_store_ps(out + (12 + j) * out_pitch, _mm512_shuffle_f32x4(hi01, hi23, 0xDD));
  });
#else
  for (int y = 0; y < 16; y += 8) {
    for (int x = 0; x < 16; x += 8) {
      const float* from = in + y * in_pitch + x;
      float* to = out + x * out_pitch + y;
      __m256 a[8], b[8];
      Unroll<8>([&](auto k) PATINA_LAMBDA { a[k] = _mm256_load_ps(from + k * in_pitch); });
      Unroll<4>([&](auto k) PATINA_LAMBDA {
        b[2 * k] = _mm256_unpacklo_ps(a[2 * k], a[2 * k + 1]);
        b[2 * k + 1] = _mm256_unpackhi_ps(a[2 * k], a[2 * k + 1]);
      });
      Unroll<2>([&](auto q) PATINA_LAMBDA {
        Unroll<2>([&](auto h) PATINA_LAMBDA {
          a[4 * q + 2 * h] = _mm256_shuffle_ps(b[4 * q + h], b[4 * q + 2 + h], 0x44);
          a[4 * q + 2 * h + 1] = _mm256_shuffle_ps(b[4 * q + h], b[4 * q + 2 + h], 0xEE);
        });
      });
      Unroll<4>([&](auto j) PATINA_LAMBDA {
        _mm256_store_ps(to + j * out_pitch, _mm256_permute2f128_ps(a[j], a[4 + j], 0x20));
        _mm256_store_ps(to + (4 + j) * out_pitch, _mm256_permute2f128_ps(a[j], a[4 + j], 0x31));
      });
    }
  }
#endif
}

// Transposed interpolation along y for one input plane: vectors of sample rows -> scratch->column [extent_y][64].
// `plane` is the plane's index in chunk-major storage with `planes` planes a chunk.
PATINA_STAGE void ScatterY(const WindowPlan& plan, const LevelTaps& taps, const float* chunks, int planes, int plane,
                            WindowScratch* scratch) {
  const int groups = plan.cols / 16;
  const AxisTaps& y = taps.y;
  const F16 level_weight = Set(taps.weight);
  for (int g = 0; g < groups; ++g) {
    F16 here = Zero(), next = Zero();
    int at = 0;
    for (int r = 0; r < plan.rows; ++r) {
      while (at < y.index[r]) {
        Store(scratch->column[at++] + 16 * g, here);
        here = next;
        next = Zero();
      }
      const int v = r * groups + g;
      const F16 gradient = level_weight * Load(chunks + (static_cast<size_t>(v / kChunkVectors) * planes + plane) * kChunkSamples +
                                               (v % kChunkVectors) * 16);
      const F16 weight = Set(y.weight[r]);
      here = NegMulAdd(weight, gradient, here + gradient);
      next = MulAdd(weight, gradient, next);
    }
    Store(scratch->column[at++] + 16 * g, here);
    if (at < y.extent) Store(scratch->column[at] + 16 * g, next);
  }
}

// Transposed interpolation along x: scratch->column -> out [extent_y + slack][kPitch], texel (0,0) at row kSlack, column
// kSlack. Sample columns become rows of lanes first, so that a tap is a plain multiply-add with a scalar weight.
PATINA_STAGE void ScatterX(const WindowPlan& plan, const LevelTaps& taps, WindowScratch* scratch, float* out) {
  const AxisTaps& x = taps.x;
  const int extent_y = taps.y.extent;
  const int used_rows = extent_y + 2 * kSlack;
  for (int k = 0; k < used_rows * kPitch; k += 16) Store(out + k, Zero());
  float* origin = out + kSlack * kPitch + kSlack;
  if (x.identity) {
    for (int r = 0; r < extent_y; ++r) {
      for (int g = 0; g < plan.cols; g += 16) StoreU(origin + r * kPitch + g, Load(scratch->column[r] + g));
    }
    return;
  }
  const int row_vectors = (extent_y + 15) / 16;
  for (int r = 0; r < row_vectors; ++r) {
    for (int g = 0; g < plan.cols; g += 16) {
      Transpose16(scratch->column[16 * r] + g, kWindowSide, scratch->turned[g] + 16 * r, kPitch);
    }
  }
  for (int r = 0; r < row_vectors; ++r) {
    F16 here = Zero(), next = Zero();
    int at = 0;
    for (int k = 0; k < plan.cols; ++k) {
      while (at < x.index[k]) {
        Store(scratch->scattered[at++] + 16 * r, here);
        here = next;
        next = Zero();
      }
      const F16 gradient = Load(scratch->turned[k] + 16 * r);
      const F16 weight = Set(x.weight[k]);
      here = NegMulAdd(weight, gradient, here + gradient);
      next = MulAdd(weight, gradient, next);
    }
    Store(scratch->scattered[at++] + 16 * r, here);
    Store(scratch->scattered[at++] + 16 * r, next);
    for (; at < (x.extent + 15) / 16 * 16; ++at) Store(scratch->scattered[at] + 16 * r, Zero());
  }
  alignas(64) float turned[16 * 16];
  for (int r = 0; r < row_vectors; ++r) {
    const int rows = extent_y - 16 * r < 16 ? extent_y - 16 * r : 16;
    for (int t = 0; t < x.extent; t += 16) {
      Transpose16(scratch->scattered[t] + 16 * r, kPitch, turned, 16);
      const int columns = kPitch - kSlack - t < 16 ? kPitch - kSlack - t : 16;
      for (int k = 0; k < rows; ++k) {
        float* to = origin + (16 * r + k) * kPitch + t;
        if (columns == 16) {
          StoreU(to, Load(turned + k * 16));
        } else {
          for (int q = 0; q < columns; ++q) to[q] = turned[k * 16 + q];
        }
      }
    }
  }
}

// Adds up texels that are the same texel of the level (a window wider than a wrapped level, or beyond a clamped edge).
// in: tile with texel (first_x, first_y) at (kSlack, kSlack); out: the same with (canonical_first ...).
PATINA_INLINE void FoldTile(const LevelTaps& taps, AddressMode address, const float* in, float* out) {
  const AxisTaps& x = taps.x;
  const AxisTaps& y = taps.y;
  for (int k = 0; k < (y.canonical_extent + 2 * kSlack) * kPitch; k += 16) Store(out + k, Zero());
  const auto canonical = [&](const AxisTaps& axis, int texel, int size) PATINA_LAMBDA {
    if (!axis.fold) return texel - axis.first;
    const int at = address == AddressMode::kClamp ? (texel < 0 ? 0 : (texel >= size ? size - 1 : texel))
                                                  : AddressRow(texel, size, AddressMode::kWrap);
    return at - axis.canonical_first;
  };
  for (int r = 0; r < y.extent; ++r) {
    const int row = canonical(y, y.first + r, taps.level->height);
    for (int k = 0; k < x.extent; ++k) {
      const int column = canonical(x, x.first + k, taps.level->width);
      out[(kSlack + row) * kPitch + kSlack + column] += in[(kSlack + r) * kPitch + kSlack + k];
    }
  }
}

// The gradient tile of `planes` planes for one level; returns where it is and the unwrapped texel at its (kSlack, kSlack).
PATINA_INLINE const float* ScatterLevel(const WindowPlan& plan, const LevelTaps& taps, const float* chunks, int chunk_planes,
                                        int first_plane, int planes, WindowScratch* scratch, int* first_x, int* first_y) {
  for (int c = 0; c < planes; ++c) {
    ScatterY(plan, taps, chunks, chunk_planes, first_plane + c, scratch);
    ScatterX(plan, taps, scratch, scratch->gradient_tile + c * kTilePlane);
  }
  *first_x = taps.x.fold ? taps.x.canonical_first : taps.x.first;
  *first_y = taps.y.fold ? taps.y.canonical_first : taps.y.first;
  if (!taps.x.fold && !taps.y.fold) return scratch->gradient_tile;
  for (int c = 0; c < planes; ++c) {
    FoldTile(taps, plan.address, scratch->gradient_tile + c * kTilePlane, scratch->folded_tile + c * kTilePlane);
  }
  return scratch->folded_tile;
}

PATINA_INLINE F16 LoadTexels(const float* at) {
#if defined(PATINA_SIMD_IS_AVX512)
  __m512 v = _mm512_castps128_ps512(_mm_loadu_ps(at));
  v = _mm512_insertf32x4(v, _mm_loadu_ps(at + kPitch), 1);
  v = _mm512_insertf32x4(v, _mm_loadu_ps(at + 2 * kPitch), 2);
  return {_mm512_insertf32x4(v, _mm_loadu_ps(at + 3 * kPitch), 3)};
#else
  return {_mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(at)), _mm_loadu_ps(at + kPitch), 1),
          _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(at + 2 * kPitch)), _mm_loadu_ps(at + 3 * kPitch), 1)};
#endif
}

// Texels of a block that exist in the level and lie in the tile's range.
PATINA_INLINE unsigned ValidTexels(const AxisTaps::BlockSpan& xs, const AxisTaps::BlockSpan& ys) {
  const unsigned row = (1u << xs.count) - 1;
  unsigned mask = 0;
  for (int r = 0; r < ys.count; ++r) mask |= row << (4 * r);
  return mask;
}

template <BlockForm kForm>
PATINA_STAGE void UpdateLevel(const WindowTask& task, const LevelTaps& taps, const float* tile, int first_x, int first_y, F16* check) {
  FeatureLevel* level = taps.level;
  constexpr int kStride = BlockStride(kForm);
  F16 here = Zero();  // a register: stores to parameters may not alias it
  for (int j = 0; j < taps.y.span_count; ++j) {
    const AxisTaps::BlockSpan& ys = taps.y.spans[j];
    for (int i = 0; i < taps.x.span_count; ++i) {
      const AxisTaps::BlockSpan& xs = taps.x.spans[i];
      const int block = ys.block * level->blocks_x + xs.block;
      const float* at = tile + (kSlack + ys.start - first_y) * kPitch + kSlack + xs.start - first_x;
      const M16 valid = MaskOf(ValidTexels(xs, ys));
      F16 texels[3], gradient[3];
      Unroll<3>([&](auto c) PATINA_LAMBDA { texels[c] = ZeroUnless(valid, LoadTexels(at + c * kTilePlane)); });
      BlockGradient<kForm>(level->params.data() + static_cast<size_t>(block) * kStride,
                           kPartitionMasks[level->partition[block]], texels, gradient);
      if (task.update == FeatureUpdate::kAdam) {
        UpdateBlock<kForm>(level, block, gradient, task.rates, &here);
      } else {
        float* sum = level->gradient.data() + static_cast<size_t>(block) * kStride;
        Unroll<kStride / 16>([&](auto k) PATINA_LAMBDA { Store(sum + 16 * k, Load(sum + 16 * k) + gradient[k]); });
      }
    }
  }
  *check = *check + here;
}

// --- whole windows ---

// Starts fetching what the window needs late, while it computes: the optimiser's state of the blocks that it updates.
PATINA_STAGE void PrefetchMoments(const WindowPlan& plan, BlockForm form) {
  const size_t stride = static_cast<size_t>(BlockStride(form)) * 2;
  for (int k = 0; k < plan.level_count; ++k) {
    const LevelTaps& taps = plan.levels[k];
    for (int j = 0; j < taps.y.span_count; ++j) {
      for (int i = 0; i < taps.x.span_count; ++i) {
        const float* at = taps.level->moments.data() +
                          (static_cast<size_t>(taps.y.spans[j].block) * taps.level->blocks_x + taps.x.spans[i].block) * stride;
        for (size_t line = 0; line < stride; line += 16) _mm_prefetch(reinterpret_cast<const char*>(at + line), _MM_HINT_T1);
      }
    }
  }
}

// Starts fetching a third of the target of the chunk that is kPrefetchChunks ahead: all at once would fill the line buffers.
inline constexpr int kPrefetchChunks = 3;
PATINA_INLINE void PrefetchTarget(const WindowPlan& plan, const WindowScratch& scratch, int first, int vectors, int outputs, int third) {
  if (!plan.on_grid) return;
  const int begin = first + kPrefetchChunks * kChunkVectors;
  for (int v = begin; v < begin + kChunkVectors && v < vectors; ++v) {
    const float* at = TargetVector(plan, scratch, v);
    for (int c = third * outputs / 3; c < (third + 1) * outputs / 3; ++c) {
      _mm_prefetch(reinterpret_cast<const char*>(at + c * 16), _MM_HINT_T0);
    }
  }
}

template <BlockForm kForm>
PATINA_INLINE void RunWindowAs(const WindowTask& task, WindowScratch* scratch, WindowResult* result) {
  const WindowPlan& plan = *task.plan;
  mlp::Chunk* chunk = &scratch->chunk;
  const int outputs = task.outputs;
  const int vectors = plan.rows * plan.cols / 16;
  const bool backward = task.network_gradient || task.update != FeatureUpdate::kNone;
  PrepareRows<kForm>(plan, scratch);
  if (task.update == FeatureUpdate::kAdam) PrefetchMoments(plan, kForm);
  if (!plan.on_grid) FilterTarget(plan, scratch, scratch->target);

  alignas(64) float error_lanes[mlp::kMaxOutputs * 16];
  for (int c = 0; c < outputs; ++c) Store(error_lanes + c * 16, Zero());
  if (backward) {
    for (int k = 0; k < mlp::ParameterCount(outputs); ++k) Store(result->gradient.sum + k * 16, Zero());
  }
  for (int first = 0; first < vectors; first += kChunkVectors) {
    const int count = vectors - first < kChunkVectors ? vectors - first : kChunkVectors;
    PrefetchTarget(plan, *scratch, first, vectors, outputs, 0);
    GatherInputs(plan, *scratch, first, count, chunk->x);
    PrefetchTarget(plan, *scratch, first, vectors, outputs, 1);
    MlpForward(task.network, outputs, chunk);
    PrefetchTarget(plan, *scratch, first, vectors, outputs, 2);
    const float* targets[kChunkVectors];
    for (int v = 0; v < count; ++v) targets[v] = TargetVector(plan, *scratch, first + v);
    for (int c = 0; c < outputs; ++c) {
      const F16 weight = Set(task.channel_weight[c]);
      float* y = chunk->y + c * kChunkSamples;
      F16 sum = Load(error_lanes + c * 16);
      for (int v = 0; v < count; ++v) {
        const F16 error = Load(y + v * 16) - Load(targets[v] + c * 16);
        sum = MulAdd(error, error, sum);
        Store(y + v * 16, weight * error);
      }
      for (int v = count; v < kChunkVectors; ++v) Store(y + v * 16, Zero());
      Store(error_lanes + c * 16, sum);
    }
    if (backward) {
      MlpBackward(task.network, outputs, chunk, scratch->input_gradient[first / kChunkVectors], result->gradient.sum);
    }
  }
  result->samples = vectors * 16;
  result->finite = true;
  for (int c = 0; c < outputs; ++c) {
    result->squared_error[c] = ReduceSum(Load(error_lanes + c * 16));
    // Also false for NaN.
    if (!(result->squared_error[c] < 1e30f)) result->finite = false;
  }
  if (!result->finite || task.update == FeatureUpdate::kNone) return;
  F16 check = Zero();
  for (int k = 0; k < plan.level_count; ++k) {
    const LevelTaps& taps = plan.levels[k];
    int first_x, first_y;
    const float* tile = ScatterLevel(plan, taps, scratch->input_gradient[0], mlp::kInputs, 3 * taps.texture, 3, scratch,
                                     &first_x, &first_y);
    UpdateLevel<kForm>(task, taps, tile, first_x, first_y, &check);
  }
  result->finite = ReduceSum(check) == 0.0f;
}

void RunWindow(const WindowTask& task, WindowScratch* scratch, WindowResult* result) noexcept {
  if (task.form == BlockForm::kSegments) {
    RunWindowAs<BlockForm::kSegments>(task, scratch, result);
  } else {
    RunWindowAs<BlockForm::kFree>(task, scratch, result);
  }
}

// J of three outputs by the texture's three inputs for one vector, added into the nine sums.
// products [hidden][outputs][3]: W2[c][j] * W1[j][3t + d].
template <int kOut>
PATINA_INLINE void AddSensitivity(const float* products, int outputs, int c, const mlp::Chunk& chunk, int v, F16 sums[9],
                                  const F16 residual[kOut], const float* weight) {
  F16 jacobian[kOut][3];
  Unroll<kOut>([&](auto o) PATINA_LAMBDA { Unroll<3>([&](auto d) PATINA_LAMBDA { jacobian[o][d] = Zero(); }); });
  const float* row = Opaque(products) + c * 3;
  for (int j = 0; j < mlp::kHidden; ++j, row += outputs * 3) {
    const M16 active = Load(chunk.h + j * kChunkSamples + v * 16) > Zero();
    Unroll<kOut>([&](auto o) PATINA_LAMBDA {
      Unroll<3>([&](auto d) PATINA_LAMBDA {
        jacobian[o][d] = jacobian[o][d] + ZeroUnless(active, Set(row[o * 3 + d]));
      });
    });
  }
  Unroll<kOut>([&](auto o) PATINA_LAMBDA {
    const F16 w = Set(weight[o]);
    const F16 x = jacobian[o][0], y = jacobian[o][1], z = jacobian[o][2];
    const F16 wx = w * x, wy = w * y, wz = w * z;
    sums[0] = MulAdd(wx, residual[o], sums[0]);
    sums[1] = MulAdd(wy, residual[o], sums[1]);
    sums[2] = MulAdd(wz, residual[o], sums[2]);
    sums[3] = MulAdd(wx, x, sums[3]);
    sums[4] = MulAdd(wx, y, sums[4]);
    sums[5] = MulAdd(wx, z, sums[5]);
    sums[6] = MulAdd(wy, y, sums[6]);
    sums[7] = MulAdd(wy, z, sums[7]);
    sums[8] = MulAdd(wz, z, sums[8]);
  });
}

template <BlockForm kForm>
PATINA_INLINE void SensitivityAs(const WindowTask& task, int texture, WindowScratch* scratch, const SensitivityPlanes& out) {
  const WindowPlan& plan = *task.plan;
  mlp::Chunk* chunk = &scratch->chunk;
  const int outputs = task.outputs;
  const int vectors = plan.rows * plan.cols / 16;
  for (int j = 0; j < mlp::kHidden; ++j) {
    for (int c = 0; c < outputs; ++c) {
      for (int d = 0; d < 3; ++d) {
        scratch->jacobian_products[(j * outputs + c) * 3 + d] =
            task.network[mlp::kW2 + c * mlp::kHidden + j] * task.network[mlp::kW1 + j * mlp::kInputs + 3 * texture + d];
      }
    }
  }
  PrepareRows<kForm>(plan, scratch);
  if (!plan.on_grid) FilterTarget(plan, scratch, scratch->target);
  for (int first = 0; first < vectors; first += kChunkVectors) {
    const int count = vectors - first < kChunkVectors ? vectors - first : kChunkVectors;
    GatherInputs(plan, *scratch, first, count, chunk->x);
    MlpForward(task.network, outputs, chunk);
    float* chunk_out = scratch->sensitivity[first / kChunkVectors];
    for (int v = 0; v < count; ++v) {
      const float* target = TargetVector(plan, *scratch, first + v);
      F16 sums[9];
      Unroll<9>([&](auto k) PATINA_LAMBDA { sums[k] = Zero(); });
      const auto residual = [&](int c) PATINA_LAMBDA { return Load(chunk->y + c * kChunkSamples + v * 16) - Load(target + c * 16); };
      int c = 0;
      for (; c + 3 <= outputs; c += 3) {
        const F16 r[3] = {residual(c), residual(c + 1), residual(c + 2)};
        AddSensitivity<3>(scratch->jacobian_products, outputs, c, *chunk, v, sums, r, task.channel_weight + c);
      }
      for (; c < outputs; ++c) {
        const F16 r[1] = {residual(c)};
        AddSensitivity<1>(scratch->jacobian_products, outputs, c, *chunk, v, sums, r, task.channel_weight + c);
      }
      Unroll<9>([&](auto k) PATINA_LAMBDA { Store(chunk_out + k * kChunkSamples + v * 16, sums[k]); });
    }
  }
  for (int k = 0; k < plan.level_count; ++k) {
    const LevelTaps& taps = plan.levels[k];
    if (taps.texture != texture || taps.level->width != out.width || taps.level->height != out.height) continue;
    int first_x, first_y;
    const float* tile = ScatterLevel(plan, taps, scratch->sensitivity[0], 9, 0, 9, scratch, &first_x, &first_y);
    const int extent_x = taps.x.fold ? taps.x.canonical_extent : taps.x.extent;
    const int extent_y = taps.y.fold ? taps.y.canonical_extent : taps.y.extent;
    for (int c = 0; c < 9; ++c) {
      for (int r = 0; r < extent_y; ++r) {
        const int y = AddressRow(first_y + r, out.height, plan.address);
        float* row = out.planes + (static_cast<size_t>(c) * out.height + y) * out.width;
        const float* from = tile + c * kTilePlane + (kSlack + r) * kPitch + kSlack;
        if (first_x >= 0 && first_x + extent_x <= out.width) {
          for (int x = 0; x < extent_x; ++x) row[first_x + x] += from[x];
        } else {
          for (int x = 0; x < extent_x; ++x) row[AddressRow(first_x + x, out.width, plan.address)] += from[x];
        }
      }
    }
  }
}

void Sensitivity(const WindowTask& task, int texture, WindowScratch* scratch, const SensitivityPlanes& out) noexcept {
  if (task.form == BlockForm::kSegments) {
    SensitivityAs<BlockForm::kSegments>(task, texture, scratch, out);
  } else {
    SensitivityAs<BlockForm::kFree>(task, texture, scratch, out);
  }
}

void FilterTargetWindow(const WindowPlan& plan, WindowScratch* scratch, float* out) noexcept { FilterTarget(plan, scratch, out); }

template <BlockForm kForm>
PATINA_INLINE bool ApplyGradientAs(FeatureLevel* level, int first_block, int count, const AdamRates& rates) {
  constexpr int kStride = BlockStride(kForm);
  F16 check = Zero();
  for (int block = first_block; block < first_block + count; ++block) {
    float* sum = level->gradient.data() + static_cast<size_t>(block) * kStride;
    F16 gradient[3];
    bool any = false;
    Unroll<kStride / 16>([&](auto k) PATINA_LAMBDA {
      gradient[k] = Load(sum + 16 * k);
      any = any || Bits(Abs(gradient[k]) > Zero()) != 0;
      check = MulAdd(gradient[k], Zero(), check);
      Store(sum + 16 * k, Zero());
    });
    if (any) UpdateBlock<kForm>(level, block, gradient, rates, &check);
  }
  return ReduceSum(check) == 0.0f;
}

bool ApplyGradient(FeatureLevel* level, BlockForm form, int first_block, int count, const AdamRates& rates) noexcept {
  if (form == BlockForm::kSegments) {
    return ApplyGradientAs<BlockForm::kSegments>(level, first_block, count, rates);
  }
  return ApplyGradientAs<BlockForm::kFree>(level, first_block, count, rates);
}

// Arrays are padded to whole vectors by the caller.
bool AdamFlat(float* params, const float* gradient, float* moment1, float* moment2, int count, int updates,
              const AdamRates& rates) noexcept {
  const float c1 = BiasCorrection(rates.beta1, updates), c2 = BiasCorrection(rates.beta2, updates);
  F16 check = Zero();
  for (int k = 0; k < count; k += 16) {
    Store(params + k, AdamStep(Load(params + k), Load(gradient + k), moment1 + k, moment2 + k, rates.endpoint, c1, c2, rates, &check));
  }
  return ReduceSum(check) == 0.0f;
}

void MlpForwardChunk(const float* network, int outputs, mlp::Chunk* chunk) noexcept { MlpForward(network, outputs, chunk); }
void MlpBackwardChunk(const float* network, int outputs, mlp::Chunk* chunk, float* lanes) noexcept {
  MlpBackward(network, outputs, chunk, chunk->dx, lanes);
}

void FoldGradient(const float* const* lanes, int windows, int count, float* out) noexcept {
  for (int k = 0; k < count; ++k) {
    F16 sum = Load(lanes[0] + k * 16);
    for (int w = 1; w < windows; ++w) sum = sum + Load(lanes[w] + k * 16);
    out[k] = ReduceSum(sum);
  }
}

extern const MaterialKernels kKernels;
const MaterialKernels kKernels = {RunWindow, Sensitivity, FilterTargetWindow, ApplyGradient, AdamFlat,
                                  MlpForwardChunk, MlpBackwardChunk, FoldGradient};

}  // namespace patina::PATINA_SIMD
