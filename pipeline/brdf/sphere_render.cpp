#include "pipeline/brdf/sphere_render.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "formats/base/check.h"
#include "pipeline/color/color.h"
#include "pipeline/metrics/ssim.h"

namespace patina::brdf {
namespace {

constexpr double kPi = std::numbers::pi;

float Dot(const Direction& a, const Direction& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

Direction Cross(const Direction& a, const Direction& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

Direction Normalized(const Direction& a) {
  const float inverse = 1 / std::sqrt(Dot(a, a));
  return {a.x * inverse, a.y * inverse, a.z * inverse};
}

// The direction at the angle theta from the top and the fraction `turn` of the way round.
Direction LatLongDirection(double theta, double turn) {
  const double phi = 2 * kPi * (turn - 0.5);
  return {static_cast<float>(std::sin(theta) * std::sin(phi)), static_cast<float>(std::cos(theta)),
          static_cast<float>(std::sin(theta) * std::cos(phi))};
}

// Centre of a texel and its solid angle.
Direction TexelDirection(double column, double row, int columns, int rows) {
  return LatLongDirection(kPi * (row + 0.5) / rows, (column + 0.5) / columns);
}

double TexelSolidAngle(int row, int columns, int rows) {
  return 2 * kPi / columns * (std::cos(kPi * row / rows) - std::cos(kPi * (row + 1) / rows));
}

struct Frame {
  Direction tangent, bitangent, normal;
  Direction ToLocal(const Direction& w) const {
    return {Dot(w, tangent), Dot(w, bitangent), Dot(w, normal)};
  }
};

Frame FrameAt(const Direction& normal) {
  const Direction around = {normal.z, 0, -normal.x};  // y cross normal
  const Direction tangent = Dot(around, around) > 1e-12f ? Normalized(around) : Direction{1, 0, 0};
  return {tangent, Cross(normal, tangent), normal};
}

// The first point of the sphere that the pixel's ray meets; false beside it.
bool HitSphere(int x, int y, int side, Direction* normal, Direction* view) {
  const double scale = std::tan(15 * kPi / 180);
  const double px = ((x + 0.5) / side * 2 - 1) * scale, py = (1 - (y + 0.5) / side * 2) * scale;
  const double length = std::sqrt(px * px + py * py + 1);
  // Seen along +z, +x of the world lies to the left.
  const double dx = -px / length, dy = py / length, dz = 1 / length;
  constexpr double kDistance = 2, kRadius = 0.5;
  const double b = kDistance * dz;
  const double root = b * b - (kDistance * kDistance - kRadius * kRadius);
  if (root <= 0) return false;
  const double t = b - std::sqrt(root);
  *normal = {static_cast<float>(t * dx / kRadius), static_cast<float>(t * dy / kRadius),
             static_cast<float>((t * dz - kDistance) / kRadius)};
  *view = {static_cast<float>(-dx), static_cast<float>(-dy), static_cast<float>(-dz)};
  return true;
}

}  // namespace

Environment ReduceEnvironment(std::span<const float> map, int width, int height, int channels,
                              int columns, int rows) {
  std::vector<double> sums(static_cast<size_t>(columns) * rows * 3);
  for (int y = 0; y < height; ++y) {
    const double solid_angle = TexelSolidAngle(y, width, height);
    const int row = static_cast<int>(static_cast<int64_t>(y) * rows / height);
    for (int x = 0; x < width; ++x) {
      const int column = static_cast<int>(static_cast<int64_t>(x) * columns / width);
      for (int c = 0; c < 3; ++c) {
        sums[(static_cast<size_t>(row) * columns + column) * 3 + c] +=
            solid_angle *
            static_cast<double>(map[(static_cast<size_t>(y) * width + x) * channels + c]);
      }
    }
  }
  Environment environment;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      Environment::Light light;
      light.direction = TexelDirection(column, row, columns, rows);
      for (int c = 0; c < 3; ++c)
        light.power[c] =
            static_cast<float>(sums[(static_cast<size_t>(row) * columns + column) * 3 + c]);
      environment.lights.push_back(light);
    }
  }
  return environment;
}

Environment ReduceEnvironmentEvenly(std::span<const float> map, int width, int height, int channels,
                                    int columns) {
  const int rows = columns / 2;
  std::vector<int> texels(rows);
  std::vector<size_t> first(rows);
  Environment environment;
  for (int row = 0; row < rows; ++row) {
    texels[row] =
        std::max(3, static_cast<int>(std::lround(columns * std::sin(kPi * (row + 0.5) / rows))));
    first[row] = environment.lights.size();
    for (int column = 0; column < texels[row]; ++column) {
      Environment::Light light{};
      const double theta = kPi * (row + 0.5) / rows;
      light.direction = LatLongDirection(theta, (column + 0.5) / texels[row]);
      environment.lights.push_back(light);
    }
  }
  std::vector<double> sums(environment.lights.size() * 3);
  for (int y = 0; y < height; ++y) {
    const double solid_angle = TexelSolidAngle(y, width, height);
    const auto row = static_cast<int>((2 * static_cast<int64_t>(y) + 1) * rows / (2 * height));
    for (int x = 0; x < width; ++x) {
      const auto column =
          static_cast<int>((2 * static_cast<int64_t>(x) + 1) * texels[row] / (2 * width));
      for (int c = 0; c < 3; ++c) {
        sums[(first[row] + column) * 3 + c] +=
            solid_angle *
            static_cast<double>(map[(static_cast<size_t>(y) * width + x) * channels + c]);
      }
    }
  }
  for (size_t l = 0; l < environment.lights.size(); ++l) {
    for (int c = 0; c < 3; ++c)
      environment.lights[l].power[c] = static_cast<float>(sums[3 * l + c]);
  }
  return environment;
}

Environment StudioEnvironment(int columns, int rows) {
  struct Lamp {
    Direction towards;
    float radiance[3];
    float sharpness;
  };
  const Lamp lamps[] = {{Normalized({-0.6f, 0.7f, -0.6f}), {9.0f, 8.4f, 7.5f}, 60},
                        {Normalized({0.9f, 0.25f, -0.4f}), {2.4f, 3.0f, 4.0f}, 24},
                        {Normalized({0.1f, 0.5f, 0.9f}), {6.0f, 5.2f, 4.4f}, 120}};
  Environment environment;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      Environment::Light light;
      light.direction = TexelDirection(column, row, columns, rows);
      const float up = light.direction.y;
      const float sky[3] = {0.30f + 0.10f * up, 0.34f + 0.16f * up, 0.40f + 0.26f * up};
      const float ground[3] = {0.16f, 0.14f, 0.12f};
      for (int c = 0; c < 3; ++c) {
        float radiance = up > 0 ? sky[c] : ground[c];
        for (const Lamp& lamp : lamps)
          radiance += lamp.radiance[c] *
                      std::exp(lamp.sharpness * (Dot(light.direction, lamp.towards) - 1));
        light.power[c] =
            static_cast<float>(static_cast<double>(radiance) * TexelSolidAngle(row, columns, rows));
      }
      environment.lights.push_back(light);
    }
  }
  return environment;
}

