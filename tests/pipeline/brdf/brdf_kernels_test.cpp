// The kernels against the scalar reference: values in double, gradients by complex step, the same
// bits on every target.
#include "pipeline/brdf/brdf_kernels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstring>
#include <limits>

#include "pipeline/base/rng.h"
#include "pipeline/brdf/reference_model.h"

namespace patina::brdf {
namespace {

struct Shape {
  int primitive_size, extra_inputs, hidden, hidden_layers;
  int texture_inputs = 0;
};

constexpr Shape kShapes[] = {{16, 3, 32, 2},
                             {16, 0, 64, 3},
                             {8, 3, 24, 1},
                             {20, 5, 16, 2},
                             {1, 0, 4, 1},
                             // With a neural texture, of one and of four textures.
                             {16, 5, 32, 2, 12},
                             {5, 0, 8, 1, 3}};
constexpr int kCorners = 40, kTexels = 21;

// A network, features and a chunk of samples from a seed.
struct Case {
  Case(const Shape& shape, int count, uint64_t seed)
      : layout(shape.primitive_size, shape.extra_inputs, shape.hidden, shape.hidden_layers,
               shape.texture_inputs),
        parameters(layout.parameter_count),
        transposed(layout.transposed_count),
        features(static_cast<size_t>(kCorners) * layout.feature_stride),
        samples(count),
        texels(static_cast<size_t>(kTexels) * layout.texture_stride),
        taps(layout.texture_stride > 0 ? count : 0),
        scratch(layout),
        result(layout) {
    Rng rng(seed);
    const auto uniform = [&](float bound) { return (2 * rng.Uniform() - 1) * bound; };
    for (size_t l = 0; l < layout.layers.size(); ++l) {
      const DenseLayer& layer = layout.layers[l];
      const int used = l + 1 < layout.layers.size() ? shape.hidden : kOutputs;
      for (int i = 0; i <= layer.inputs; ++i) {
        for (int n = 0; n < used; ++n)
          parameters[layer.weights + static_cast<size_t>(i) * layer.outputs + n] = uniform(0.4f);
      }
    }
    for (int c = 0; c < kCorners; ++c) {
      for (int k = 0; k < shape.primitive_size; ++k)
        features[static_cast<size_t>(c) * layout.feature_stride + k] = uniform(1);
    }
    for (int s = 0; s < count; ++s) {
      PoolSample& sample = samples[s];
      for (int c = 0; c < 8; ++c) {
        sample.corner[c] =
            static_cast<int32_t>(rng.Below(kCorners / 2)) + (c < 4 ? 0 : kCorners / 2);
        sample.weight[c] = rng.Uniform();
      }
      for (float& e : sample.extra) e = uniform(1);
      for (float& v : sample.value) v = rng.Uniform() < 0.1f ? uniform(0.1f) : std::exp(uniform(4));
      sample.cosine = rng.Uniform();
      sample.importance = 0.5f + rng.Uniform();
    }
    for (int t = 0; t < kTexels; ++t) {
      for (int k = 0; k < layout.texture_inputs; ++k)
        texels[static_cast<size_t>(t) * layout.texture_stride + k] = uniform(1);
    }
    for (size_t s = 0; s < taps.size(); ++s) {
      for (int c = 0; c < 8; ++c) {
        taps[s].row[c] = static_cast<int32_t>(rng.Below(kTexels));
        taps[s].weight[c] = c == 3 ? 0 : rng.Uniform();
      }
    }
    TransposeWeights(layout, parameters.data(), transposed.data());
  }

  ChunkTask Task() const {
    ChunkTask task;
    task.layout = &layout;
    task.parameters = parameters.data();
    task.transposed = transposed.data();
    task.features = features.data();
    task.samples = samples.data();
    task.count = static_cast<int>(samples.size());
    if (taps.size() > 0) {
      task.texture = texels.data();
      task.taps = taps.data();
    }
    return task;
  }

  // y of a sample by the reference.
  template <class S>
  void Reference(const std::vector<S>& weights, const std::vector<S>& corners,
                 const std::vector<S>& texture, int s, S* y) const {
    ForwardReference(layout, weights.data(), corners.data(), samples[s], y, texture.data(),
                     taps.size() > 0 ? &taps[s] : nullptr);
  }

