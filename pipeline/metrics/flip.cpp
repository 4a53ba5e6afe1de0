#include "pipeline/metrics/flip.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "pipeline/color/color.h"

namespace patina::metrics {
namespace {

constexpr double kPixelsPerDegree = 67.0;

// ---- Colour spaces
// -------------------------------------------------------------------------------------------------

// Linear Rec. 709 to XYZ as the ratios of the published implementation (ASTM E308 white of the
// primaries).
constexpr double kToXyz[3][3] = {
    {10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0},
    {2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0},
    {1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0},
};

struct Matrix {
  float m[3][3];
};

// XYZ relative to white, from linear RGB: every row sums to one.
struct Spaces {
  Matrix relative_xyz;
  Matrix from_relative_xyz;

  Spaces() {
    double a[3][3];
    for (int r = 0; r < 3; ++r) {
      const double white = kToXyz[r][0] + kToXyz[r][1] + kToXyz[r][2];
      for (int c = 0; c < 3; ++c) a[r][c] = kToXyz[r][c] / white;
    }
    double inverse[3][3];
    const auto cofactor = [&](int r, int c) {
      const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
      return a[r1][c1] * a[r2][c2] - a[r1][c2] * a[r2][c1];
    };
    const double det =
        a[0][0] * cofactor(0, 0) + a[0][1] * cofactor(0, 1) + a[0][2] * cofactor(0, 2);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) inverse[c][r] = cofactor(r, c) / det;
    }
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        relative_xyz.m[r][c] = static_cast<float>(a[r][c]);
        from_relative_xyz.m[r][c] = static_cast<float>(inverse[r][c]);
      }
    }
  }
};

const Spaces& GetSpaces() {
  static const Spaces spaces;
  return spaces;
}

inline float Dot(const float row[3], float x, float y, float z) {
  return row[0] * x + row[1] * y + row[2] * z;
}

inline float Clamp01(float v) { return std::min(std::max(v, 0.0f), 1.0f); }

// The cube root of t in [0.008, 1.01], within 3e-7 relative: a guess from the
// exponent bits, then Halley's iteration twice. Unlike std::cbrt it can be vectorised, and it is a
// third of the time of the whole metric.
inline float CubeRoot(float t) {
  const float bits = static_cast<float>(std::bit_cast<int32_t>(t));
  float y = std::bit_cast<float>(static_cast<int32_t>(bits * (1.0f / 3.0f)) + 0x2A5137A0);
  for (int i = 0; i < 2; ++i) {
    const float cube = y * y * y;
    y *= (cube + 2.0f * t) / (2.0f * cube + t);
  }
  return y;
}

struct Lab {
  float l, a, b;
};

// CIELAB of linear RGB in [0, 1]^3, with the Hunt adjustment of Eq. 8: chroma counts less where it
// is dark.
inline Lab HuntLab(const Spaces& spaces, float r, float g, float b) {
  constexpr float kDelta = 6.0f / 29.0f;
  constexpr float kKnee = kDelta * kDelta * kDelta;
  float f[3];
  for (int i = 0; i < 3; ++i) {
    const float t = Dot(spaces.relative_xyz.m[i], r, g, b);
    const float root = CubeRoot(std::max(t, kKnee));
    const float line = t * (1.0f / (3.0f * kDelta * kDelta)) + 4.0f / 29.0f;
    f[i] = t > kKnee ? root : line;
  }
  const float l = 116.0f * f[1] - 16.0f;
  const float hunt = 0.01f * l;
  return {l, hunt * 500.0f * (f[0] - f[1]), hunt * 200.0f * (f[1] - f[2])};
}

inline float HyAb(const Lab& p, const Lab& q) {
  const float da = p.a - q.a, db = p.b - q.b;
  return std::abs(p.l - q.l) + std::sqrt(da * da + db * db);
}

// ---- Filters
// -------------------------------------------------------------------------------------------------------

constexpr int kMaxRadius = 10;

// A filter of one dimension and odd length. Symmetric: tap(-k) = tap(k); antisymmetric: tap(-k) =
// -tap(k).
struct Filter {
  int radius = 0;
  float tap[kMaxRadius + 1] = {};  // for offsets 0..radius
};

Filter Trimmed(const double taps[kMaxRadius + 1], int radius, double scale) {
  double sum = 0;
  for (int k = 0; k <= radius; ++k) sum += std::abs(taps[k]);
  Filter filter;
  for (int k = 0; k <= radius; ++k) {
    if (std::abs(taps[k]) > 1e-8 * sum) filter.radius = k;
    filter.tap[k] = static_cast<float>(taps[k] * scale);
  }
  return filter;
}

