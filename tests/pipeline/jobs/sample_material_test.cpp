#include "pipeline/jobs/sample_material.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace patina {
namespace {

TEST(SampleMaterial, IsTheSameForAnyNumberOfThreads) {
  ThreadPool one(1), three(3);
  const SampleMaterial a = MakeSampleMaterial(96, 5, one);
  const SampleMaterial b = MakeSampleMaterial(96, 5, three);
  EXPECT_EQ(a.albedo, b.albedo);
  EXPECT_EQ(a.normal, b.normal);
  EXPECT_EQ(a.arm, b.arm);
  EXPECT_EQ(a.height, b.height);
  EXPECT_EQ(a.emissive, b.emissive);
}

TEST(SampleMaterial, StaysInRangeAtEverySize) {
  ThreadPool pool(2);
  for (const int size : {1, 2, 3, 17, 64}) {
    const SampleMaterial m = MakeSampleMaterial(size, 1, pool);
    const size_t texels = static_cast<size_t>(size) * static_cast<size_t>(size);
    ASSERT_EQ(m.albedo.size(), 3 * texels);
    ASSERT_EQ(m.height.size(), texels);
    for (const auto* plane : {&m.albedo, &m.normal, &m.arm, &m.height, &m.emissive}) {
      EXPECT_TRUE(std::all_of(plane->begin(), plane->end(), [](float v) {
        return v >= 0 && v <= 1;
      })) << size;
    }
  }
}

TEST(SampleMaterial, HasVarietyInEveryMap) {
  ThreadPool pool(2);
  const SampleMaterial m = MakeSampleMaterial(128, 1, pool);
  auto range = [](const std::vector<float>& plane, size_t channel, size_t channels) {
    float low = 1, high = 0;
    for (size_t i = channel; i < plane.size(); i += channels) {
      low = std::min(low, plane[i]);
      high = std::max(high, plane[i]);
    }
    return high - low;
  };
  for (size_t c = 0; c < 3; ++c) EXPECT_GT(range(m.albedo, c, 3), 0.4f) << c;
  for (size_t c = 0; c < 2; ++c) EXPECT_GT(range(m.normal, c, 3), 0.4f) << c;
  for (size_t c = 0; c < 3; ++c) EXPECT_GT(range(m.arm, c, 3), 0.4f) << c;
  EXPECT_GT(range(m.height, 0, 1), 0.3f);
  EXPECT_GT(range(m.emissive, 0, 3), 0.3f);
}

TEST(SampleMaterial, HasNormalsThatBelongToItsHeight) {
  ThreadPool pool(2);
  constexpr int kSize = 64;
  const SampleMaterial m = MakeSampleMaterial(kSize, 3, pool);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      auto height = [&](int i, int j) {
        return m.height[static_cast<size_t>((j + kSize) % kSize * kSize + (i + kSize) % kSize)];
      };
      const float* n = m.normal.data() + 3 * static_cast<size_t>(y * kSize + x);
      const float nx = 2 * n[0] - 1, ny = 2 * n[1] - 1, nz = 2 * n[2] - 1;
      EXPECT_NEAR(nx * nx + ny * ny + nz * nz, 1, 1e-5);
      // Two texels across; Y points up while rows run down.
      const float scale = kSampleDepth * kSize / 2;
      EXPECT_NEAR(-nx / nz, scale * (height(x + 1, y) - height(x - 1, y)), 1e-3);
      EXPECT_NEAR(-ny / nz, scale * (height(x, y - 1) - height(x, y + 1)), 1e-3);
    }
  }
}

}  // namespace
}  // namespace patina
