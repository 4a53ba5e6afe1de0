#include "pipeline/jobs/sample_material.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/rng.h"
#include "pipeline/jobs/tileable_noise.h"

namespace patina {
namespace {

constexpr int kTiles = 3;       // octagons a side
constexpr float kCut = 0.575f;  // distance from an octagon's centre to its diagonal sides, in tiles
constexpr float kJoint = 0.016f;  // half the width of a joint, in tiles
constexpr float kRootHalf = 0.70710678f;

struct Rgb {
  float r, g, b;
};

float Clamp01(float x) { return std::clamp(x, 0.0f, 1.0f); }

float Smooth(float low, float high, float x) {
  const float t = Clamp01((x - low) / (high - low));
  return t * t * (3 - 2 * t);
}

float Mix(float a, float b, float t) { return a + (b - a) * t; }
Rgb Mix(Rgb a, Rgb b, float t) { return {Mix(a.r, b.r, t), Mix(a.g, b.g, t), Mix(a.b, b.b, t)}; }
Rgb Scale(Rgb a, float k) { return {a.r * k, a.g * k, a.b * k}; }

// Independent seeds for the layers of noise.
struct Seeds {
  explicit Seeds(uint64_t seed) {
    Rng rng(seed, 0x7061);
    for (uint32_t& s : of) s = static_cast<uint32_t>(rng.Next());
  }
  uint32_t operator[](int layer) const { return of[static_cast<size_t>(layer)]; }
  std::array<uint32_t, 24> of{};
};

struct Surface {
  float height = 0;
  Rgb albedo{};
  Rgb emissive{};
  float roughness = 0;
  float metalness = 0;
};

// Where a place lies in the pattern of octagons with a square between each four.
struct Place {
  int tile_x = 0, tile_y = 0;
  float x = 0, y = 0;              // from the centre of the tile, in tiles
  float stone_edge = 0;            // distance to the edge of the octagon, inside positive, in tiles
  float inlay_edge = 0;            // the same of the nearest inlay
  float inlay_x = 0, inlay_y = 0;  // from the inlay's centre along its sides
  int inlay_id_x = 0, inlay_id_y = 0;
};

Place Locate(float u, float v, float warp_x, float warp_y) {
  Place p;
  const float gx = u * kTiles + warp_x;
  const float gy = v * kTiles + warp_y;
  const float fx = std::floor(gx);
  const float fy = std::floor(gy);
  p.tile_x = (static_cast<int>(fx) + 4 * kTiles) % kTiles;
  p.tile_y = (static_cast<int>(fy) + 4 * kTiles) % kTiles;
  p.x = gx - fx - 0.5f;
  p.y = gy - fy - 0.5f;
  const float ax = std::fabs(p.x);
  const float ay = std::fabs(p.y);
  p.stone_edge = std::min({0.5f - ax, 0.5f - ay, kCut - (ax + ay) * kRootHalf}) - kJoint;
  const float cx = gx - std::floor(gx + 0.5f);
  const float cy = gy - std::floor(gy + 0.5f);
  p.inlay_id_x = (static_cast<int>(std::floor(gx + 0.5f)) + 4 * kTiles) % kTiles;
  p.inlay_id_y = (static_cast<int>(std::floor(gy + 0.5f)) + 4 * kTiles) % kTiles;
  p.inlay_x = (cx + cy) * kRootHalf;
  p.inlay_y = (cx - cy) * kRootHalf;
  const float apothem = kRootHalf - kCut - kJoint;
  p.inlay_edge = apothem - std::max(std::fabs(p.inlay_x), std::fabs(p.inlay_y));
  return p;
}

Surface Joint(float u, float v, const Seeds& seeds) {
  const float grain = TileableNoise(u, v, 160, seeds[0]);
  const float lumps = TileableFbm(u, v, 36, 3, seeds[1]);
  Surface s;
  s.height = 0.20f + 0.05f * lumps + 0.025f * grain;
  s.albedo = Scale(Mix({0.29f, 0.25f, 0.21f}, {0.40f, 0.35f, 0.29f}, 0.5f + 0.5f * lumps),
                   1 + 0.18f * grain);
  s.roughness = 0.93f + 0.04f * grain;
  return s;
}

Surface Stone(float u, float v, const Place& p, const Seeds& seeds) {
  const int tx = p.tile_x;
  const int ty = p.tile_y;
  static constexpr Rgb kKinds[4] = {
      {0.46f, 0.47f, 0.50f}, {0.60f, 0.54f, 0.46f}, {0.38f, 0.41f, 0.43f}, {0.55f, 0.45f, 0.39f}};
  const uint32_t kind =
      (static_cast<uint32_t>(tx + 2 * ty) + (LatticeHash(tx, ty, seeds[2]) & 1)) & 3;

  const float broad = TileableFbm(u, v, 5, 4, seeds[3]);
  const float fine = TileableFbm(u, v, 40, 4, seeds[4]);
  const float speckle = TileableNoise(u, v, 230, seeds[5]);
  // Bands of another mineral, bent by the broad noise, running another way in each tile.
  const float turn = 6.2831853f * LatticeRandom(tx, ty, seeds[6]);
  const float along = p.x * std::cos(turn) + p.y * std::sin(turn);
  const float bands = std::sin(19 * along + 7 * broad + 2.2f * fine);

  Surface s;
  s.albedo = kKinds[kind];
  s.albedo = Scale(s.albedo, 0.90f + 0.2f * LatticeRandom(tx, ty, seeds[7]));
  s.albedo = Mix(s.albedo, Scale(s.albedo, 1.28f), 0.55f * Smooth(0.1f, 1.0f, bands));
  s.albedo = Mix(s.albedo, Scale(s.albedo, 0.66f), 0.65f * Smooth(0.05f, 0.5f, -broad));
  s.albedo = Scale(s.albedo, 1 + 0.17f * fine + 0.10f * speckle);

  // Worn smooth towards the middle, chipped at the edge, each tile a little higher or tilted.
  const float chips = TileableFbm(u, v, 26, 3, seeds[8]);
  const float edge = p.stone_edge - 0.018f * Smooth(0.15f, 0.55f, chips);
  const float bevel = 1 - std::pow(1 - Clamp01(edge / 0.045f), 2.2f);
  const float wear = Smooth(0.06f, 0.35f, p.stone_edge + 0.06f * broad);
  const float lift = 0.07f * (LatticeRandom(tx, ty, seeds[9]) - 0.5f);
  const float tilt = 0.10f * (p.x * (LatticeRandom(tx, ty, seeds[10]) - 0.5f) +
                              p.y * (LatticeRandom(tx, ty, seeds[11]) - 0.5f));
  const float pits = Smooth(0.38f, 0.62f, TileableNoise(u, v, 75, seeds[12]));
  s.height = 0.24f + 0.40f * bevel + lift + tilt + 0.035f * broad + (0.05f - 0.03f * wear) * fine -
             0.045f * pits;
  s.roughness = Clamp01(0.80f - 0.30f * wear + 0.14f * fine + 0.12f * pits + 0.05f * speckle);
  s.albedo = Mix(Scale(s.albedo, 0.72f), s.albedo, Smooth(0.0f, 0.05f, edge));
  s.albedo = Mix(s.albedo, Scale(s.albedo, 0.62f), 0.8f * pits);

  // Two nets of cracks; the coarse one runs through some tiles only, the fine one where the broad
  // noise is low.
  const float bend_x = 0.016f * TileableFbm(u, v, 18, 3, seeds[13]);
  const float bend_y = 0.016f * TileableFbm(u, v, 18, 3, seeds[14]);
  const VoronoiHit coarse = TileableVoronoi(u + bend_x, v + bend_y, 8, seeds[15]);
  const VoronoiHit thin = TileableVoronoi(u - bend_y, v + bend_x, 22, seeds[16]);
  const float cracked = LatticeRandom(tx, ty, seeds[17]) < 0.5f ? 1.0f : 0.0f;
  const float width = 0.015f * (0.5f + 1.1f * Smooth(-0.6f, 0.6f, broad + fine));
  const float deep = cracked * (1 - Smooth(width, 2.6f * width, coarse.border));
  const float hair = Smooth(-0.05f, 0.25f, -broad) * (1 - Smooth(0.02f, 0.07f, thin.border));
  s.height -= 0.26f * deep + 0.05f * hair;
  // The pieces between deep cracks have settled differently.
  s.height += cracked * 0.035f * (static_cast<float>(coarse.cell >> 8) * 0x1p-24f - 0.5f);
  s.albedo = Mix(s.albedo, Scale(s.albedo, 0.30f), 0.9f * deep);
  s.albedo = Mix(s.albedo, Scale(s.albedo, 0.62f), 0.7f * hair);
  s.roughness = Mix(s.roughness, 0.95f, std::max(deep, 0.5f * hair));

  // Some of the deep cracks glow.
  const float live = Smooth(0.02f, 0.22f, TileableFbm(u, v, 3, 2, seeds[18]));
  const float core = cracked * live * (1 - Smooth(0.25f * width, 1.5f * width, coarse.border));
  const float halo = cracked * live * 0.30f * std::exp(-coarse.border / 0.065f) *
                     Smooth(0.0f, 0.08f, p.stone_edge);
  const Rgb hot{1.0f, 0.62f, 0.20f};
  const Rgb warm{0.95f, 0.30f, 0.06f};
  const float glow = Clamp01(core + halo);
  s.emissive = Scale(Mix(warm, hot, core), glow);
  return s;
}

Surface Inlay(float u, float v, const Place& p, const Seeds& seeds) {
  const float broad = TileableFbm(u, v, 14, 4, seeds[19]);
  // Scratches: noise stretched along a direction of its own for each inlay.
  const bool upright = (LatticeHash(p.inlay_id_x, p.inlay_id_y, seeds[20]) & 1) != 0;
  const float scratch = TileableNoise(upright ? u * 4 : u, upright ? v : v * 4, 60, seeds[20]);
  const float ring = std::sqrt(p.inlay_x * p.inlay_x + p.inlay_y * p.inlay_y);
  const float groove = 1 - Smooth(0.004f, 0.010f, std::fabs(ring - 0.072f));
  const float angle = std::atan2(p.inlay_y, p.inlay_x);
  const float star = 0.034f + 0.016f * std::cos(8 * angle);
  const float boss = Smooth(0.012f, -0.010f, ring - star);
  const float rim = 1 - Smooth(0.0f, 0.005f, std::fabs(p.inlay_edge - 0.016f) - 0.003f);

  // Verdigris gathers at the rim, in the groove and where the noise is high.
  const float age =
      0.55f * Smooth(0.022f, 0.0f, p.inlay_edge) + 0.5f * groove + 0.35f * rim - 0.35f * boss;
  const float verdigris = Smooth(0.20f, 0.55f, age + 0.95f * broad + 0.08f * scratch);

  Surface s;
  const float bevel = 1 - std::pow(1 - Clamp01(p.inlay_edge / 0.012f), 2.0f);
  s.height = 0.26f + 0.36f * bevel + 0.07f * boss - 0.06f * groove - 0.04f * rim +
             0.012f * scratch + 0.05f * verdigris * (0.4f + 0.6f * broad);
  const Rgb brass = Scale(Mix({0.90f, 0.74f, 0.42f}, {0.78f, 0.60f, 0.33f}, 0.5f + 0.5f * broad),
                          1 + 0.05f * scratch);
  const Rgb green = Mix({0.30f, 0.56f, 0.50f}, {0.46f, 0.68f, 0.58f},
                        0.5f + 0.9f * TileableNoise(u, v, 120, seeds[21]));
  s.albedo = Mix(brass, green, verdigris);
  s.metalness = 1 - verdigris;
  s.roughness = Clamp01(Mix(0.26f + 0.10f * scratch + 0.10f * broad, 0.86f, verdigris));
  return s;
}

// Covers what lies low and near the joints.
void GrowMoss(float u, float v, const Place& p, const Seeds& seeds, Surface* s) {
  const float where = TileableFbm(u, v, 4, 3, seeds[22]);
  const float tuft = TileableFbm(u, v, 64, 3, seeds[23]);
  const float near_joint = Smooth(0.10f, -0.02f, std::max(p.stone_edge, 2.2f * p.inlay_edge));
  const float low = Smooth(0.62f, 0.22f, s->height);
  const float cover =
      Smooth(0.30f, 0.55f, 0.55f * low + 0.45f * near_joint + 1.3f * where - 0.52f + 0.22f * tuft);
  const float live_glow = std::max({s->emissive.r, s->emissive.g, s->emissive.b});
  const float moss = cover * (1 - Smooth(0.05f, 0.3f, live_glow));
  const Rgb colour =
      Mix({0.22f, 0.25f, 0.11f}, {0.45f, 0.48f, 0.22f}, Clamp01(0.5f + 0.8f * tuft + 0.3f * where));
  s->height = Mix(s->height, std::max(s->height, 0.30f) + 0.07f + 0.10f * tuft, moss);
  s->albedo = Mix(s->albedo, colour, moss);
  s->roughness = Mix(s->roughness, 0.96f, moss);
  s->metalness *= 1 - moss;
  s->emissive = Scale(s->emissive, 1 - moss);
}

Surface Shade(float u, float v, const Seeds& seeds) {
  const float warp_x = 0.020f * TileableFbm(u, v, 24, 3, seeds[8] + 5u);
  const float warp_y = 0.020f * TileableFbm(u, v, 24, 3, seeds[9] + 5u);
  // Stone is rough at its edges, the brass was cut straight.
  const Place stone_place = Locate(u, v, warp_x, warp_y);
  const Place brass_place = Locate(u, v, 0, 0);
  Place p = stone_place;
  p.inlay_edge = brass_place.inlay_edge;
  p.inlay_x = brass_place.inlay_x;
  p.inlay_y = brass_place.inlay_y;
  p.inlay_id_x = brass_place.inlay_id_x;
  p.inlay_id_y = brass_place.inlay_id_y;

  Surface s = Joint(u, v, seeds);
  if (p.inlay_edge > 0) {
    s = Inlay(u, v, p, seeds);
  } else if (p.stone_edge > 0) {
    s = Stone(u, v, p, seeds);
  }
  GrowMoss(u, v, p, seeds, &s);
  s.height = Clamp01(s.height);
  return s;
}

// Mean over a (2 radius + 1)^2 window that wraps, in two passes.
std::vector<float> BoxBlur(const std::vector<float>& in, int size, int radius, ThreadPool& pool) {
  std::vector<float> rows(in.size());
  std::vector<float> out(in.size());
  const float scale = 1.0f / static_cast<float>(2 * radius + 1);
  auto pass = [&](const std::vector<float>& from, std::vector<float>& to, size_t step,
                  size_t stride) {
    pool.ParallelFor(size, [&](int line, int) {
      const float* src = from.data() + static_cast<size_t>(line) * stride;
      float* dst = to.data() + static_cast<size_t>(line) * stride;
      double sum = 0;
      for (int i = -radius; i <= radius; ++i)
        sum += src[static_cast<size_t>((i % size + size) % size) * step];
      for (int i = 0; i < size; ++i) {
        dst[static_cast<size_t>(i) * step] = static_cast<float>(sum) * scale;
        sum += src[static_cast<size_t>((i + radius + 1) % size) * step];
        sum -= src[static_cast<size_t>(((i - radius) % size + size) % size) * step];
      }
    });
  };
  pass(in, rows, 1, static_cast<size_t>(size));
  pass(rows, out, static_cast<size_t>(size), 1);
  return out;
}

}  // namespace

SampleMaterial MakeSampleMaterial(int size, uint64_t seed, ThreadPool& pool) {
  const Seeds seeds(seed);
  const size_t texels = static_cast<size_t>(size) * static_cast<size_t>(size);
  SampleMaterial m;
  m.size = size;
  m.albedo.resize(3 * texels);
  m.normal.resize(3 * texels);
  m.arm.resize(3 * texels);
  m.height.resize(texels);
  m.emissive.resize(3 * texels);

  pool.ParallelFor(size, [&](int y, int) {
    const float v = (static_cast<float>(y) + 0.5f) / static_cast<float>(size);
    for (int x = 0; x < size; ++x) {
      const float u = (static_cast<float>(x) + 0.5f) / static_cast<float>(size);
      const Surface s = Shade(u, v, seeds);
      const size_t i = static_cast<size_t>(y) * size + x;
      m.height[i] = s.height;
      const float albedo[3] = {s.albedo.r, s.albedo.g, s.albedo.b};
      const float emissive[3] = {s.emissive.r, s.emissive.g, s.emissive.b};
      for (size_t c = 0; c < 3; ++c) {
        m.albedo[3 * i + c] = Clamp01(albedo[c]);
        m.emissive[3 * i + c] = Clamp01(emissive[c]);
      }
      m.arm[3 * i + 1] = Clamp01(s.roughness);
      m.arm[3 * i + 2] = Clamp01(s.metalness);
    }
  });

  const std::vector<float> narrow = BoxBlur(m.height, size, std::max(1, size / 340), pool);
  const std::vector<float> middle = BoxBlur(m.height, size, std::max(1, size / 90), pool);
  const std::vector<float> wide = BoxBlur(m.height, size, std::max(1, size / 28), pool);
  const float slope = 0.5f * static_cast<float>(size) * kSampleDepth;
  pool.ParallelFor(size, [&](int y, int) {
    const size_t up = static_cast<size_t>((y + size - 1) % size) * size;
    const size_t here = static_cast<size_t>(y) * size;
    const size_t down = static_cast<size_t>((y + 1) % size) * size;
    for (int x = 0; x < size; ++x) {
      const size_t i = here + x;
      const float h = m.height[i];
      const float buried = 1.6f * std::max(0.0f, narrow[i] - h) +
                           1.5f * std::max(0.0f, middle[i] - h) +
                           1.1f * std::max(0.0f, wide[i] - h);
      m.arm[3 * i] = Clamp01(1 - buried);
      const float raised = std::max(0.0f, h - middle[i]);
      for (size_t c = 0; c < 3; ++c) {
        // Dirt settles in hollows, edges are rubbed pale.
        float& a = m.albedo[3 * i + c];
        a = Clamp01(a * (1 - 0.35f * Clamp01(buried)) * (1 + 0.9f * std::min(raised, 0.2f)));
      }
      const float dx =
          slope * (m.height[here + (x + 1) % size] - m.height[here + (x + size - 1) % size]);
      const float dy = slope * (m.height[down + x] - m.height[up + x]);
      const float scale = 1 / std::sqrt(dx * dx + dy * dy + 1);
      // Rows run down and Y points up, so the slope along Y changes its sign twice.
      m.normal[3 * i] = 0.5f - 0.5f * dx * scale;
      m.normal[3 * i + 1] = 0.5f + 0.5f * dy * scale;
      m.normal[3 * i + 2] = 0.5f + 0.5f * scale;
    }
  });
  return m;
}

}  // namespace patina
