// SIMD network kernels for one target; see mlp.h and simd16.h.
// The order of operations a lane sees is that of the reference with fused multiply-adds, whatever the blocking: bias
// first, then the inputs in order. Weight gradients are summed over the 8 vectors of a chunk, then added to the lanes.

namespace patina::PATINA_SIMD {

using mlp::kChunkSamples;
using mlp::kChunkVectors;

#if defined(PATINA_SIMD_IS_AVX512)
inline constexpr int kVectorBlock = 4;  // sample vectors a register block holds: 4 outputs x 4 vectors
inline constexpr int kOuterA = 4, kOuterB = 6;
#else
inline constexpr int kVectorBlock = 1;  // pairs of registers: 4 outputs x 1 vector
inline constexpr int kOuterA = 2, kOuterB = 3;
#endif

// y[o] = b[o] + sum_i w[o * row_stride + i * column_stride] x[i] for kOut rows; kRelu clamps at zero.
template <int kOut, bool kBias, bool kRelu>
PATINA_INLINE void DenseRows(const float* w, int row_stride, int column_stride, const float* b, int inputs,
                             const float* x, float* y) {
  for (int v = 0; v < kChunkVectors; v += kVectorBlock) {
    F16 acc[kOut][kVectorBlock];
    Unroll<kOut>([&](auto o) PATINA_LAMBDA {
      const F16 init = kBias ? Set(b[o]) : Zero();
      Unroll<kVectorBlock>([&](auto k) PATINA_LAMBDA { acc[o][k] = init; });
    });
    const float* column = Opaque(w);
    const float* in = x + v * 16;
    for (int i = 0; i < inputs; ++i, column += column_stride, in += kChunkSamples) {
      F16 xv[kVectorBlock];
      Unroll<kVectorBlock>([&](auto k) PATINA_LAMBDA { xv[k] = Load(in + k * 16); });
      Unroll<kOut>([&](auto o) PATINA_LAMBDA {
        const F16 wv = Set(column[o * row_stride]);
        Unroll<kVectorBlock>([&](auto k) PATINA_LAMBDA { acc[o][k] = MulAdd(wv, xv[k], acc[o][k]); });
      });
    }
    Unroll<kOut>([&](auto o) PATINA_LAMBDA {
      Unroll<kVectorBlock>([&](auto k) PATINA_LAMBDA {
        F16 value = acc[o][k];
        if constexpr (kRelu) value = Max(Zero(), value);  // in this order NaN passes, and the loss shows it
        Store(y + o * kChunkSamples + (v + k) * 16, value);
      });
    });
  }
}

template <bool kBias, bool kRelu>
PATINA_INLINE void Dense(const float* w, int row_stride, int column_stride, const float* b, int inputs, int outputs,
                         const float* x, float* y) {
  int o = 0;
  const auto advance = [&](int rows) PATINA_LAMBDA {
    w += rows * row_stride;
    if (kBias) b += rows;
    y += rows * kChunkSamples;
    o += rows;
  };
  while (outputs - o >= 4) {
    if (outputs - o == 5 || outputs - o == 6 || outputs - o == 9) {
      DenseRows<3, kBias, kRelu>(w, row_stride, column_stride, b, inputs, x, y);
      advance(3);
    } else {
      DenseRows<4, kBias, kRelu>(w, row_stride, column_stride, b, inputs, x, y);
      advance(4);
    }
  }
  switch (outputs - o) {
    case 3: DenseRows<3, kBias, kRelu>(w, row_stride, column_stride, b, inputs, x, y); break;
    case 2: DenseRows<2, kBias, kRelu>(w, row_stride, column_stride, b, inputs, x, y); break;
    case 1: DenseRows<1, kBias, kRelu>(w, row_stride, column_stride, b, inputs, x, y); break;
    default: break;
  }
}

// lanes[(a * row_length + b)] += sum over the chunk's vectors of left[a] * right[b], for an kA x kB tile.
template <int kA, int kB>
PATINA_INLINE void OuterTile(const float* left, const float* right, float* lanes, int row_length) {
  F16 acc[kA][kB];
  Unroll<kA>([&](auto a) PATINA_LAMBDA { Unroll<kB>([&](auto b) PATINA_LAMBDA { acc[a][b] = Zero(); }); });
  for (int v = 0; v < kChunkVectors; ++v) {
    F16 r[kB];
    Unroll<kB>([&](auto b) PATINA_LAMBDA { r[b] = Load(right + b * kChunkSamples + v * 16); });
    Unroll<kA>([&](auto a) PATINA_LAMBDA {
      const F16 l = Load(left + a * kChunkSamples + v * 16);
      Unroll<kB>([&](auto b) PATINA_LAMBDA { acc[a][b] = MulAdd(l, r[b], acc[a][b]); });
    });
  }
  Unroll<kA>([&](auto a) PATINA_LAMBDA {
    Unroll<kB>([&](auto b) PATINA_LAMBDA {
      float* lane = lanes + (a * row_length + b) * 16;
      Store(lane, Load(lane) + acc[a][b]);
    });
  });
}

template <int kA>
PATINA_INLINE void OuterRow(const float* left, const float* right, float* lanes, int right_count) {
  int b = 0;
  for (; b + kOuterB <= right_count; b += kOuterB) {
    OuterTile<kA, kOuterB>(left, right + b * kChunkSamples, lanes + b * 16, right_count);
  }
  for (; b + 2 <= right_count; b += 2) OuterTile<kA, 2>(left, right + b * kChunkSamples, lanes + b * 16, right_count);
  for (; b < right_count; ++b) OuterTile<kA, 1>(left, right + b * kChunkSamples, lanes + b * 16, right_count);
}

// Weight gradients: lanes[a][b] += sum of left[a] * right[b] over the chunk.
PATINA_STAGE void Outer(const float* left, int left_count, const float* right, int right_count, float* lanes) {
  int a = 0;
  for (; a + kOuterA <= left_count; a += kOuterA) {
    OuterRow<kOuterA>(left + a * kChunkSamples, right, lanes + a * right_count * 16, right_count);
  }
  for (; a < left_count; ++a) {
    OuterRow<1>(left + a * kChunkSamples, right, lanes + a * right_count * 16, right_count);
  }
}

// lanes[a] += sum over the chunk of values[a].
PATINA_INLINE void BiasGradient(const float* values, int count, float* lanes) {
  for (int a = 0; a < count; ++a) {
    F16 acc = Load(values + a * kChunkSamples);
    for (int v = 1; v < kChunkVectors; ++v) acc = acc + Load(values + a * kChunkSamples + v * 16);
    Store(lanes + a * 16, Load(lanes + a * 16) + acc);
  }
}

PATINA_STAGE void MlpForward(const float* params, int outputs, mlp::Chunk* chunk) {
  Dense<true, true>(params + mlp::kW1, mlp::kInputs, 1, params + mlp::kB1, mlp::kInputs, mlp::kHidden, chunk->x, chunk->h);
  Dense<true, false>(params + mlp::kW2, mlp::kHidden, 1, params + mlp::OffsetB2(outputs), mlp::kHidden, outputs, chunk->h,
                     chunk->y);
}

// chunk->y holds dLoss/dy on entry. Adds the weight gradients to `lanes` and writes dLoss/dx to dx [12][8][16].
PATINA_STAGE void MlpBackward(const float* params, int outputs, mlp::Chunk* chunk, float* dx, float* lanes) {
  Dense<false, false>(params + mlp::kW2, 1, mlp::kHidden, nullptr, outputs, mlp::kHidden, chunk->y, chunk->d);
  for (int k = 0; k < mlp::kHidden * kChunkVectors; ++k) {
    Store(chunk->d + k * 16, ZeroUnless(Load(chunk->h + k * 16) > Zero(), Load(chunk->d + k * 16)));
  }
  Dense<false, false>(params + mlp::kW1, 1, mlp::kInputs, nullptr, mlp::kHidden, mlp::kInputs, chunk->d, dx);
  Outer(chunk->d, mlp::kHidden, chunk->x, mlp::kInputs, lanes + mlp::kW1 * 16);
  BiasGradient(chunk->d, mlp::kHidden, lanes + mlp::kB1 * 16);
  Outer(chunk->y, outputs, chunk->h, mlp::kHidden, lanes + mlp::kW2 * 16);
  BiasGradient(chunk->y, outputs, lanes + mlp::OffsetB2(outputs) * 16);
}

}  // namespace patina::PATINA_SIMD
