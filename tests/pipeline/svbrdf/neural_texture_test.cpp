// The neural texture by itself: lookups, Adam of free texels and of blocks, export to BC6H.
#include "pipeline/svbrdf/neural_texture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "formats/half.h"
#include "pipeline/base/rng.h"

namespace patina::svbrdf {
namespace {

struct Fixture {
  Fixture(int width, int height, int levels, int textures, SimdTarget target)
      : shape{width, height, levels, textures, AddressMode::kWrap},
        layout(4, 0, 4, 1, shape.features()),
        texture(shape, layout, brdf::KernelsFor(target), TextureKernelsFor(target)),
        result(layout),
        pool(2) {}

  // A step of every texel of a level with gradient(row, feature) of its own.
  template <class Gradient>
  bool Step(int level, Gradient&& gradient, float texel_rate, float index_rate) {
    const int w = std::max(1, shape.width >> level), h = std::max(1, shape.height >> level);
    std::vector<brdf::TexelTaps> taps;
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        taps.push_back(texture.LookUp((static_cast<float>(x) + 0.5f) / static_cast<float>(w),
                                      (static_cast<float>(y) + 0.5f) / static_cast<float>(h),
                                      static_cast<float>(level)));
      }
    }
    for (size_t first = 0; first < taps.size(); first += brdf::kChunkRows) {
      const size_t count = std::min<size_t>(brdf::kChunkRows, taps.size() - first);
      for (size_t s = 0; s < count; ++s) {
        float* row = result.feature_gradient.data() + s * layout.feature_columns() +
                     2 * static_cast<size_t>(layout.feature_stride);
        for (int f = 0; f < shape.features(); ++f)
          row[f] = gradient(static_cast<size_t>(taps[first + s].row[0]), f);
      }
      texture.Scatter(taps.data() + first, static_cast<int>(count), result);
    }
    texture.SetRates(texel_rate, index_rate);
    return texture.Update(pool);
  }

  float At(size_t row, int feature) const { return texture.rows()[row * kRowFloats + feature]; }

  TextureShape shape;
  brdf::NetworkLayout layout;
  NeuralTexture texture;
  brdf::ChunkResult result;
  ThreadPool pool;
};

SimdTarget Best() { return *ActiveSimdTarget(); }

TEST(NeuralTexture, LooksUpTrilinearlyAndWrapsOrClamps) {
  for (const AddressMode address : {AddressMode::kWrap, AddressMode::kClamp}) {
    const TextureShape shape{6, 3, 3, 1, address};
    const brdf::NetworkLayout layout(4, 0, 4, 1, 3);
    const NeuralTexture texture(shape, layout, brdf::KernelsFor(Best()), TextureKernelsFor(Best()));
    Rng rng(3);
    for (int i = 0; i < 500; ++i) {
      const float u = rng.Uniform(), v = rng.Uniform(), s = 3 * rng.Uniform() - 0.5f;
      const brdf::TexelTaps taps = texture.LookUp(u, v, s);
      float sum = 0;
      for (int c = 0; c < 8; ++c) {
        sum += taps.weight[c];
        EXPECT_GE(taps.weight[c], 0);
        EXPECT_GE(taps.row[c], 0);
        EXPECT_LT(taps.row[c], shape.texels());
      }
      EXPECT_NEAR(sum, 1, 1e-6f);
    }
    // At the corner of the texture the four corners of level 0 meet, or one repeats.
    const brdf::TexelTaps corner = texture.LookUp(0, 0, 0);
    const bool wrap = address == AddressMode::kWrap;
    EXPECT_EQ(corner.row[0], wrap ? 2 * 6 + 5 : 0);
    EXPECT_EQ(corner.row[1], wrap ? 2 * 6 : 0);
    EXPECT_EQ(corner.row[2], wrap ? 5 : 0);
    EXPECT_EQ(corner.row[3], 0);
    // 6 x 3, then 3 x 1, then 1 x 1.
    EXPECT_EQ(texture.LookUp(0.5f, 0.5f, 1).row[0], 18 + 1);
    EXPECT_EQ(texture.LookUp(0.5f, 0.5f, 9).row[0], 21);
  }
}

// The first step of Adam goes by the rate against the gradient's sign, whatever its size.
TEST(NeuralTexture, FreeTexelsTakeAdamSteps) {
  Fixture fixture(7, 5, 3, 2, Best());
  const auto gradient = [](size_t row, int f) {
    return (row + static_cast<size_t>(f)) % 3 == 0 ? 0.0f : (row + f) % 2 == 0 ? 1e-3f : -5.0f;
  };
  ASSERT_TRUE(fixture.Step(0, gradient, 0.25f, 0));
  for (size_t row = 0; row < 35; ++row) {
    for (int f = 0; f < 6; ++f) {
      const float g = gradient(row, f);
      EXPECT_NEAR(fixture.At(row, f), g == 0 ? 0 : g > 0 ? -0.25f : 0.25f, 1e-4f);
    }
    // Features that no texture has.
    for (int f = 6; f < kRowFloats; ++f) EXPECT_EQ(fixture.At(row, f), 0);
  }
  for (size_t row = 35; row < static_cast<size_t>(fixture.shape.texels()); ++row)
    EXPECT_EQ(fixture.At(row, 0), 0);  // other levels
  fixture.texture.Save(fixture.pool);
  ASSERT_TRUE(fixture.Step(1, gradient, 0.25f, 0));
  EXPECT_NE(fixture.At(37, 0), 0);
  fixture.texture.Rollback(fixture.pool);
  EXPECT_EQ(fixture.At(37, 0), 0);
}

