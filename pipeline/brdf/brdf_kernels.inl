// Included inside a target section, after simd16.h, unroll.h, math16.inl and row_product.inl.

namespace patina::PATINA_SIMD {
namespace {

using brdf::ChunkResult;
using brdf::ChunkScratch;
using brdf::ChunkTask;
using brdf::DenseLayer;
using brdf::kChunkRows;
using brdf::kOutputs;
using brdf::NetworkLayout;
using brdf::PoolSample;

PATINA_STAGE void GatherTexels(const ChunkTask& task, float* rows) {
  const NetworkLayout& layout = *task.layout;
  const int stride = layout.texture_stride;
  for (int s = 0; s < kChunkRows; ++s) {
    const brdf::TexelTaps& taps = task.taps[s < task.count ? s : 0];
    float* row = rows + static_cast<ptrdiff_t>(s) * layout.layers[0].input_stride +
                 2 * layout.feature_stride;
    for (int k = 0; k < stride; k += 16) {
      F16 sum = Zero();
      Unroll<8>([&](auto c) PATINA_LAMBDA {
        sum = MulAdd(Set(taps.weight[c]),
                     Load(task.texture + static_cast<ptrdiff_t>(taps.row[c]) * stride + k), sum);
      });
      Store(row + k, sum);
    }
  }
}

PATINA_STAGE void GatherRows(const ChunkTask& task, float* rows) {
  const NetworkLayout& layout = *task.layout;
  const DenseLayer& first = layout.layers[0];
  const int stride = layout.feature_stride;
  for (int s = 0; s < kChunkRows; ++s) {
    const PoolSample& sample = task.samples[s < task.count ? s : 0];
    float* row = rows + static_cast<ptrdiff_t>(s) * first.input_stride;
    for (int side = 0; side < 2; ++side) {
      const float* source[4];
      F16 weight[4];
      Unroll<4>([&](auto c) PATINA_LAMBDA {
        const int32_t corner = sample.corner[4 * side + c];
        const int32_t at = task.row_of_corner != nullptr ? task.row_of_corner[corner] : corner;
        source[c] = task.features + static_cast<ptrdiff_t>(at) * stride;
        weight[c] = Set(sample.weight[4 * side + c]);
      });
      for (int k = 0; k < stride; k += 16) {
        F16 sum = weight[0] * Load(source[0] + k);
        sum = MulAdd(weight[1], Load(source[1] + k), sum);
        sum = MulAdd(weight[2], Load(source[2] + k), sum);
        sum = MulAdd(weight[3], Load(source[3] + k), sum);
        Store(row + side * stride + k, sum);
      }
    }
    float* extra = row + layout.feature_columns();
    for (int e = 0; e < layout.extra_inputs; ++e) extra[e] = sample.extra[e];
  }
  if (layout.texture_stride > 0) GatherTexels(task, rows);
}

// The layers from `first` on, whose activations are set.
void ForwardLayers(const NetworkLayout& layout, const float* parameters, size_t first,
                   ChunkScratch* scratch) {
  for (size_t l = first; l < layout.layers.size(); ++l) {
    const DenseLayer& layer = layout.layers[l];
    const Strided a = {scratch->activations[l].data(), layer.input_stride, 1};
    const float* weights = parameters + layer.weights;
    if (l + 1 == layout.layers.size()) {
      RowProduct<false>(a, kChunkRows, weights, layer.outputs, layer.inputs + 1, layer.outputs,
                        scratch->outputs.data(), 16);
    } else {
      RowProduct<true>(a, kChunkRows, weights, layer.outputs, layer.inputs + 1, layer.outputs,
                       scratch->activations[l + 1].data(), layout.layers[l + 1].input_stride);
    }
  }
}

void ForwardChunk(const ChunkTask& task, ChunkScratch* scratch) {
  GatherRows(task, scratch->activations[0].data());
  ForwardLayers(*task.layout, task.parameters, 0, scratch);
}

// One channel of sixteen samples: loss and its derivative by y.
PATINA_INLINE F16 LossOf(F16 y, F16 target, F16 cosine, F16* derivative) {
  const F16 one = Set(1.0f);
  const F16 capped = Min(y, Set(brdf::kMaxLogValue));
  const F16 e = Exp(capped);
  const F16 inside = MulAdd(cosine, e - one, one);
  const M16 positive = capped > Zero();
  // Below zero f is cut off by decoders; the loss goes on with the slope it has there.
  const F16 g = Select(positive, Log(Max(inside, Set(1e-30f))), cosine * capped);
  const F16 slope = Select(positive, cosine * e / Max(inside, Set(1e-30f)), cosine);
  // Noise can make a measured value negative: log1p goes on as a straight line there.
  const M16 real = target > Zero();
  const F16 tc = target * cosine;
  const F16 wanted_g = Select(real, Log(Max(one + tc, Set(1e-30f))), tc);
  const F16 wanted_y = Select(real, Log(Max(one + target, Set(1e-30f))), target);
  const F16 a = g - wanted_g, b = capped - wanted_y;
  const F16 sign_a = Select(a > Zero(), one, Select(a < Zero(), Set(-1.0f), Zero()));
  const F16 sign_b = Select(b > Zero(), one, Select(b < Zero(), Set(-1.0f), Zero()));
  constexpr float kPlainShare = 0.05f;
  *derivative = MulAdd(sign_a, slope, Set(kPlainShare) * sign_b);
  return MulAdd(Set(kPlainShare), Abs(b), Abs(a));
}

// Replaces the outputs of the last layer by their gradients; returns the loss.
PATINA_STAGE double LossRows(const ChunkTask& task, float* outputs) {
  alignas(64) float y[16], target[16], cosine[16], importance[16];
  double total = 0;
  for (int s = 0; s < kChunkRows; s += 16) {
    for (int l = 0; l < 16; ++l) {
      const bool used = s + l < task.count;
      const PoolSample& sample = task.samples[used ? s + l : 0];
      cosine[l] = sample.cosine;
      importance[l] = used ? sample.importance : 0.0f;
    }
    for (int c = 0; c < kOutputs; ++c) {
      for (int l = 0; l < 16; ++l) {
        target[l] = task.samples[s + l < task.count ? s + l : 0].value[c];
        y[l] = outputs[(s + l) * 16 + c];
      }
      F16 derivative;
      const F16 loss = LossOf(Load(y), Load(target), Load(cosine), &derivative) * Load(importance);
      // The cap on y would hide an output that is not finite; 0 * y does not.
      total += static_cast<double>(ReduceSum(MulAdd(Load(y), Zero(), loss)));
      Store(y, derivative * Load(importance));
      for (int l = 0; l < 16; ++l) outputs[(s + l) * 16 + c] = y[l];
    }
    for (int l = 0; l < 16; ++l) {
      for (int c = kOutputs; c < 16; ++c) outputs[(s + l) * 16 + c] = 0.0f;
    }
  }
  return total;
}

PATINA_STAGE void MaskRows(const float* activation, int stride, float* gradient, int columns) {
  for (int s = 0; s < kChunkRows; ++s) {
    const float* a = activation + static_cast<ptrdiff_t>(s) * stride;
    float* g = gradient + static_cast<ptrdiff_t>(s) * columns;
    for (int n = 0; n < columns; n += 16)
      Store(g + n, ZeroUnless(Load(a + n) > Zero(), Load(g + n)));
  }
}

// A sum of zeros, unless a square, which Adam keeps, is not finite.
PATINA_STAGE bool SquaresAreFinite(const float* values, size_t count) {
  F16 sum = Zero();
  for (size_t i = 0; i < count; i += 16) {
    const F16 value = Load(values + i);
    sum = MulAdd(value * value, Zero(), sum);
  }
  return ReduceSum(sum) == 0.0f;
}

// The first hidden layer from corners that went through its weights before.
PATINA_STAGE void GatherFolded(const NetworkLayout& layout, const float* parameters,
                               const float* folded, const brdf::PairLookups& pairs, float* rows) {
  const DenseLayer& first = layout.layers[0];
  const ptrdiff_t columns = first.outputs, stride = layout.layers[1].input_stride;
  const float* scalars =
      parameters + first.weights + static_cast<ptrdiff_t>(layout.feature_columns()) * columns;
  const float* bias = scalars + layout.extra_inputs * columns;
  for (int s = 0; s < kChunkRows; ++s) {
    for (ptrdiff_t n = 0; n < columns; n += 16) {
      F16 near = Load(bias + n), far = Zero();
      for (int e = 0; e < layout.extra_inputs; ++e)
        near = MulAdd(Set(pairs.extra[e][s]), Load(scalars + e * columns + n), near);
      Unroll<4>([&](auto c) PATINA_LAMBDA {
        near =
            MulAdd(Set(pairs.weight[c][s]), Load(folded + pairs.corner[c][s] * columns + n), near);
        far = MulAdd(Set(pairs.weight[4 + c][s]),
                     Load(folded + pairs.corner[4 + c][s] * columns + n), far);
      });
      Store(rows + s * stride + n, Max(near + far, Zero()));
    }
  }
}

void EvaluateChunk(const NetworkLayout& layout, const float* parameters, const float* folded,
                   const brdf::PairLookups& pairs, ChunkScratch* scratch) {
  GatherFolded(layout, parameters, folded, pairs, scratch->activations[1].data());
  ForwardLayers(layout, parameters, 1, scratch);
}

void TrainChunk(const ChunkTask& task, ChunkScratch* scratch, ChunkResult* result) {
  const NetworkLayout& layout = *task.layout;
  ForwardChunk(task, scratch);
  result->loss = LossRows(task, scratch->outputs.data());
  const float* upper = scratch->outputs.data();
  for (size_t l = layout.layers.size(); l-- > 0;) {
    const DenseLayer& layer = layout.layers[l];
    const float* a = scratch->activations[l].data();
    RowProduct<false>({a, 1, layer.input_stride}, layer.inputs + 1, upper, layer.outputs,
                      kChunkRows, layer.outputs, result->weight_gradient.data() + layer.weights,
                      layer.outputs);
    // To the inputs: of the first layer only the features have a use for it.
    const int columns = l == 0 ? layout.feature_columns() : brdf::PadTo16(layer.inputs);
    float* lower = l == 0 ? result->feature_gradient.data() : scratch->gradient[l % 2].data();
    RowProduct<false>({upper, layer.outputs, 1}, kChunkRows, task.transposed + layer.transposed,
                      brdf::PadTo16(layer.inputs),
                      l + 1 == layout.layers.size() ? kOutputs : layer.outputs, columns, lower,
                      columns);
    if (l > 0) MaskRows(a, layer.input_stride, lower, columns);
    upper = lower;
  }
  result->finite = SquaresAreFinite(result->weight_gradient.data(), layout.parameter_count) &&
                   SquaresAreFinite(result->feature_gradient.data(),
                                    static_cast<size_t>(kChunkRows) * layout.feature_columns());
}

void Scatter(const NetworkLayout& layout, const PoolSample* samples, int count, int hemisphere,
             const ChunkResult& result, float* gradient) {
  const int stride = layout.feature_stride;
  for (int s = 0; s < count; ++s) {
    const float* from =
        result.feature_gradient.data() +
        static_cast<ptrdiff_t>(s) * layout.feature_columns() + hemisphere * stride;
    for (int c = 0; c < 4; ++c) {
      float* to = gradient + static_cast<ptrdiff_t>(samples[s].corner[4 * hemisphere + c]) * stride;
      const F16 weight = Set(samples[s].weight[4 * hemisphere + c]);
      for (int k = 0; k < stride; k += 16)
        Store(to + k, MulAdd(weight, Load(from + k), Load(to + k)));
    }
  }
}

void ScatterTexels(const NetworkLayout& layout, const brdf::TexelTaps* taps, int count,
                   const ChunkResult& result, float* gradient) {
  const int stride = layout.texture_stride;
  for (int s = 0; s < count; ++s) {
    const float* from = result.feature_gradient.data() +
                        static_cast<ptrdiff_t>(s) * layout.feature_columns() +
                        2 * layout.feature_stride;
    for (int c = 0; c < 8; ++c) {
      if (taps[s].weight[c] == 0) continue;
      float* to = gradient + static_cast<ptrdiff_t>(taps[s].row[c]) * stride;
      const F16 weight = Set(taps[s].weight[c]);
      for (int k = 0; k < stride; k += 16)
        Store(to + k, MulAdd(weight, Load(from + k), Load(to + k)));
    }
  }
}

void SoftmaxGradient(const float* logits, int columns, float temperature, const float* transposed,
                     const float* feature_gradient, int stride, float* gradient) {
  F16 largest = Load(logits);
  for (int j = 16; j < columns; j += 16) largest = Max(largest, Load(logits + j));
  const F16 top = Set(ReduceMax(largest)), inverse = Set(1 / temperature);
  F16 mass = Zero(), mean = Zero();
  for (int j = 0; j < columns; j += 16) {
    F16 s = Zero();
    for (int k = 0; k < stride; ++k)
      s = MulAdd(Set(feature_gradient[k]),
                 Load(transposed + static_cast<ptrdiff_t>(k) * columns + j), s);
    const F16 p = Exp(Max((Load(logits + j) - top) * inverse, Set(-80.0f)));
    mass = mass + p;
    mean = MulAdd(p, s, mean);
    Store(gradient + j, s);
  }
  const float total = ReduceSum(mass);
  const F16 centre = Set(ReduceSum(mean) / total), scale = Set(1 / (total * temperature));
  for (int j = 0; j < columns; j += 16) {
    const F16 p = Exp(Max((Load(logits + j) - top) * inverse, Set(-80.0f)));
    Store(gradient + j, p * scale * (Load(gradient + j) - centre));
  }
}

bool Adam(float* parameters, float* gradient, float* moment1, float* moment2, size_t count,
          const brdf::AdamSettings& settings) {
  const F16 beta1 = Set(settings.beta1), rest1 = Set(1 - settings.beta1);
  const F16 beta2 = Set(settings.beta2), rest2 = Set(1 - settings.beta2);
  const F16 rate = Set(settings.rate * settings.correction1),
            correction2 = Set(settings.correction2), epsilon = Set(settings.epsilon),
            kept = Set(1 - settings.rate * settings.decay);
  F16 check = Zero();
  for (size_t i = 0; i < count; i += 16) {
    const F16 g = Load(gradient + i);
    const F16 m = MulAdd(rest1, g, beta1 * Load(moment1 + i));
    const F16 v = MulAdd(rest2 * g, g, beta2 * Load(moment2 + i));
    Store(moment1 + i, m);
    Store(moment2 + i, v);
    Store(gradient + i, Zero());
    const F16 updated =
        kept * Load(parameters + i) - rate * m / (Sqrt(v * correction2) + epsilon);
    Store(parameters + i, updated);
    check = MulAdd(updated + v, Zero(), check);
  }
  return ReduceSum(check) == 0.0f;
}

}  // namespace

extern const brdf::BrdfKernels kBrdfKernels;
const brdf::BrdfKernels kBrdfKernels = {TrainChunk,   ForwardChunk, LookUpPairs,     EvaluateChunk,
                                        OutputValues, Scatter,      ScatterTexels,
                                        SoftmaxGradient, Adam};

}  // namespace patina::PATINA_SIMD
