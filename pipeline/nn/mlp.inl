// SIMD network kernels for one target; see mlp.h and simd16.h.
// The order of operations a lane sees is that of the reference with fused multiply-adds, whatever the blocking: bias
// first, then the inputs in order. Weight gradients are summed over the 8 vectors of a chunk, then added to the lanes.

namespace patina::PATINA_SIMD {

using mlp::kChunkSamples;
using mlp::kChunkVectors;

#if defined(PATINA_SIMD_IS_AVX512)
inline constexpr int kVectorBlock = 4;  // sample vectors a register block holds: 4 outputs x 4 vectors
#else
inline constexpr int kVectorBlock = 1;  // pairs of registers: 4 outputs x 1 vector
#endif

// What a dense layer does with its sums: nothing, clamp them at zero, or pass them where a gate is above zero (the ReLU's
// derivative).
enum class Finish { kLinear, kRelu, kGate };

// y[o] = b[o] + sum_i w[o * row_stride + i * column_stride] x[i] for kOut rows. gate has y's layout.
template <int kOut, bool kBias, Finish kFinish>
PATINA_INLINE void DenseRows(const float* w, int row_stride, int column_stride, const float* b, int inputs,
                             const float* x, const float* gate, float* y) {
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
        if constexpr (kFinish == Finish::kGate) {
          value = ZeroUnless(Load(gate + o * kChunkSamples + (v + k) * 16) > Zero(), value);
        }
        if constexpr (kFinish == Finish::kRelu) value = Max(Zero(), value);  // in this order NaN passes, and the loss shows it
        Store(y + o * kChunkSamples + (v + k) * 16, value);
      });
    });
  }
}

template <bool kBias, Finish kFinish>
PATINA_INLINE void Dense(const float* w, int row_stride, int column_stride, const float* b, int inputs, int outputs,
                         const float* x, const float* gate, float* y) {
  int o = 0;
  const auto advance = [&](int rows) PATINA_LAMBDA {
    w += rows * row_stride;
    if (kBias) b += rows;
    y += rows * kChunkSamples;
    if (kFinish == Finish::kGate) gate += rows * kChunkSamples;
    o += rows;
  };
  while (outputs - o >= 4) {
    if (outputs - o == 5 || outputs - o == 6 || outputs - o == 9) {
      DenseRows<3, kBias, kFinish>(w, row_stride, column_stride, b, inputs, x, gate, y);
      advance(3);
    } else {
      DenseRows<4, kBias, kFinish>(w, row_stride, column_stride, b, inputs, x, gate, y);
      advance(4);
    }
  }
  switch (outputs - o) {
    case 3: DenseRows<3, kBias, kFinish>(w, row_stride, column_stride, b, inputs, x, gate, y); break;
    case 2: DenseRows<2, kBias, kFinish>(w, row_stride, column_stride, b, inputs, x, gate, y); break;
    case 1: DenseRows<1, kBias, kFinish>(w, row_stride, column_stride, b, inputs, x, gate, y); break;
    default: break;
  }
}

// lanes[(a * row_length + b)] += sum over the chunk's vectors of left[a] * right[b], for an kA x kB tile.
template <int kA, int kB>
PATINA_INLINE void OuterTile(const float* left, const float* right, float* lanes, int row_length) {
  F16 acc[kA][kB];
  Unroll<kA>([&](auto a) PATINA_LAMBDA { Unroll<kB>([&](auto b) PATINA_LAMBDA { acc[a][b] = Zero(); }); });
  for (int v = 0; v < kChunkVectors; ++v) {
    F16 l[kA];
    Unroll<kA>([&](auto a) PATINA_LAMBDA { l[a] = Load(left + a * kChunkSamples + v * 16); });
    Unroll<kB>([&](auto b) PATINA_LAMBDA {
      const F16 r = Load(right + b * kChunkSamples + v * 16);
      Unroll<kA>([&](auto a) PATINA_LAMBDA { acc[a][b] = MulAdd(l[a], r, acc[a][b]); });
    });
  }
  Unroll<kA>([&](auto a) PATINA_LAMBDA {
    Unroll<kB>([&](auto b) PATINA_LAMBDA {
      float* lane = lanes + (a * row_length + b) * 16;
      Store(lane, Load(lane) + acc[a][b]);
    });
  });
}

