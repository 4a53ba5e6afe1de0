#include "pipeline/jobs/tileable_noise.h"

#include <algorithm>
#include <cmath>

namespace patina {
namespace {

int Wrap(int i, int period) {
  const int r = i % period;
  return r < 0 ? r + period : r;
}

float Fade(float t) { return t * t * t * (t * (t * 6 - 15) + 10); }

// Dot product of (dx, dy) with one of 16 directions, picked by the hash.
float Gradient(uint32_t hash, float dx, float dy) {
  static constexpr float kDirections[16][2] = {
      {1, 0},  {0.9239f, 0.3827f},   {0.7071f, 0.7071f},   {0.3827f, 0.9239f},
      {0, 1},  {-0.3827f, 0.9239f},  {-0.7071f, 0.7071f},  {-0.9239f, 0.3827f},
      {-1, 0}, {-0.9239f, -0.3827f}, {-0.7071f, -0.7071f}, {-0.3827f, -0.9239f},
      {0, -1}, {0.3827f, -0.9239f},  {0.7071f, -0.7071f},  {0.9239f, -0.3827f}};
  const float* d = kDirections[hash & 15];
  return d[0] * dx + d[1] * dy;
}

}  // namespace

uint32_t LatticeHash(int x, int y, uint32_t seed) {
  uint32_t h = seed * 0x9E3779B1u + static_cast<uint32_t>(x) * 0x85EBCA77u +
               static_cast<uint32_t>(y) * 0xC2B2AE3Du;
  h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
  h = (h ^ (h >> 12)) * 0x297A2D39u;
  return h ^ (h >> 15);
}

float LatticeRandom(int x, int y, uint32_t seed) {
  return static_cast<float>(LatticeHash(x, y, seed) >> 8) * 0x1p-24f;
}

float TileableNoise(float u, float v, int period, uint32_t seed) {
  const float x = u * static_cast<float>(period);
  const float y = v * static_cast<float>(period);
  const float floor_x = std::floor(x);
  const float floor_y = std::floor(y);
  const float fx = x - floor_x;
  const float fy = y - floor_y;
  const int x0 = Wrap(static_cast<int>(floor_x), period);
  const int y0 = Wrap(static_cast<int>(floor_y), period);
  const int x1 = x0 + 1 == period ? 0 : x0 + 1;
  const int y1 = y0 + 1 == period ? 0 : y0 + 1;
  const float a = Gradient(LatticeHash(x0, y0, seed), fx, fy);
  const float b = Gradient(LatticeHash(x1, y0, seed), fx - 1, fy);
  const float c = Gradient(LatticeHash(x0, y1, seed), fx, fy - 1);
  const float d = Gradient(LatticeHash(x1, y1, seed), fx - 1, fy - 1);
  const float wx = Fade(fx);
  const float wy = Fade(fy);
  const float top = a + (b - a) * wx;
  const float bottom = c + (d - c) * wx;
  return 1.4142f * (top + (bottom - top) * wy);
}

float TileableFbm(float u, float v, int period, int octaves, uint32_t seed) {
  float sum = 0;
  float weight = 1;
  float total = 0;
  for (int i = 0; i < octaves; ++i) {
    sum += weight * TileableNoise(u, v, period << i, seed + static_cast<uint32_t>(i) * 101u);
    total += weight;
    weight *= 0.5f;
  }
  return sum / total;
}

// Based on: I. Quilez, "Voronoi - distances". The border is found in a second pass around the
// nearest point.
VoronoiHit TileableVoronoi(float u, float v, int period, uint32_t seed) {
  const float x = u * static_cast<float>(period);
  const float y = v * static_cast<float>(period);
  const int cell_x = static_cast<int>(std::floor(x));
  const int cell_y = static_cast<int>(std::floor(y));
  struct Point {
    float x, y;
  };
  auto point_of = [&](int cx, int cy) {
    const int wx = Wrap(cx, period);
    const int wy = Wrap(cy, period);
    return Point{static_cast<float>(cx) + 0.1f + 0.8f * LatticeRandom(wx, wy, seed) - x,
                 static_cast<float>(cy) + 0.1f + 0.8f * LatticeRandom(wx, wy, seed + 77u) - y};
  };
  int nearest_x = cell_x;
  int nearest_y = cell_y;
  float nearest = 1e9f;
  for (int j = -1; j <= 1; ++j) {
    for (int i = -1; i <= 1; ++i) {
      const Point p = point_of(cell_x + i, cell_y + j);
      const float d = p.x * p.x + p.y * p.y;
      if (d < nearest) {
        nearest = d;
        nearest_x = cell_x + i;
        nearest_y = cell_y + j;
      }
    }
  }
  const Point mine = point_of(nearest_x, nearest_y);
  VoronoiHit hit;
  hit.cell = LatticeHash(Wrap(nearest_x, period), Wrap(nearest_y, period), seed + 991u);
  hit.border = 1e9f;
  for (int j = -2; j <= 2; ++j) {
    for (int i = -2; i <= 2; ++i) {
      if (i == 0 && j == 0) continue;
      const Point p = point_of(nearest_x + i, nearest_y + j);
      const float dx = p.x - mine.x;
      const float dy = p.y - mine.y;
      const float length = std::sqrt(dx * dx + dy * dy);
      if (length < 1e-5f) continue;
      const float border = (0.5f * (mine.x + p.x) * dx + 0.5f * (mine.y + p.y) * dy) / length;
      hit.border = std::min(hit.border, border);
    }
  }
  return hit;
}

}  // namespace patina