TEST(NeuralTexture, SaysSoWhenAValueIsNotFinite) {
  Fixture fixture(4, 4, 1, 1, Best());
  EXPECT_FALSE(fixture.Step(
      0, [](size_t, int) { return std::nanf(""); }, 0.1f, 0));
}

// Wanted values that two straight segments a block can hold: the trained blocks find them, their
// legal forms nearly, and what a decoder makes of the bytes is what the texture says.
TEST(NeuralTexture, BlocksLearnAndBecomeLegal) {
  for (const SimdTarget target : {SimdTarget::kAvx2, SimdTarget::kAvx512}) {
    if (!SimdTargetSupported(target)) continue;
    Fixture fixture(10, 6, 2, 2, target);
    const size_t rows = static_cast<size_t>(fixture.shape.texels());
    const auto wanted = [](size_t row, int f) {
      // Within [1, 2), where blocks are straight lines.
      return 1.2f + 0.3f * static_cast<float>(row % 5) / 5 * (f % 3 == 1 ? -1.0f : 1.0f) +
             0.1f * static_cast<float>(f);
    };
    const auto learn = [&](int steps, float texel_rate, float index_rate) {
      for (int step = 0; step < steps; ++step) {
        const float fade = 1 - static_cast<float>(step) / static_cast<float>(steps);
        for (int level = 0; level < 2; ++level) {
          ASSERT_TRUE(fixture.Step(
              level, [&](size_t row, int f) { return fixture.At(row, f) - wanted(row, f); },
              texel_rate * fade, index_rate * fade));
        }
      }
    };
    const auto error = [&] {
      double worst = 0;
      for (size_t row = 0; row < rows; ++row) {
        for (int f = 0; f < 6; ++f)
          worst =
              std::max(worst, std::abs(static_cast<double>(fixture.At(row, f) - wanted(row, f))));
      }
      return worst;
    };
    learn(200, 0.1f, 0);
    EXPECT_LT(error(), 0.02);
    fixture.texture.UseBlocks(fixture.pool);
    learn(100, 0.02f, 0.02f);
    // All features run along one line; eight positions on it remain for five values.
    EXPECT_LT(error(), 0.03);
    std::vector<float> sums = fixture.texture.MakeSensitivity();
    for (size_t row = 0; row < rows; ++row) {
      for (int t = 0; t < 2; ++t) {
        for (const int diagonal : {0, 3, 5}) sums[(row * 2 + t) * 6 + diagonal] = 1;
      }
    }
    fixture.texture.Encode(sums, fixture.pool);
    EXPECT_LT(error(), 0.05);
    for (int t = 0; t < 2; ++t) {
      size_t first = 0;
      for (int level = 0; level < 2; ++level) {
        const int w = 10 >> level, h = 6 >> level, across = (w + 3) / 4;
        for (int y = 0; y < h; ++y) {
          for (int x = 0; x < w; ++x) {
            uint16_t texels[16][3];
            bc6h::Decode(fixture.texture.blocks()[t][level][y / 4 * across + x / 4].data(),
                         bc6h::Format::kUf16, texels);
            for (int c = 0; c < 3; ++c) {
              EXPECT_EQ(HalfToFloat(texels[y % 4 * 4 + x % 4][c]),
                        fixture.At(first + static_cast<size_t>(y * w + x), 3 * t + c));
            }
          }
        }
        first += static_cast<size_t>(w) * h;
      }
    }
  }
}

TEST(NeuralTexture, RebasesSoThatTheNetworkSeesTheSame) {
  Fixture fixture(8, 8, 2, 1, Best());
  ASSERT_TRUE(fixture.Step(
      0, [](size_t row, int f) { return f == 2                      ? 0.0f
                                        : row % (f == 0 ? 2 : 3) == 0 ? 1.0f
                                                                      : -1.0f; }, 3, 0));
  const auto rows = static_cast<size_t>(fixture.shape.texels());
  const std::vector<float> before(fixture.texture.rows(),
                                  fixture.texture.rows() + rows * kRowFloats);
  TexelMoments moments = fixture.texture.Moments();
  for (size_t f = 0; f < 3; ++f) {
    for (size_t g = 0; g < 3; ++g) {
      double sums[3] = {0, 0, 0};
      for (size_t row = 0; row < rows; ++row) {
        const auto x = static_cast<double>(before[row * kRowFloats + f]);
        const auto y = static_cast<double>(before[row * kRowFloats + g]);
        sums[0] += x, sums[1] += y, sums[2] += x * y;
      }
      for (double& sum : sums) sum /= static_cast<double>(rows);
      EXPECT_NEAR(moments.mean[f], sums[0], 1e-6);
      EXPECT_NEAR(moments.covariance[3 * f + g], sums[2] - sums[0] * sums[1], 1e-5);
    }
  }
  const FeatureBasis basis =
      PrincipalBasis(moments.mean, moments.covariance, std::vector<double>{1, 0, 0, 0, 4, 0, 0, 0, 1});
  fixture.texture.Rebase(basis, fixture.pool);
  for (size_t row = 0; row < rows; ++row) {
    for (size_t f = 0; f < 3; ++f) {
      double x = basis.mean[f];
      for (size_t place = 0; place < 3; ++place) {
        const float y = fixture.At(row, static_cast<int>(place));
        x += basis.backward[3 * f + place] * (static_cast<double>(y) - 1);
        EXPECT_GE(y, 0.125f);
        EXPECT_LE(y, 1.875f);
      }
      EXPECT_NEAR(x, static_cast<double>(before[row * kRowFloats + f]), 1e-4);
    }
  }
}

}  // namespace
}  // namespace patina::svbrdf
