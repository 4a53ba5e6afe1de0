#include "pipeline/brdf/sphere_render.h"

#include <gtest/gtest.h>

#include <cmath>

namespace patina::brdf {
namespace {

EvaluatePairs Constant(float value) {
  return [value](int, size_t count, const Direction*, const Direction*, float* rgb) {
    for (size_t k = 0; k < 3 * count; ++k) rgb[k] = value;
  };
}

Environment White(int columns, int rows) {
  const std::vector<float> map(static_cast<size_t>(4 * columns) * 4 * rows * 3, 1.0f);
  return ReduceEnvironment(map, 4 * columns, 4 * rows, 3, columns, rows);
}

TEST(SphereRender, WhiteFurnace) {
  ThreadPool pool(2);
  const SphereImage image = RenderSphere(Constant(1 / 3.14159265f), White(64, 32), 32, 1, pool);
  int inside = 0;
  for (size_t p = 0; p < image.inside.size(); ++p) {
    if (image.inside[p] == 0) continue;
    ++inside;
    // The quadrature of the cosine over 64 x 32 texels is within half a percent.
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(image.rgb[3 * p + c], 1.0f, 0.006f);
  }
  // The sphere subtends asin(0.5 / 2) of the 15 degrees to the border: 96 % of the half width.
  EXPECT_NEAR(inside / 1024.0, 3.14159 / 4 * 0.9637 * 0.9637, 0.03);
}

TEST(SphereRender, TheSideTowardsTheLightIsBright) {
  // One lamp above the camera's left shoulder: +x lies to the left.
  Environment environment;
  environment.lights.push_back({{0.57735f, 0.57735f, -0.57735f}, {3, 3, 3}});
  ThreadPool pool(1);
  const SphereImage image = RenderSphere(Constant(1), environment, 64, 1, pool);
  const auto at = [&](int x, int y) { return image.rgb[(static_cast<size_t>(y) * 64 + x) * 3]; };
  EXPECT_GT(at(20, 20), 1.5f);
  EXPECT_GT(at(20, 20), at(44, 20));
  EXPECT_GT(at(20, 20), at(20, 44));
  EXPECT_EQ(at(50, 52), 0.0f);
  EXPECT_EQ(at(0, 0), 0.0f);
}

TEST(SphereRender, ReducingAMapKeepsItsLight) {
  std::vector<float> map(128 * 64 * 3, 0.0f);
  for (int c = 0; c < 3; ++c) map[(20 * 128 + 90) * 3 + c] = 1000;
  const Environment small = ReduceEnvironment(map, 128, 64, 3, 16, 8),
                    same = ReduceEnvironment(map, 128, 64, 3, 128, 64);
  double sums[2] = {0, 0};
  for (const auto& light : small.lights) sums[0] += static_cast<double>(light.power[1]);
  for (const auto& light : same.lights) sums[1] += static_cast<double>(light.power[1]);
  EXPECT_NEAR(sums[0], sums[1], 1e-5 * sums[1]);
  EXPECT_GT(sums[0], 0);
}

std::vector<float> Ramp(int width, int height) {
  std::vector<float> map(static_cast<size_t>(width) * height * 3);
  for (size_t i = 0; i < map.size(); ++i) map[i] = 0.5f + 0.001f * static_cast<float>(i % 997);
  return map;
}

TEST(SphereRender, EvenTexelsKeepTheLightAndShareTheSphere) {
  const std::vector<float> map = Ramp(100, 50), white(200 * 100 * 3, 1.0f);
  const Environment even = ReduceEnvironmentEvenly(map, 100, 50, 3, 24),
                    full = ReduceEnvironment(map, 100, 50, 3, 100, 50);
  double sums[2] = {0, 0};
  for (const auto& light : even.lights) sums[0] += static_cast<double>(light.power[2]);
  for (const auto& light : full.lights) sums[1] += static_cast<double>(light.power[2]);
  EXPECT_NEAR(sums[0], sums[1], 1e-5 * sums[1]);
  // 24 columns and 12 rows hold 288 texels, of which the sphere has room for 2 / pi.
  EXPECT_NEAR(static_cast<double>(even.lights.size()), 288 * 0.6366, 6);
  const Environment areas = ReduceEnvironmentEvenly(white, 200, 100, 3, 24);
  ASSERT_EQ(areas.lights.size(), even.lights.size());
  for (size_t l = 0; l < areas.lights.size(); ++l) {
    EXPECT_EQ(areas.lights[l].direction.x, even.lights[l].direction.x);
    // The rows at the poles have three texels where three and an eighth belong; a texel of the map
    // in eight falls to one side of a border or the other.
    EXPECT_NEAR(areas.lights[l].power[0], 4 * 3.14159f / 183, 0.2f * 4 * 3.14159f / 183);
  }
}

TEST(SphereRender, SeveralEnvironmentsGiveTheImagesOfEach) {
  ThreadPool pool(2);
  const std::vector<float> map = Ramp(64, 32), white(64 * 32 * 3, 1.0f);
  const Environment both[2] = {ReduceEnvironmentEvenly(map, 64, 32, 3, 16),
                               ReduceEnvironmentEvenly(white, 64, 32, 3, 16)};
  const auto images = RenderSpheres(Constant(0.2f), both, 24, 2, pool);
  ASSERT_EQ(images.size(), 2u);
  for (int e = 0; e < 2; ++e) {
    const SphereImage alone = RenderSphere(Constant(0.2f), both[e], 24, 2, pool);
    EXPECT_EQ(images[e].rgb, alone.rgb);
    EXPECT_EQ(images[e].inside, alone.inside);
  }
  EXPECT_NE(images[0].rgb, images[1].rgb);
}

TEST(SphereRender, ComparingFindsTheDifferenceThatIsThere) {
  ThreadPool pool(1);
  const SphereImage a = RenderSphere(Constant(0.10f), StudioEnvironment(32, 16), 48, 1, pool);
  const SphereImage b = RenderSphere(Constant(0.11f), StudioEnvironment(32, 16), 48, 1, pool);
  const ImageError same = CompareSpheres(a, a, pool), other = CompareSpheres(a, b, pool);
  EXPECT_EQ(same.mae_linear, 0);
  EXPECT_EQ(same.rmse_srgb, 0);
  EXPECT_NEAR(same.ssim, 1, 1e-6);
  EXPECT_GT(other.mae_linear, 1e-3);
  EXPECT_GE(other.rmse_linear, other.mae_linear);
  EXPECT_LT(other.ssim, 1);
}

}  // namespace
}  // namespace patina::brdf