  NetworkLayout layout;
  AlignedBuffer<float> parameters, transposed, features;
  AlignedBuffer<PoolSample> samples;
  AlignedBuffer<float> texels;
  AlignedBuffer<TexelTaps> taps;
  ChunkScratch scratch;
  ChunkResult result;
};

class BrdfKernelsTest : public testing::TestWithParam<SimdTarget> {
 protected:
  void SetUp() override {
    if (!SimdTargetSupported(GetParam()))
      GTEST_SKIP() << "this CPU has no " << SimdTargetName(GetParam());
  }
  const BrdfKernels& kernels() const { return KernelsFor(GetParam()); }
};

INSTANTIATE_TEST_SUITE_P(Targets, BrdfKernelsTest,
                         testing::Values(SimdTarget::kAvx2, SimdTarget::kAvx512),
                         [](const auto& target) {
                           return std::string(SimdTargetName(target.param));
                         });

TEST_P(BrdfKernelsTest, ForwardAgreesWithTheReferenceForEveryShapeAndCount) {
  for (const Shape& shape : kShapes) {
    for (const int count : {1, 15, 16, 17, 100, 128}) {
      Case c(shape, count, static_cast<uint64_t>(count));
      kernels().forward_chunk(c.Task(), &c.scratch);
      std::vector<double> parameters(c.parameters.data(),
                                     c.parameters.data() + c.parameters.size());
      std::vector<double> features(c.features.data(), c.features.data() + c.features.size());
      std::vector<double> texels(c.texels.data(), c.texels.data() + c.texels.size());
      for (int s = 0; s < count; ++s) {
        double y[kOutputs];
        c.Reference(parameters, features, texels, s, y);
        for (int o = 0; o < kOutputs; ++o) {
          // Sums of at most 150 terms of about one: single precision loses some ulps of the sum of
          // their sizes.
          EXPECT_NEAR(static_cast<double>(c.scratch.outputs[static_cast<size_t>(s) * 16 + o]), y[o],
                      2e-5 * (1 + std::abs(y[o])));
        }
      }
    }
  }
}

TEST_P(BrdfKernelsTest, GradientsAgreeWithTheComplexStep) {
  using Complex = std::complex<double>;
  constexpr double kStep = 1e-30;
  for (const Shape& shape : kShapes) {
    constexpr int kCount = 5;
    Case c(shape, kCount, 7);
    kernels().train_chunk(c.Task(), &c.scratch, &c.result);
    std::vector<Complex> parameters(c.parameters.data(), c.parameters.data() + c.parameters.size());
    std::vector<Complex> features(c.features.data(), c.features.data() + c.features.size());
    std::vector<Complex> texels(c.texels.data(), c.texels.data() + c.texels.size());
    const auto loss = [&] {
      Complex sum = 0;
      for (int s = 0; s < kCount; ++s) {
        Complex y[kOutputs];
        c.Reference(parameters, features, texels, s, y);
        sum += LossReference(c.samples[s], y);
      }
      return sum;
    };
    EXPECT_NEAR(c.result.loss, loss().real(), 1e-5 * loss().real());
    double scale = 0;
    for (size_t i = 0; i < parameters.size(); ++i)
      scale = std::max(scale, std::abs(static_cast<double>(c.result.weight_gradient[i])));
    for (size_t i = 0; i < parameters.size(); i += 7) {
      parameters[i] += Complex(0, kStep);
      const double wanted = loss().imag() / kStep;
      parameters[i] = parameters[i].real();
      // Columns of padding have no gradient, whatever the reference says of a weight that nothing
      // reads.
      EXPECT_NEAR(static_cast<double>(c.result.weight_gradient[i]), wanted, 3e-5 * scale) << i;
    }
    // By the features: through the scatter.
    AlignedBuffer<float> gradient(c.features.size());
    for (int side = 0; side < 2; ++side)
      kernels().scatter(c.layout, c.samples.data(), kCount, side, c.result, gradient.data());
    scale = 0;
    for (size_t i = 0; i < gradient.size(); ++i)
      scale = std::max(scale, std::abs(static_cast<double>(gradient[i])));
    for (size_t i = 0; i < features.size(); i += 5) {
      features[i] += Complex(0, kStep);
      const double wanted = loss().imag() / kStep;
      features[i] = features[i].real();
      EXPECT_NEAR(static_cast<double>(gradient[i]), wanted, 3e-5 * scale) << i;
    }
    // And by the texels.
    AlignedBuffer<float> by_texel(c.texels.size());
    if (c.taps.size() > 0)
      kernels().scatter_texels(c.layout, c.taps.data(), kCount, c.result, by_texel.data());
    scale = 0;
    for (size_t i = 0; i < by_texel.size(); ++i)
      scale = std::max(scale, std::abs(static_cast<double>(by_texel[i])));
    for (size_t i = 0; i < texels.size(); i += 3) {
      texels[i] += Complex(0, kStep);
      const double wanted = loss().imag() / kStep;
      texels[i] = texels[i].real();
      EXPECT_NEAR(static_cast<double>(by_texel[i]), wanted, 3e-5 * scale) << i;
    }
  }
}

TEST_P(BrdfKernelsTest, ARowOfAnIndexStandsForItsCorner) {
  Case c(kShapes[0], 64, 3);
  std::vector<int32_t> rows(kCorners);
  for (int k = 0; k < kCorners; ++k) rows[k] = (k * 7 + 3) % kCorners;
  ChunkTask task = c.Task();
  task.row_of_corner = rows.data();
  kernels().forward_chunk(task, &c.scratch);
  std::vector<float> through_index(c.scratch.outputs.data(), c.scratch.outputs.data() + 64 * 16);
  AlignedBuffer<float> moved(c.features.size());
  for (int k = 0; k < kCorners; ++k) {
    std::memcpy(moved.data() + k * c.layout.feature_stride,
                c.features.data() + rows[k] * c.layout.feature_stride,
                sizeof(float) * static_cast<size_t>(c.layout.feature_stride));
  }
  task.row_of_corner = nullptr;
  task.features = moved.data();
  kernels().forward_chunk(task, &c.scratch);
  EXPECT_EQ(0, std::memcmp(through_index.data(), c.scratch.outputs.data(),
                           through_index.size() * sizeof(float)));
}

TEST_P(BrdfKernelsTest, ExtremeValuesGiveFiniteGradients) {
  for (const float value : {0.0f, -1.0f, 1e-30f, 1e30f, 65504.0f}) {
    for (const float bias : {-100.0f, -1e-20f, 0.0f, 11.999f, 12.0f, 80.0f}) {
      for (const float cosine : {1.0f, 1e-6f, 0.0f}) {
        Case c(kShapes[0], 16, 5);
        const DenseLayer& last = c.layout.layers.back();
        for (int o = 0; o < kOutputs; ++o)
          c.parameters[last.weights + static_cast<size_t>(last.inputs) * last.outputs + o] = bias;
        TransposeWeights(c.layout, c.parameters.data(), c.transposed.data());
        for (size_t s = 0; s < c.samples.size(); ++s) {
          for (float& v : c.samples[s].value) v = value;
          c.samples[s].cosine = cosine;
        }
        kernels().train_chunk(c.Task(), &c.scratch, &c.result);
        EXPECT_TRUE(std::isfinite(c.result.loss)) << value << " " << bias << " " << cosine;
        for (size_t i = 0; i < c.result.weight_gradient.size(); ++i)
          ASSERT_TRUE(std::isfinite(c.result.weight_gradient[i]));
      }
    }
  }
}

// The cap on y turns NaN and infinity into an ordinary value; they must show all the same.
TEST_P(BrdfKernelsTest, ValuesThatAreNotFiniteShowInTheLoss) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
        -std::numeric_limits<float>::infinity()}) {
    Case c(kShapes[0], 100, 11);
    const DenseLayer& last = c.layout.layers.back();
    c.parameters[last.weights + static_cast<size_t>(last.inputs) * last.outputs + 1] = bad;
    TransposeWeights(c.layout, c.parameters.data(), c.transposed.data());
    kernels().train_chunk(c.Task(), &c.scratch, &c.result);
    EXPECT_FALSE(std::isfinite(c.result.loss)) << bad;
  }
  // Gradients whose squares overflow would stop Adam for good.
  Case c(kShapes[0], 16, 12);
  kernels().train_chunk(c.Task(), &c.scratch, &c.result);
  EXPECT_TRUE(c.result.finite);
  for (size_t s = 0; s < c.samples.size(); ++s) c.samples[s].importance = 3e38f;
  kernels().train_chunk(c.Task(), &c.scratch, &c.result);
  EXPECT_FALSE(c.result.finite);
}