template <int kA, int kB>
PATINA_INLINE void OuterRow(const float* left, const float* right, float* lanes, int right_count) {
  int b = 0;
  for (; b + kB <= right_count; b += kB) OuterTile<kA, kB>(left, right + b * kChunkSamples, lanes + b * 16, right_count);
  for (; b < right_count; ++b) OuterTile<kA, 1>(left, right + b * kChunkSamples, lanes + b * 16, right_count);
}

// Weight gradients: lanes[a][b] += sum of left[a] * right[b] over the chunk; right_count is 12 or 16. Tiles are as large as the
// registers hold.
PATINA_STAGE void Outer(const float* left, int left_count, const float* right, int right_count, float* lanes) {
  int a = 0;
  const auto at = [&](auto rows, auto columns) PATINA_LAMBDA {
    OuterRow<rows, columns>(left + a * kChunkSamples, right, lanes + a * right_count * 16, right_count);
    a += rows;
  };
  using std::integral_constant;
#if defined(PATINA_SIMD_IS_AVX512)
  while (left_count - a >= 4 && left_count - a != 5 && left_count - a != 6 && left_count - a != 9) {
    if (right_count % 6 == 0) {
      at(integral_constant<int, 4>{}, integral_constant<int, 6>{});
    } else {
      at(integral_constant<int, 4>{}, integral_constant<int, 4>{});
    }
  }
  while (left_count - a >= 3) {
    if (right_count % 8 == 0) {
      at(integral_constant<int, 3>{}, integral_constant<int, 8>{});
    } else {
      at(integral_constant<int, 3>{}, integral_constant<int, 6>{});
    }
  }
  while (left_count - a >= 1) at(integral_constant<int, 1>{}, integral_constant<int, 4>{});
#else
  while (left_count - a >= 2) {
    if (right_count % 3 == 0) {
      at(integral_constant<int, 2>{}, integral_constant<int, 3>{});
    } else {
      at(integral_constant<int, 2>{}, integral_constant<int, 2>{});
    }
  }
  while (left_count - a >= 1) at(integral_constant<int, 1>{}, integral_constant<int, 4>{});
#endif
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
  Dense<true, Finish::kRelu>(params + mlp::kW1, mlp::kInputs, 1, params + mlp::kB1, mlp::kInputs, mlp::kHidden, chunk->x,
                             nullptr, chunk->h);
  Dense<true, Finish::kLinear>(params + mlp::kW2, mlp::kHidden, 1, params + mlp::OffsetB2(outputs), mlp::kHidden, outputs,
                               chunk->h, nullptr, chunk->y);
}

// chunk->y holds dLoss/dy on entry. Adds the weight gradients to `lanes` and writes dLoss/dx to dx [12][8][16].
PATINA_STAGE void MlpBackward(const float* params, int outputs, mlp::Chunk* chunk, float* dx, float* lanes) {
  Dense<false, Finish::kGate>(params + mlp::kW2, 1, mlp::kHidden, nullptr, outputs, mlp::kHidden, chunk->y, chunk->h, chunk->d);
  Dense<false, Finish::kLinear>(params + mlp::kW1, 1, mlp::kInputs, nullptr, mlp::kHidden, mlp::kInputs, chunk->d, nullptr, dx);
  Outer(chunk->d, mlp::kHidden, chunk->x, mlp::kInputs, lanes + mlp::kW1 * 16);
  BiasGradient(chunk->d, mlp::kHidden, lanes + mlp::kB1 * 16);
  Outer(chunk->y, outputs, chunk->h, mlp::kHidden, lanes + mlp::kW2 * 16);
  BiasGradient(chunk->y, outputs, lanes + mlp::OffsetB2(outputs) * 16);
}

}  // namespace patina::PATINA_SIMD
