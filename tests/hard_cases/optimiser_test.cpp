// The optimisers' kernels at their limits: no gradient for a million steps, gradients beyond
// floats, dead codes, softmax at its extremes. On every SIMD target; with denormals flushed, as the
// trainers' threads do.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "pipeline/brdf/grid_trainer.h"
#include "pipeline/material/window_kernels.h"
#include "tests/hard_cases/everywhere.h"

namespace patina {
namespace {

using test::Settings;

constexpr float kInf = std::numeric_limits<float>::infinity(),
                kNan = std::numeric_limits<float>::quiet_NaN();

// Sixteen parameters and their moments.
struct Lanes {
  alignas(64) float params[16], gradient[16], moment1[16], moment2[16];
  void Set(float param, float g, float m, float v) {
    std::fill(params, params + 16, param);
    std::fill(gradient, gradient + 16, g);
    std::fill(moment1, moment1 + 16, m);
    std::fill(moment2, moment2 + 16, v);
  }
};

// With the same flags as a training's loops.
template <class Body>
void AsInTraining(Body&& body) {
  ThreadPool pool(1);
  pool.ParallelFor(1, [&](int, int) { body(); });
}

AdamRates Rates() {
  return {.endpoint = 0.01f, .index = 0.01f, .beta1 = 0.9f, .beta2 = 0.99f, .epsilon = 1e-8f};
}

// Moments fall below the normal floats, then to zero; the parameter comes to rest; and the first
// gradient after it makes a step of (1 - beta1) / sqrt(1 - beta2) times the rate, not a division by
// zero.
TEST(ZeroGradients, ForAMillionStepsLeaveTheMaterialOptimiserReady) {
  for (const auto& setting : Settings()) {
    const MaterialKernels& kernels = KernelsFor(setting.target);
    AsInTraining([&] {
      Lanes lanes;
      lanes.Set(0.5f, 0, 3.0f, 9.0f);
      float at_rest = 0;
      for (int step = 1; step <= 1000000; ++step) {
        ASSERT_TRUE(kernels.adam_flat(lanes.params, lanes.gradient, lanes.moment1, lanes.moment2,
                                      16, step, Rates()));
        if (step == 100000) at_rest = lanes.params[0];
      }
      EXPECT_EQ(lanes.params[0], at_rest);
      EXPECT_EQ(lanes.moment1[0], 0);
      EXPECT_EQ(lanes.moment2[0], 0);
      for (const float gradient : {1.0f, 1e-3f, -1e10f}) {
        lanes.Set(0.5f, gradient, 0, 0);
        ASSERT_TRUE(kernels.adam_flat(lanes.params, lanes.gradient, lanes.moment1, lanes.moment2,
                                      16, 1000001, Rates()));
        EXPECT_NEAR(std::abs(lanes.params[7] - 0.5f), 0.01f * 0.1f / std::sqrt(0.01f), 1e-5f);
      }
    });
  }
}

TEST(ZeroGradients, ForAMillionStepsLeaveTheBrdfOptimiserReady) {
  for (const auto& setting : Settings()) {
    const brdf::BrdfKernels& kernels = brdf::KernelsFor(setting.target);
    AsInTraining([&] {
      Lanes lanes;
      lanes.Set(0.5f, 0, 3.0f, 9.0f);
      brdf::AdamSettings settings;
      settings.rate = 0.01f;
      for (int step = 0; step < 1000000; ++step) {
        ASSERT_TRUE(
            kernels.adam(lanes.params, lanes.gradient, lanes.moment1, lanes.moment2, 16, settings));
      }
      EXPECT_EQ(lanes.moment1[0], 0);
      EXPECT_EQ(lanes.moment2[0], 0);
      lanes.Set(0.5f, 1e-3f, 0, 0);
      ASSERT_TRUE(
          kernels.adam(lanes.params, lanes.gradient, lanes.moment1, lanes.moment2, 16, settings));
      EXPECT_NEAR(lanes.params[7], 0.5f - 0.01f, 1e-5f);
      EXPECT_EQ(lanes.gradient[7], 0);
    });
  }
}

// A block that is updated more often than its counter can count.
TEST(ZeroGradients, BlocksThatGetNoneAreLeftAloneAndCountersStopAtTheirEnd) {
  for (const auto& setting : Settings()) {
    const MaterialKernels& kernels = KernelsFor(setting.target);
    for (const BlockForm form : {BlockForm::kSegments, BlockForm::kFree}) {
      FeatureStore store;
      ModelShape shape{};
      for (FeatureShape& feature : shape) feature = {0, 8, 4, 1};
      store.Allocate(shape, form, StoreUse::kAccumulate);
      FeatureLevel& level = store.textures[0][0];
      const int stride = BlockStride(form);
      std::fill(level.params.data(), level.params.data() + level.params.size(), 2.0f);
      level.gradient[stride + 1] = 1e-3f;  // of the second block alone
      level.updates[1] = 0xFFFF;
      AsInTraining([&] { ASSERT_TRUE(kernels.apply_gradient(&level, form, 0, 2, Rates())); });
      EXPECT_EQ(level.params[1], 2.0f);
      EXPECT_EQ(level.updates[0], 0);
      EXPECT_EQ(level.updates[1], 0xFFFF);
      EXPECT_NEAR(level.params[stride + 1], 2.0f - 0.01f, 1e-4f);
      EXPECT_EQ(level.gradient[stride + 1], 0) << "cleared";
    }
  }
}

// Endpoints and indices are clamped: a NaN among them would turn into the lower bound and never be
// heard of again.
TEST(NonFiniteGradients, AreNoticedWhateverTheyWouldBecome) {
  for (const auto& setting : Settings()) {
    const MaterialKernels& kernels = KernelsFor(setting.target);
    const brdf::BrdfKernels& brdf_kernels = brdf::KernelsFor(setting.target);
    AsInTraining([&] {
      for (const float bad : {kNan, kInf, -kInf, 1e25f /* its square */}) {
        for (const BlockForm form : {BlockForm::kSegments, BlockForm::kFree}) {
          for (int place = 0; place < BlockStride(form); place += 5) {
            FeatureStore store;
            ModelShape shape{};
            for (FeatureShape& feature : shape) feature = {0, 4, 4, 1};
            store.Allocate(shape, form, StoreUse::kAccumulate);
            FeatureLevel& level = store.textures[0][0];
            level.gradient[place] = bad;
            EXPECT_FALSE(kernels.apply_gradient(&level, form, 0, 1, Rates()))
                << bad << " at " << place;
          }
        }
        Lanes lanes;
        lanes.Set(1, 0, 0, 0);
        lanes.gradient[13] = bad;
        EXPECT_FALSE(kernels.adam_flat(lanes.params, lanes.gradient, lanes.moment1, lanes.moment2,
                                       16, 1, Rates()));
        lanes.Set(1, 0, 0, 0);
        lanes.gradient[13] = bad;
        EXPECT_FALSE(
            brdf_kernels.adam(lanes.params, lanes.gradient, lanes.moment1, lanes.moment2, 16, {}));
      }
      // The largest that is none of these, and the smallest.
      for (const float fine : {1e18f, -1e18f, 1e-45f, -0.0f}) {
        Lanes lanes;
        lanes.Set(1, fine, 0, 0);
        EXPECT_TRUE(kernels.adam_flat(lanes.params, lanes.gradient, lanes.moment1, lanes.moment2,
                                      16, 1, Rates()))
            << fine;
        lanes.Set(1, fine, 0, 0);
        EXPECT_TRUE(
            brdf_kernels.adam(lanes.params, lanes.gradient, lanes.moment1, lanes.moment2, 16, {}))
            << fine;
      }
    });
  }
}

// p_j (s_j - <p, s>) / temperature in double. Where logits are hundreds of temperatures apart, the
// softmax is one-hot.
TEST(SoftmaxLimits, LogitsOfPlusAndMinusAHundredAgreeWithDouble) {
  constexpr int kCodes = 37, kStride = 16;
  const int columns = brdf::PadTo16(kCodes);
  for (const auto& setting : Settings()) {
    const brdf::BrdfKernels& kernels = brdf::KernelsFor(setting.target);
    for (const float temperature : {1.0f, 0.5f, 0.01f, 1e-3f}) {
      for (int shape = 0; shape < 5; ++shape) {
        AlignedBuffer<float> logits(columns), transposed(static_cast<size_t>(kStride) * columns),
            slope(columns);
        alignas(64) float gradient[kStride];
        Rng rng(static_cast<uint64_t>(shape));
        for (int j = 0; j < columns; ++j) {
          const float wave = j % 2 == 0 ? 100.0f : -100.0f;
          const float by_shape[] = {100.0f, -100.0f, j == 20 ? 100.0f : -100.0f, wave,
                                    200 * rng.Uniform() - 100};
          logits[j] = j < kCodes ? by_shape[shape] : -1e30f;
          for (int k = 0; k < kStride; ++k)
            transposed[static_cast<size_t>(k) * columns + j] =
                j < kCodes ? 2 * rng.Uniform() - 1 : 0;
        }
        for (float& g : gradient) g = 2 * rng.Uniform() - 1;
        AsInTraining([&] {
          kernels.softmax_gradient(logits.data(), columns, temperature, transposed.data(), gradient,
                                   kStride, slope.data());
        });
        std::vector<double> s(kCodes), p(kCodes);
        double top = -1e300, mass = 0, mean = 0, largest = 0;
        for (int j = 0; j < kCodes; ++j) top = std::max(top, static_cast<double>(logits[j]));
        for (int j = 0; j < kCodes; ++j) {
          for (int k = 0; k < kStride; ++k)
            s[j] += static_cast<double>(gradient[k]) *
                    static_cast<double>(transposed[static_cast<size_t>(k) * columns + j]);
          p[j] =
              std::exp((static_cast<double>(logits[j]) - top) / static_cast<double>(temperature));
          mass += p[j];
          mean += p[j] * s[j];
          largest = std::max(largest, std::abs(s[j]));
        }
        for (int j = 0; j < kCodes; ++j) {
          const double wanted =
              p[j] / mass * (s[j] - mean / mass) / static_cast<double>(temperature);
          // Logits of 100 over a temperature of 1e-3 leave 1e-2 of the exponent's argument to
          // rounding.
          const double bound = 2e-5 * largest / static_cast<double>(temperature);
          EXPECT_NEAR(static_cast<double>(slope[j]), wanted, bound)
              << "shape " << shape << " temperature " << temperature;
        }
        for (int j = kCodes; j < columns; ++j) EXPECT_NEAR(slope[j], 0, 1e-20f);
      }
    }
  }
}

// Codes that no corner refers to get no gradient, and no share of the others' either.
TEST(DeadCodes, KeepTheirBitsWhileOthersLearn) {
  constexpr int kCorners = 24, kCodes = 40;
  const brdf::NetworkLayout layout(16, 3, 16, 2);
  AlignedBuffer<brdf::PoolSample> samples(128);
  Rng rng(2);
  for (size_t s = 0; s < samples.size(); ++s) {
    brdf::PoolSample& sample = samples[s];
    for (int c = 0; c < 8; ++c) {
      sample.corner[c] = static_cast<int32_t>(rng.Below(kCorners / 2)) + (c < 4 ? 0 : kCorners / 2);
      sample.weight[c] = 0.25f;
    }
    for (float& v : sample.value) v = 1 + rng.Uniform();
    sample.cosine = 0.5f;
    sample.importance = 1;
  }
  test::Everywhere(
      [&](int threads) {
        ThreadPool pool(threads);
        brdf::GridTrainer trainer(layout, kCorners, brdf::KernelsFor(*ActiveSimdTarget()), pool, 1);
        std::vector<float> codes(static_cast<size_t>(kCodes) * 16);
        Rng start(3);
        for (float& code : codes) code = start.Uniform();
        std::vector<int32_t> index(kCorners);
        for (int c = 0; c < kCorners; ++c) index[c] = c % 2 == 0 ? 7 : 39;
        trainer.UseCodebook(codes, index);
        trainer.Save();
        for (int step = 0; step < 300; ++step)
          EXPECT_TRUE(trainer.Step(samples.data(), 128, {0.01f, 0.01f, 0.1f}));
        std::vector<float> after(trainer.codebook().data(),
                                 trainer.codebook().data() + codes.size());
        for (int code = 0; code < kCodes; ++code) {
          const bool same = std::memcmp(&after[code * 16], &codes[code * 16], 64) == 0;
          EXPECT_EQ(same, code != 7 && code != 39) << code;
        }
        for (const float value : after) EXPECT_TRUE(std::isfinite(value));
        return after;
      },
      [](const auto& a, const auto& b) {
        return std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
      });
}

}  // namespace
}  // namespace patina