TEST_P(BrdfKernelsTest, OutputsBecomeValuesThatAreFiniteAndNotNegative) {
  const float inf = std::numeric_limits<float>::infinity();
  const float y[] = {-inf, -5, -1e-30f, 0,   1e-6f,
                     1,    12, 13,      inf, std::numeric_limits<float>::quiet_NaN()};
  for (const float value : y) {
    std::vector<float> rgb(3, -1);
    AlignedBuffer<float> outputs(16 * kChunkRows);
    for (int c = 0; c < kOutputs; ++c) outputs[c] = value;
    const Direction up;
    kernels().output_values(outputs.data(), &up, &up, 1, rgb.data());
    const double wanted = value > 0 ? std::expm1(std::min(static_cast<double>(value), 12.0)) : 0;
    // exp(y) - 1 in single precision: half an ulp of one, and two of the value.
    for (const float v : rgb)
      EXPECT_NEAR(static_cast<double>(v), wanted, 1.2e-7 + 3e-7 * wanted) << value;
  }
}

TEST(BrdfKernels, GiveTheSameBitsOnBothTargets) {
  if (!SimdTargetSupported(SimdTarget::kAvx512)) GTEST_SKIP() << "this CPU has no avx512";
  for (const Shape& shape : kShapes) {
    for (const int count : {3, 128}) {
      Case a(shape, count, 9), b(shape, count, 9);
      KernelsFor(SimdTarget::kAvx2).train_chunk(a.Task(), &a.scratch, &a.result);
      KernelsFor(SimdTarget::kAvx512).train_chunk(b.Task(), &b.scratch, &b.result);
      EXPECT_EQ(a.result.loss, b.result.loss);
      EXPECT_EQ(0, std::memcmp(a.result.weight_gradient.data(), b.result.weight_gradient.data(),
                               a.result.weight_gradient.size() * sizeof(float)));
      EXPECT_EQ(
          0, std::memcmp(a.result.feature_gradient.data(), b.result.feature_gradient.data(),
                         static_cast<size_t>(count) * a.layout.feature_columns() * sizeof(float)));
    }
  }
}

}  // namespace
}  // namespace patina::brdf