SphereImage RenderSphere(const EvaluatePairs& evaluate, const Environment& environment, int side,
                         float exposure, ThreadPool& pool) {
  return std::move(RenderSpheres(evaluate, {&environment, 1}, side, exposure, pool)[0]);
}

std::vector<SphereImage> RenderSpheres(const EvaluatePairs& evaluate,
                                       std::span<const Environment> environments, int side,
                                       float exposure, ThreadPool& pool) {
  const std::vector<Environment::Light>& directions = environments[0].lights;
  const size_t lights = directions.size();
  for (const Environment& environment : environments) {
    PATINA_CHECK(environment.lights.size() == lights);
    for (size_t l = 0; l < lights; ++l) {
      const Direction &a = environment.lights[l].direction, &b = directions[l].direction;
      PATINA_CHECK(a.x == b.x && a.y == b.y && a.z == b.z);
    }
  }
  SphereImage empty;
  empty.side = side;
  empty.rgb.resize(static_cast<size_t>(side) * side * 3);
  empty.inside.resize(static_cast<size_t>(side) * side);
  std::vector<SphereImage> images(environments.size(), empty);
  struct Scratch {
    std::vector<Direction> wi, wo;
    std::vector<float> rgb;
    std::vector<int> light;
  };
  std::vector<Scratch> scratch(pool.threads());
  for (Scratch& own : scratch) {
    own.wi.resize(lights);
    own.wo.resize(lights);
    own.rgb.resize(lights * 3);
    own.light.resize(lights);
  }
  pool.ParallelFor(side, [&](int y, int worker) {
    Scratch& own = scratch[worker];
    for (int x = 0; x < side; ++x) {
      Direction normal, view;
      if (!HitSphere(x, y, side, &normal, &view)) continue;
      const size_t pixel = static_cast<size_t>(y) * side + x;
      const Frame frame = FrameAt(normal);
      const Direction to_camera = frame.ToLocal(view);
      size_t count = 0;
      for (size_t l = 0; l < lights; ++l) {
        const Direction local = frame.ToLocal(directions[l].direction);
        if (!(local.z > 0) || !(to_camera.z > 0)) continue;
        own.wi[count] = local;
        own.wo[count] = to_camera;
        own.light[count++] = static_cast<int>(l);
      }
      evaluate(worker, count, own.wi.data(), own.wo.data(), own.rgb.data());
      for (size_t e = 0; e < environments.size(); ++e) {
        SphereImage& image = images[e];
        image.inside[pixel] = 1;
        double sum[3] = {0, 0, 0};
        for (size_t k = 0; k < count; ++k) {
          const Environment::Light& light = environments[e].lights[own.light[k]];
          for (int c = 0; c < 3; ++c)
            sum[c] += static_cast<double>(light.power[c] * own.rgb[3 * k + c] * own.wi[k].z);
        }
        for (int c = 0; c < 3; ++c)
          image.rgb[3 * pixel + c] = exposure * static_cast<float>(sum[c]);
      }
    }
  });
  return images;
}

