// Indices that are learned through a softmax: the gradient against the complex step, and that a row
// finds the code that fits.
#include "pipeline/brdf/soft_index.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "pipeline/base/rng.h"

namespace patina::brdf {
namespace {

constexpr int kStride = 16;

std::vector<SimdTarget> Targets() {
  std::vector<SimdTarget> targets;
  for (const SimdTarget target : {SimdTarget::kAvx2, SimdTarget::kAvx512}) {
    if (SimdTargetSupported(target)) targets.push_back(target);
  }
  return targets;
}

// The loss is <g, sum_j softmax(logits / temperature)_j code_j>, whose slope by the feature is g.
TEST(SoftmaxGradient, AgreesWithTheComplexStep) {
  using Complex = std::complex<double>;
  for (const SimdTarget target : Targets()) {
    for (const int codes : {1, 3, 16, 100}) {
      for (const double temperature : {1.0, 0.5, 0.02}) {
        const int columns = PadTo16(codes);
        Rng rng(static_cast<uint64_t>(codes));
        AlignedBuffer<float> logits(columns), transposed(static_cast<size_t>(kStride) * columns),
            slope(columns);
        float g[kStride];
        for (int j = 0; j < columns; ++j) logits[j] = j < codes ? 6 * rng.Uniform() - 3 : -1e30f;
        for (int k = 0; k < kStride; ++k) {
          g[k] = 2 * rng.Uniform() - 1;
          for (int j = 0; j < codes; ++j) transposed[k * columns + j] = 2 * rng.Uniform() - 1;
        }
        KernelsFor(target).softmax_gradient(logits.data(), columns, static_cast<float>(temperature),
                                            transposed.data(), g, kStride, slope.data());
        for (int moved = 0; moved < columns; ++moved) {
          Complex mass = 0, value = 0;
          for (int j = 0; j < codes; ++j) {
            const Complex logit(static_cast<double>(logits[j]), j == moved ? 1e-30 : 0.0);
            const Complex p = std::exp((logit - 3.0) / temperature);
            double s = 0;
            for (int k = 0; k < kStride; ++k)
              s += static_cast<double>(g[k]) * static_cast<double>(transposed[k * columns + j]);
            mass += p;
            value += p * s;
          }
          const double wanted = (value / mass).imag() / 1e-30;
          EXPECT_NEAR(slope[moved], wanted, 2e-5 / temperature) << codes << " " << moved;
        }
      }
    }
  }
}

TEST(SoftIndex, ARowFindsTheCodeThatFits) {
  ThreadPool pool(2);
  constexpr int kCodes = 20;
  Rng rng(4);
  std::vector<float> codes(kCodes * kStride), wanted(3 * kStride);
  for (float& c : codes) c = 2 * rng.Uniform() - 1;
  const int32_t fits[3] = {7, 0, 19};
  SoftIndex soft({2, 5, 9}, kCodes, kStride, KernelsFor(Targets().front()), pool);
  soft.StartAtRandom(3);
  std::vector<int32_t> index(12, -1);
  soft.WriteIndices(index);
  EXPECT_EQ(index[3], -1) << "a corner without logits keeps its index";
  const int32_t corners[3] = {2, 5, 9};
  for (int step = 1; step <= 400; ++step) {
    for (int row = 0; row < 3; ++row) {
      float gradient[kStride];  // of half the squared distance to the code that fits
      for (int k = 0; k < kStride; ++k)
        gradient[k] = codes[index[corners[row]] * kStride + k] - codes[fits[row] * kStride + k];
      soft.Accumulate(corners[row], gradient);
    }
    AdamSettings settings;
    settings.rate = 0.05f;
    settings.correction1 = static_cast<float>(1 / (1 - std::pow(0.9, step)));
    settings.correction2 = static_cast<float>(1 / (1 - std::pow(0.99, step)));
    soft.Update(codes.data(), 1, settings, index);
  }
  for (int row = 0; row < 3; ++row) EXPECT_EQ(index[corners[row]], fits[row]);
  EXPECT_EQ(index[3], -1);
}

TEST(SoftIndex, StartsWithTheNearestCode) {
  ThreadPool pool(2);
  constexpr int kCodes = 30, kCorners = 200;
  Rng rng(5);
  AlignedBuffer<float> features(kCorners * kStride);
  std::vector<float> codes(kCodes * kStride);
  for (float& c : codes) c = 2 * rng.Uniform() - 1;
  std::vector<int32_t> corners, index(kCorners), nearest(kCorners);
  for (int c = 0; c < kCorners; ++c) {
    corners.push_back(c);
    nearest[c] = static_cast<int32_t>(rng.Below(kCodes));
    for (int k = 0; k < kStride; ++k)
      features[c * kStride + k] = codes[nearest[c] * kStride + k] + 0.01f * rng.Uniform();
  }
  SoftIndex soft(corners, kCodes, kStride, KernelsFor(Targets().front()), pool);
  soft.StartFromFeatures(features.data(), codes.data(), 4);
  soft.WriteIndices(index);
  EXPECT_EQ(index, nearest);
}

}  // namespace
}  // namespace patina::brdf