// One term a sqrt(pi / b) exp(-pi^2 d^2 / b) of the contrast sensitivity functions, Table 1.
struct CsfTerm {
  double a, b;
};
constexpr CsfTerm kCsfAchromatic = {1.0, 0.0047};
constexpr CsfTerm kCsfRedGreen = {1.0, 0.0053};
constexpr CsfTerm kCsfBlueYellow[2] = {{34.1, 0.04}, {13.5, 0.025}};

struct Filters {
  Filter achromatic, red_green, blue_yellow[2];
  float blue_yellow_share[2];
  // On luminance: the Gaussian, its first derivative (edges) and its second (points), Eq. 13-15.
  Filter gauss, edge, point;

  Filters() {
    const double widest = std::max(kCsfBlueYellow[0].b, kCsfBlueYellow[1].b);
    const int radius = static_cast<int>(std::ceil(
        3.0 * std::sqrt(widest / (2.0 * std::numbers::pi * std::numbers::pi)) * kPixelsPerDegree));
    double mass[2];
    double ignored;
    achromatic = Csf(kCsfAchromatic, radius, &ignored);
    red_green = Csf(kCsfRedGreen, radius, &ignored);
    for (int t = 0; t < 2; ++t) {
      double sum;
      blue_yellow[t] = Csf(kCsfBlueYellow[t], radius, &sum);
      mass[t] = kCsfBlueYellow[t].a * std::sqrt(std::numbers::pi / kCsfBlueYellow[t].b) * sum * sum;
    }
    for (int t = 0; t < 2; ++t)
      blue_yellow_share[t] = static_cast<float>(mass[t] / (mass[0] + mass[1]));
    MakeFeatures();
  }

 private:
  // Normalised to sum 1; *sum is the sum before that.
  static Filter Csf(const CsfTerm& term, int radius, double* sum) {
    double taps[kMaxRadius + 1];
    *sum = 0;
    for (int k = 0; k <= radius; ++k) {
      const double d = k / kPixelsPerDegree;
      taps[k] = std::exp(-std::numbers::pi * std::numbers::pi * d * d / term.b);
      *sum += k == 0 ? taps[k] : 2 * taps[k];
    }
    return Trimmed(taps, radius, 1.0 / *sum);
  }

  void MakeFeatures() {
    constexpr double kFeatureWidthDegrees = 0.082;
    const double sigma = 0.5 * kFeatureWidthDegrees * kPixelsPerDegree;
    const int radius = static_cast<int>(std::ceil(3.0 * sigma));
    double g[kMaxRadius + 1], first[kMaxRadius + 1], second[kMaxRadius + 1];
    double g_sum = 0, first_positive = 0, second_positive = 0, second_negative = 0;
    for (int k = 0; k <= radius; ++k) {
      const double weight = k == 0 ? 1 : 2;
      g[k] = std::exp(-k * k / (2.0 * sigma * sigma));
      g_sum += weight * g[k];
      first[k] = k * g[k];
      first_positive += first[k];
      second[k] = (k * k / (sigma * sigma) - 1.0) * g[k];
      (second[k] > 0 ? second_positive : second_negative) += weight * std::abs(second[k]);
    }
    // Positive and negative weights sum to 1 and to -1, so that a feature is at most one in size.
    for (int k = 0; k <= radius; ++k)
      second[k] /= second[k] > 0 ? second_positive : second_negative;
    gauss = Trimmed(g, radius, 1.0 / g_sum);
    edge = Trimmed(first, radius, 1.0 / first_positive);
    point = Trimmed(second, radius, 1.0);
  }
};

const Filters& GetFilters() {
  static const Filters filters;
  return filters;
}

// out[x] = sum over k of tap(k) in[x + k * step]. kSign +1: symmetric, -1: antisymmetric.
template <int kSign, int kRadius>
void ConvolveFixed(float* __restrict out, const float* in, ptrdiff_t step, int count,
                   const Filter& filter) {
  float tap[kRadius + 1];
  for (int k = 0; k <= kRadius; ++k) tap[k] = filter.tap[k];
  for (int x = 0; x < count; ++x) {
    float sum = kSign > 0 ? tap[0] * in[x] : 0.0f;
#pragma GCC unroll 16
    for (int k = 1; k <= kRadius; ++k) {
      sum += tap[k] * (in[x + k * step] + static_cast<float>(kSign) * in[x - k * step]);
    }
    out[x] = sum;
  }
}

// Radii of 67 pixels per degree: colour filters 6 or 10, feature filters 9.
template <int kSign>
void Convolve(float* out, const float* in, ptrdiff_t step, int count, const Filter& filter) {
  switch (filter.radius) {
    case 6:
      return ConvolveFixed<kSign, 6>(out, in, step, count, filter);
    case 9:
      return ConvolveFixed<kSign, 9>(out, in, step, count, filter);
    default:
      return ConvolveFixed<kSign, kMaxRadius>(out, in, step, count, filter);
  }
}

