// A lit sphere, for previews and for the frozen evaluation protocol: deterministic, without Monte
// Carlo noise.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include "formats/brdf/brdf_source.h"
#include "pipeline/base/thread_pool.h"

namespace patina::brdf {

// Light from all around as texels of a latitude-longitude map: each a direction, towards the light,
// with the mean radiance of the texel times its solid angle. World frame: y up, the map's centre
// column towards +z, the top row y = 1.
struct Environment {
  struct Light {
    Direction direction;
    float power[3];  // radiance * solid angle, linear Rec. 709
  };
  std::vector<Light> lights;
};

// Averages a map [height][width][channels] down to columns x rows texels by solid angle. channels
// >= 3, values finite.
Environment ReduceEnvironment(std::span<const float> map, int width, int height, int channels,
                              int columns, int rows);
// The same with texels of nearly equal area: columns / 2 rows, each with as many texels as its
// middle's sine asks for, and no fewer than three. Maps of all sizes give the same directions.
// columns >= 4, even; the map has at least columns x columns / 2 texels.
Environment ReduceEnvironmentEvenly(std::span<const float> map, int width, int height, int channels,
                                    int columns);
// A sky, a ground and three soft lamps, for when there is no map.
Environment StudioEnvironment(int columns, int rows);

// f for `count` pairs in the local frame of the surface, both above the horizon: rgb [count][3].
// Must be thread-safe; `worker` is below the pool's thread count.
using EvaluatePairs = std::function<void(int worker, size_t count, const Direction* wi,
                                         const Direction* wo, float* rgb)>;

struct SphereImage {
  int side = 0;
  std::vector<float> rgb;       // [side][side][3], linear, exposed; zero beside the sphere
  std::vector<uint8_t> inside;  // [side][side]: the pixel's centre sees the sphere
};

// Sphere of radius 0.5 at the origin, camera at (0, 0, -2) looking along +z, 30 degrees field of
// view, one ray through each pixel's centre. Tangents run along the sphere's parallels (around y).
// Radiance is the sum over all lights, times exposure.
SphereImage RenderSphere(const EvaluatePairs& evaluate, const Environment& environment, int side,
                         float exposure, ThreadPool& pool);

// The same under several environments at once, which share their lights' directions: the BRDF,
// which costs most, is evaluated once for all. Image by image the bits of RenderSphere. At least
// one.
std::vector<SphereImage> RenderSpheres(const EvaluatePairs& evaluate,
                                       std::span<const Environment> environments, int side,
                                       float exposure, ThreadPool& pool);

// Errors over the sphere's pixels of images clamped to [0, 1]: linear, and coded with the sRGB
// curve. SSIM: mean over channels of the coded images, whole frame.
struct ImageError {
  double mae_linear = 0, rmse_linear = 0, mae_srgb = 0, rmse_srgb = 0, ssim = 1;
};
ImageError CompareSpheres(const SphereImage& reference, const SphereImage& test, ThreadPool& pool);

}  // namespace patina::brdf