ImageError CompareSpheres(const SphereImage& reference, const SphereImage& test, ThreadPool& pool) {
  const int side = reference.side;
  const size_t pixels = static_cast<size_t>(side) * side;
  std::vector<float> coded[2][3];
  ImageError error;
  double count = 0;
  for (int c = 0; c < 3; ++c) {
    std::vector<float> linear[2];
    for (int k = 0; k < 2; ++k) {
      const SphereImage& image = k == 0 ? reference : test;
      linear[k].resize(pixels);
      for (size_t p = 0; p < pixels; ++p)
        linear[k][p] = std::clamp(image.rgb[3 * p + c], 0.0f, 1.0f);
      coded[k][c].resize(pixels);
      LinearToSrgbRow(linear[k].data(), pixels, coded[k][c].data());
    }
    for (size_t p = 0; p < pixels; ++p) {
      if (reference.inside[p] == 0) continue;
      const double a = static_cast<double>(linear[0][p] - linear[1][p]),
                   b = static_cast<double>(coded[0][c][p] - coded[1][c][p]);
      error.mae_linear += std::abs(a);
      error.rmse_linear += a * a;
      error.mae_srgb += std::abs(b);
      error.rmse_srgb += b * b;
      ++count;
    }
  }
  error.mae_linear /= count;
  error.mae_srgb /= count;
  error.rmse_linear = std::sqrt(error.rmse_linear / count);
  error.rmse_srgb = std::sqrt(error.rmse_srgb / count);
  error.ssim = 0;
  for (int c = 0; c < 3; ++c) {
    error.ssim += metrics::MeanSsim(metrics::DensePlane(coded[0][c].data(), side, side),
                                    metrics::DensePlane(coded[1][c].data(), side, side), pool) /
                  3;
  }
  return error;
}

}  // namespace patina::brdf