// ---- One tile
// ------------------------------------------------------------------------------------------------------

constexpr int kTile = 128;
constexpr int kPadded = kTile + 2 * kMaxRadius;

// What the comparison needs to know about an image, on one tile: rows of kTile values.
struct TileContent {
  float l[kTile * kTile], a[kTile * kTile],
      b[kTile * kTile];                             // filtered colour: Hunt-adjusted CIELAB
  float edge[kTile * kTile], point[kTile * kTile];  // feature strengths
};

// Buffers of one worker.
struct TileScratch {
  float linear[3][kPadded];              // one row of red, green and blue
  float opponent[3][kPadded * kPadded];  // Y, Cx, Cz of the tile and its surroundings
  float across[7][kPadded * kTile];      // filtered along x: Y, Cx, Cz twice; Gaussian, edge, point
  float row[7][kTile];                   // and along y: Y, Cx, Cz; edge x, edge y, point x, point y
  TileContent reference, test;
};

struct TileArea {
  int x0, y0, width, height;
};

// Y, Cx and Cz (Eq. 3: CIELAB without its cube root), rows and columns beyond the border repeated.
void LoadOpponent(const RgbView& image, const TileArea& tile, TileScratch& scratch) {
  const Spaces& spaces = GetSpaces();
  const int columns = tile.width + 2 * kMaxRadius;
  for (int row = 0; row < tile.height + 2 * kMaxRadius; ++row) {
    const int y = std::clamp(tile.y0 + row - kMaxRadius, 0, image[0].height - 1);
    for (int c = 0; c < 3; ++c) {
      const float* in = image[c].Row(y);
      float* out = scratch.linear[c];
      for (int column = 0; column < columns; ++column) {
        out[column] = Clamp01(in[std::clamp(tile.x0 + column - kMaxRadius, 0, image[0].width - 1)]);
      }
      SrgbToLinearRow(out, static_cast<size_t>(columns), out);
    }
    const float *r = scratch.linear[0], *g = scratch.linear[1], *b = scratch.linear[2];
    for (int column = 0; column < columns; ++column) {
      const float xr = Dot(spaces.relative_xyz.m[0], r[column], g[column], b[column]);
      const float yr = Dot(spaces.relative_xyz.m[1], r[column], g[column], b[column]);
      const float zr = Dot(spaces.relative_xyz.m[2], r[column], g[column], b[column]);
      const int at = row * kPadded + column;
      scratch.opponent[0][at] = 116.0f * yr - 16.0f;
      scratch.opponent[1][at] = 500.0f * (xr - yr);
      scratch.opponent[2][at] = 200.0f * (yr - zr);
    }
  }
}

void FilterAcross(const TileArea& tile, TileScratch& scratch) {
  const Filters& filters = GetFilters();
  for (int row = 0; row < tile.height + 2 * kMaxRadius; ++row) {
    const int in = row * kPadded + kMaxRadius, out = row * kTile;
    const auto convolve = [&](int to, int from, const Filter& filter) {
      Convolve<1>(scratch.across[to] + out, scratch.opponent[from] + in, 1, tile.width, filter);
    };
    convolve(0, 0, filters.achromatic);
    convolve(1, 1, filters.red_green);
    convolve(2, 2, filters.blue_yellow[0]);
    convolve(3, 2, filters.blue_yellow[1]);
    convolve(4, 0, filters.gauss);
    Convolve<-1>(scratch.across[5] + out, scratch.opponent[0] + in, 1, tile.width, filters.edge);
    convolve(6, 0, filters.point);
  }
}

void StoreColor(const float* luma, const float* cx, const float* cz, int count, int out,
                TileContent& content) {
  const Spaces& spaces = GetSpaces();
  for (int x = 0; x < count; ++x) {
    const float yr = (luma[x] + 16.0f) * (1.0f / 116.0f);
    const float xr = yr + cx[x] * (1.0f / 500.0f);
    const float zr = yr - cz[x] * (1.0f / 200.0f);
    const float r = Clamp01(Dot(spaces.from_relative_xyz.m[0], xr, yr, zr));
    const float g = Clamp01(Dot(spaces.from_relative_xyz.m[1], xr, yr, zr));
    const float b = Clamp01(Dot(spaces.from_relative_xyz.m[2], xr, yr, zr));
    const Lab lab = HuntLab(spaces, r, g, b);
    content.l[out + x] = lab.l;
    content.a[out + x] = lab.a;
    content.b[out + x] = lab.b;
  }
}

