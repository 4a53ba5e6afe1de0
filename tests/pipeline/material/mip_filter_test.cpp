#include "pipeline/material/mip_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "pipeline/base/rng.h"

namespace patina {
namespace {

TEST(BoxTapsFor, CoversEveryTexelEqually) {
  for (int size = 1; size <= 67; ++size) {
    std::vector<double> share(size, 0);
    const int next = NextMipSide(size);
    for (int i = 0; i < next; ++i) {
      const BoxTaps taps = BoxTapsFor(size, i);
      double sum = 0;
      for (int tap = 0; tap < taps.count; ++tap) {
        ASSERT_LT(taps.first + tap, size);
        share[taps.first + tap] += taps.weight[tap];
        sum += taps.weight[tap];
      }
      EXPECT_NEAR(sum, 1, 1e-6) << size;
    }
    for (int i = 0; i < size; ++i)
      EXPECT_NEAR(share[i], static_cast<double>(next) / size, 1e-6) << size;
  }
}

PlaneLevel RandomLevel(int width, int height, int planes) {
  PlaneLevel level;
  level.Allocate(width, height, planes);
  Rng rng(7);
  for (float& value : level.data) value = rng.Uniform();
  return level;
}

double Mean(const PlaneLevel& level, int plane) {
  double sum = 0;
  for (int y = 0; y < level.height; ++y) {
    for (int x = 0; x < level.width; ++x) sum += level.Row(plane, y)[x];
  }
  return sum / level.width / level.height;
}

TEST(NextLevel, KeepsTheMeanDownToOneTexel) {
  ThreadPool pool(2);
  for (const auto& [width, height] :
       {std::pair{1, 1}, {2, 2}, {3, 3}, {64, 64}, {37, 1}, {1, 50}, {101, 63}, {256, 5}}) {
    PlaneLevel level = RandomLevel(width, height, 2);
    const double means[2] = {Mean(level, 0), Mean(level, 1)};
    for (int guard = 0; guard < 20 && (level.width > 1 || level.height > 1); ++guard) {
      const int w = level.width, h = level.height;
      level = NextLevel(level, pool);
      EXPECT_EQ(level.width, std::max(1, w / 2));
      EXPECT_EQ(level.height, std::max(1, h / 2));
      // Float rounding only: relative 1e-6 of values in [0, 1].
      EXPECT_NEAR(Mean(level, 0), means[0], 2e-6) << width << " x " << height;
      EXPECT_NEAR(Mean(level, 1), means[1], 2e-6);
    }
    EXPECT_EQ(level.data.size(), 2u);
  }
}

TEST(NextLevel, IsTheSameForAnyThreadCount) {
  ThreadPool one(1), three(3);
  const PlaneLevel level = RandomLevel(75, 49, 3);
  EXPECT_EQ(NextLevel(level, one).data, NextLevel(level, three).data);
}

TEST(WidenRoughness, LeavesFlatNormalsAlone) {
  for (const float roughness : {0.0f, 0.001f, 0.25f, 0.5f, 1.0f}) {
    EXPECT_EQ(WidenRoughness(roughness, 1.0f), roughness);
    EXPECT_EQ(WidenRoughness(roughness, 1.0000001f), roughness);
    EXPECT_EQ(WidenRoughness(roughness, 0.9999999f), roughness);
  }
}

TEST(WidenRoughness, GrowsWithLostLengthAndRoughness) {
  for (float roughness = 0; roughness <= 1; roughness += 0.125f) {
    float before = 0;
    for (float length = 1; length >= 0; length -= 0.01f) {
      const float widened = WidenRoughness(roughness, length);
      EXPECT_GE(widened, before);
      EXPECT_GE(widened, roughness);
      EXPECT_LE(widened, 1.0f);
      before = widened;
    }
    EXPECT_EQ(before, 1.0f);
  }
  EXPECT_LT(WidenRoughness(0.2f, 0.95f), WidenRoughness(0.4f, 0.95f));
}

TEST(WidenRoughness, AgreesWithTheFormula) {
  const double length = 0.9, roughness = 0.3;
  const double alpha2 = std::pow(roughness, 4) + 2 * (1 - length) / length;
  EXPECT_NEAR(WidenRoughness(0.3f, 0.9f), std::pow(alpha2, 0.25), 1e-6);
}

TEST(WidenRoughness, KeepsValuesThatAreNoRoughness) {
  EXPECT_EQ(WidenRoughness(1.5f, 0.5f), 1.5f);
  EXPECT_TRUE(std::isfinite(WidenRoughness(0.5f, 0.0f)));
}

double Coverage(const std::vector<float>& opacities, float scale) {
  const auto count = std::count_if(opacities.begin(), opacities.end(), [&](float opacity) {
    return std::min(1.0f, opacity * scale) >= 0.5f;
  });
  return static_cast<double>(count) / static_cast<double>(opacities.size());
}

TEST(CoverageScale, MeetsTheCoverageToATexel) {
  Rng rng(3);
  for (const size_t count : {1u, 2u, 7u, 100u, 4096u}) {
    std::vector<float> opacities(count);
    for (float& opacity : opacities) opacity = 0.6f * rng.Uniform();
    for (const double wanted : {0.0, 0.1, 0.33, 0.5, 0.9, 1.0}) {
      const float scale = CoverageScale(opacities, wanted, 0.5f);
      EXPECT_TRUE(std::isfinite(scale));
      EXPECT_NEAR(Coverage(opacities, scale), wanted, 0.5 / static_cast<double>(count) + 1e-9)
          << count << " " << wanted;
    }
  }
}

TEST(CoverageScale, LeavesWellAlone) {
  EXPECT_EQ(CoverageScale(std::vector<float>{0.9f, 0.1f}, 0.5, 0.5f), 1.0f);
  EXPECT_EQ(CoverageScale(std::vector<float>{0.0f, 0.0f}, 0.5, 0.5f), 1.0f);  // nothing can be done
  EXPECT_EQ(CoverageScale(std::vector<float>{0.3f, 0.3f, 0.3f}, 0.4, 0.5f),
            1.0f);  // all or none: none is nearer
  EXPECT_EQ(CoverageScale({}, 0.5, 0.5f), 1.0f);
}

}  // namespace
}  // namespace patina