void FilterDown(const TileArea& tile, TileScratch& scratch, TileContent& content) {
  const Filters& filters = GetFilters();
  // Features are measured on luminance in [0, 1]. The offset -16 drops out: both filters sum to
  // zero.
  constexpr float kToUnit = 1.0f / 116.0f;
  for (int row = 0; row < tile.height; ++row) {
    const int in = (row + kMaxRadius) * kTile, out = row * kTile;
    const auto convolve = [&](int to, int from, const Filter& filter) {
      Convolve<1>(scratch.row[to], scratch.across[from] + in, kTile, tile.width, filter);
    };
    convolve(0, 0, filters.achromatic);
    convolve(1, 1, filters.red_green);
    convolve(2, 2, filters.blue_yellow[0]);
    convolve(3, 3, filters.blue_yellow[1]);
    for (int x = 0; x < tile.width; ++x) {
      scratch.row[2][x] = filters.blue_yellow_share[0] * scratch.row[2][x] +
                          filters.blue_yellow_share[1] * scratch.row[3][x];
    }
    StoreColor(scratch.row[0], scratch.row[1], scratch.row[2], tile.width, out, content);
    convolve(3, 5, filters.gauss);
    Convolve<-1>(scratch.row[4], scratch.across[4] + in, kTile, tile.width, filters.edge);
    convolve(5, 6, filters.gauss);
    convolve(6, 4, filters.point);
    for (int x = 0; x < tile.width; ++x) {
      const float ex = kToUnit * scratch.row[3][x], ey = kToUnit * scratch.row[4][x];
      const float px = kToUnit * scratch.row[5][x], py = kToUnit * scratch.row[6][x];
      content.edge[out + x] = std::sqrt(ex * ex + ey * ey);
      content.point[out + x] = std::sqrt(px * px + py * py);
    }
  }
}

// Eq. 9-12: the distance of two colours on a scale where the largest difference of two colours
// is 1.
class ColorError {
 public:
  ColorError() {
    const Spaces& spaces = GetSpaces();
    largest_ = std::pow(HyAb(HuntLab(spaces, 0, 1, 0), HuntLab(spaces, 0, 0, 1)), kExponent);
  }
  float operator()(const Lab& p, const Lab& q) const {
    constexpr float kKnee = 0.4f, kKneeError = 0.95f;  // p_c and p_t
    const float error = std::pow(HyAb(p, q), kExponent);
    const float knee = kKnee * largest_;
    return error < knee ? kKneeError / knee * error
                        : kKneeError + (error - knee) / (largest_ - knee) * (1.0f - kKneeError);
  }

 private:
  static constexpr float kExponent = 0.7f;  // q_c
  float largest_;
};

double CompareTile(const TileArea& tile, const TileScratch& scratch, int map_width,
                   float* error_map) {
  static const ColorError color_error;
  const TileContent &p = scratch.reference, &q = scratch.test;
  double sum = 0;
  for (int row = 0; row < tile.height; ++row) {
    double row_sum = 0;
    for (int x = 0; x < tile.width; ++x) {
      const int at = row * kTile + x;
      const float color = color_error({p.l[at], p.a[at], p.b[at]}, {q.l[at], q.a[at], q.b[at]});
      const float feature =
          std::max(std::abs(p.edge[at] - q.edge[at]), std::abs(p.point[at] - q.point[at]));
      // Eq. 16, q_f = 0.5; a pair of directions makes a feature at most sqrt(2).
      const float feature_error =
          std::sqrt(std::min(1.0f, feature * std::numbers::sqrt2_v<float> * 0.5f));
      const float error = std::min(1.0f, std::pow(color, 1.0f - feature_error));
      row_sum += static_cast<double>(error);
      if (error_map != nullptr)
        error_map[static_cast<size_t>(tile.y0 + row) * map_width + tile.x0 + x] = error;
    }
    sum += row_sum;
  }
  return sum;
}

}  // namespace

double MeanFlip(const RgbView& reference, const RgbView& test, ThreadPool& pool, float* error_map) {
  const int width = reference[0].width, height = reference[0].height;
  if (width <= 0 || height <= 0) return 0;
  const int columns = (width + kTile - 1) / kTile, rows = (height + kTile - 1) / kTile;
  std::vector<TileScratch> scratch(static_cast<size_t>(pool.threads()));
  std::vector<double> sums(static_cast<size_t>(columns) * rows);
  pool.ParallelFor(columns * rows, [&](int index, int worker) {
    TileScratch& mine = scratch[worker];
    TileArea tile = {index % columns * kTile, index / columns * kTile, 0, 0};
    tile.width = std::min(kTile, width - tile.x0);
    tile.height = std::min(kTile, height - tile.y0);
    for (const bool is_test : {false, true}) {
      LoadOpponent(is_test ? test : reference, tile, mine);
      FilterAcross(tile, mine);
      FilterDown(tile, mine, is_test ? mine.test : mine.reference);
    }
    sums[index] = CompareTile(tile, mine, width, error_map);
  });
  double total = 0;
  for (const double sum : sums) total += sum;
  return total / (static_cast<double>(width) * height);
}

}  // namespace patina::metrics
