// The corner lattice against healpix_cxx (GPL: linked by this test only, if it is installed) and
// against its own properties.
#include "formats/healpix_corners.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "tests/formats/test_support.h"

#ifdef PATINA_HAVE_HEALPIX_CXX
#include <healpix_cxx/healpix_base.h>
#endif

namespace patina::healpix {
namespace {

using test::Random;

constexpr int kNsides[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 32, 64};

struct Vector {
  double d[3];
};

Vector RandomDirection(Random& random) {
  const double z = random.Unit();
  const double phi = 2 * M_PI * random.Unit();
  const double sine = std::sqrt(1 - z * z);
  return {{sine * std::cos(phi), sine * std::sin(phi), z}};
}

// The direction of a place in a pixel: the inverse of LocatePixel, from the equations of the two
// projections.
Vector DirectionOf(int n, int ring, int j, double u, double v) {
  double z, quarter_turns, sine;
  if (ring < n || (ring == n && u + v < 1)) {
    const int jp = j % ring;
    const double a = jp + u;
    const double b = ring - 1 - jp + v;
    const double radius = a + b;
    z = 1 - radius * radius / (3.0 * n * n);
    sine = radius / n * std::sqrt((1 + z) / 3);
    quarter_turns = j / ring + (radius > 0 ? a / radius : 0);
  } else {
    const int difference = ring - 2 * n;  // jp - jm
    const int sum = 2 * j + n - 1 + ((n + 1 + difference) & 1);
    const double a = (sum + difference) / 2.0 + u;
    const double b = (sum - difference) / 2.0 + 1 - v;
    z = (b - a) / (1.5 * n);
    sine = std::sqrt(1 - z * z);
    quarter_turns = (a + b - n) / (2.0 * n);
  }
  const double phi = quarter_turns * M_PI / 2;
  return {{sine * std::cos(phi), sine * std::sin(phi), z}};
}

double Interpolate(int n, const Vector& direction, const std::vector<double>& values) {
  const Lookup<double> lookup = LookUp(n, direction.d);
  double sum = 0;
  for (int c = 0; c < 4; ++c) sum += lookup.weight[c] * values[lookup.index[c]];
  return sum;
}

int PixelsInRing(int n, int ring) { return 4 * std::min(ring, n); }
// Of a pixel in HEALPix' ring order.
int PixelIndex(int n, int ring, int j) {
  return (ring <= n ? 2 * ring * (ring - 1) : 2 * n * (n - 1) + 4 * n * (ring - n)) + j;
}

TEST(HealpixCorners, CountAsThePaper) {
  for (const int n : kNsides) EXPECT_EQ(CornerCount(n), 6 * n * n + 6 * n + 1);
  EXPECT_EQ(CornerCount(64), 24961);
  EXPECT_EQ(CornerCount(kMaxNside), 6 * kMaxNside * kMaxNside + 6 * kMaxNside + 1);
}

TEST(HealpixCorners, IndexAndCornerAreInverse) {
  for (const int n : {1, 2, 3, 4, 5, 6, 7, 8, 9, 32, 64, kMaxNside}) {
    int index = 0;
    for (int ring = 0; ring < RingCount(n); ++ring) {
      ASSERT_EQ(RingStart(n, ring), index);
      for (int j = 0; j < CornersInRing(n, ring); ++j, ++index) {
        ASSERT_EQ(CornerIndex(n, {ring, j}), index);
        const Corner corner = CornerOf(n, index);
        ASSERT_EQ(corner.ring, ring) << n << " " << index;
        ASSERT_EQ(corner.j, j);
      }
    }
    ASSERT_EQ(index, CornerCount(n));
  }
}

TEST(HealpixCorners, DirectionsAreUnitVectorsOnTheirRings) {
  for (const int n : kNsides) {
    for (int index = 0; index < CornerCount(n); ++index) {
      double d[3];
      float f[3];
      CornerDirection(n, CornerOf(n, index), d);
      CornerDirection(n, CornerOf(n, index), f);
      ASSERT_NEAR(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1, 1e-14);
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(d[c], static_cast<double>(f[c]), 4e-7);
    }
  }
}

TEST(HealpixCorners, WeightsSumToOneAndIndicesStayInside) {
  const double inf = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Random random(1);
  std::vector<Vector> directions;
  for (int i = 0; i < 20000; ++i) directions.push_back(RandomDirection(random));
  for (const double x : {0.0, -0.0, 1e-300, -1e-30, 1e-8, 1.0, -1.0, 1.0000001, inf, -inf, nan}) {
    for (const double y : {0.0, -0.0, -1e-300, 1e-30, 1.0, -1.0, inf, nan}) {
      for (const double z : {0.0, -0.0, -1e-9, -1.0, 1.0, 1.0000001, 2.0 / 3.0, 0.66666669,
                             0.6666666, 1e-300, inf, -inf, nan}) {
        directions.push_back({{x, y, z}});
      }
    }
  }
  for (const int n : {1, 2, 3, 7, 64, kMaxNside}) {
    for (const Vector& direction : directions) {
      const float single[3] = {static_cast<float>(direction.d[0]),
                               static_cast<float>(direction.d[1]),
                               static_cast<float>(direction.d[2])};
      const auto a = LookUp(n, direction.d);
      const auto b = LookUp(n, single);
      double sum_a = 0;
      double sum_b = 0;
      for (int c = 0; c < 4; ++c) {
        ASSERT_TRUE(a.index[c] >= 0 && a.index[c] < CornerCount(n));
        ASSERT_TRUE(b.index[c] >= 0 && b.index[c] < CornerCount(n));
        ASSERT_TRUE(a.weight[c] >= 0 && b.weight[c] >= 0);
        sum_a += a.weight[c];
        sum_b += static_cast<double>(b.weight[c]);
      }
      ASSERT_NEAR(sum_a, 1, 1e-14);
      ASSERT_NEAR(sum_b, 1, 5e-7);  // four products and three sums of singles
    }
  }
}

TEST(HealpixCorners, BilinearIsExactAtTheCorners) {
  for (const int n : kNsides) {
    for (int index = 0; index < RingStart(n, 2 * n + 1); ++index) {
      double d[3];
      float f[3];
      CornerDirection(n, CornerOf(n, index), d);
      CornerDirection(n, CornerOf(n, index), f);
      const auto exact = LookUp(n, d);
      const auto single = LookUp(n, f);
      double there = 0;
      double there_single = 0;
      for (int c = 0; c < 4; ++c) {
        if (exact.index[c] == index) there += exact.weight[c];
        if (single.index[c] == index) there_single += static_cast<double>(single.weight[c]);
      }
      ASSERT_NEAR(there, 1, 1e-13 * n) << n << " " << index;
      // A coordinate of size 2 N holds the place in the pixel to 2 N half ulps, and comes from four
      // rounded operations.
      ASSERT_NEAR(there_single, 1, 2e-6 * n) << n << " " << index;
    }
  }
}

TEST(HealpixCorners, SinglePrecisionGivesTheSameFeatures) {
  Random random(2);
  for (const int n : {1, 3, 32, 64, 1000}) {
    std::vector<double> values(CornerCount(n));
    for (double& value : values) value = random.Unit();
    for (int i = 0; i < 20000; ++i) {
      const Vector direction = RandomDirection(random);
      const float single[3] = {static_cast<float>(direction.d[0]),
                               static_cast<float>(direction.d[1]),
                               static_cast<float>(direction.d[2])};
      const auto lookup = LookUp(n, single);
      double sum = 0;
      for (int c = 0; c < 4; ++c)
        sum += static_cast<double>(lookup.weight[c]) * values[lookup.index[c]];
      ASSERT_NEAR(sum, Interpolate(n, direction, values), 2e-6 * n) << n;
    }
  }
}

TEST(HealpixCorners, BilinearIsContinuousAcrossEveryKindOfEdge) {
  Random random(3);
  for (const int n : kNsides) {
    std::vector<double> values(CornerCount(n));
    for (double& value : values) value = random.Unit();
    const double step = 1e-9;
    const double bound = 20 * n * step;  // values of size 1 over pixels of size 1 / n
    int pairs = 0;
    const auto check = [&](const Vector& center) {
      Vector near[2];
      for (Vector& point : near) {
        for (int c = 0; c < 3; ++c) point.d[c] = center.d[c] + step * (random.Unit() - 0.5);
        point.d[2] = std::max(point.d[2], 0.0);
      }
      const double a = Interpolate(n, near[0], values);
      const double b = Interpolate(n, near[1], values);
      ASSERT_NEAR(a, b, bound) << n << ": " << center.d[0] << " " << center.d[1] << " "
                               << center.d[2];
      ++pairs;
    };
    // All edges of all pixels (of some in the large lattices), the equator's to the horizon.
    for (int ring = 1; ring <= 2 * n; ++ring) {
      for (int j = 0; j<PixelsInRing(n, ring); j += n> 9 ? 5 : 1) {
        for (int edge = 0; edge < 4; ++edge) {
          for (int i = 0; i < 4; ++i) {
            const double along = i == 0 ? 0 : random.Unit();
            const double across = edge % 2;
            const Vector center = edge < 2 ? DirectionOf(n, ring, j, along, across)
                                           : DirectionOf(n, ring, j, across, along);
            if (center.d[2] >= 0) check(center);
          }
        }
      }
    }
    // The pole, the end of the cap, the azimuths of the base pixels' borders.
    for (int i = 0; i < 2000; ++i) {
      check({{0, 0, 1}});
      const double phi = 2 * M_PI * random.Unit();
      const double sine = std::sqrt(5.0) / 3;
      check({{sine * std::cos(phi), sine * std::sin(phi), 2.0 / 3.0}});
      const double z = random.Unit();
      const double s = std::sqrt(1 - z * z);
      const double quarter = i % 4 * M_PI / 2;
      check({{s * std::cos(quarter), s * std::sin(quarter), z}});
      const double eighth = quarter + M_PI / 4;
      check({{s * std::cos(eighth), s * std::sin(eighth), z}});
    }
    ASSERT_GT(pairs, 8000);
  }
}

TEST(HealpixCorners, LocatesWhatTheInverseProjectionPlaces) {
  Random random(4);
  for (const int n : kNsides) {
    for (int ring = 1; ring <= 2 * n; ++ring) {
      for (int j = 0; j<PixelsInRing(n, ring); j += n> 9 ? 3 : 1) {
        const double u = 0.001 + 0.998 * random.Unit();
        const double v = 0.001 + 0.998 * random.Unit();
        const Vector direction = DirectionOf(n, ring, j, u, v);
        if (direction.d[2] < 0) continue;
        const auto point = LocatePixel(n, direction.d);
        ASSERT_EQ(point.ring, ring) << n << " " << u << " " << v;
        ASSERT_EQ(point.j, j);
        ASSERT_NEAR(point.u, u, 1e-9);
        ASSERT_NEAR(point.v, v, 1e-9);
      }
    }
  }
}

TEST(HealpixCorners, PixelsHaveEqualAreas) {
  for (const int n : {1, 2, 3, 4, 5}) {
    std::vector<int> hits(PixelIndex(n, 2 * n, 4 * n), 0);
    const int rows = 600;
    const int columns = 2400;
    for (int row = 0; row < rows; ++row) {
      const double z = (row + 0.5) / rows;
      const double sine = std::sqrt(1 - z * z);
      for (int column = 0; column < columns; ++column) {
        const double phi = 2 * M_PI * (column + 0.37) / columns;
        const double d[3] = {sine * std::cos(phi), sine * std::sin(phi), z};
        const auto point = LocatePixel(n, d);
        ++hits[PixelIndex(n, point.ring, point.j)];
      }
    }
    const double share = static_cast<double>(rows) * columns / (6.0 * n * n);
    for (int ring = 1; ring <= 2 * n; ++ring) {
      for (int j = 0; j < PixelsInRing(n, ring); ++j) {
        // The equator's pixels lie half below it. Samples along the border decide the bound.
        EXPECT_NEAR(hits[PixelIndex(n, ring, j)], ring == 2 * n ? share / 2 : share, 0.02 * share)
            << n << " " << ring << " " << j;
      }
    }
  }
}

TEST(HealpixCorners, OtherWeightsAreThePapers) {
  Random random(5);
  for (const int n : {1, 4, 7, 64}) {
    for (int i = 0; i < 5000; ++i) {
      const Vector direction = RandomDirection(random);
      const auto uniform = LookUp(n, direction.d, Interpolation::kUniform);
      const auto inverse = LookUp(n, direction.d, Interpolation::kInverseDistance);
      double expected[4];
      double sum = 0;
      for (int c = 0; c < 4; ++c) {
        EXPECT_EQ(uniform.weight[c], 0.25);
        double corner[3];
        CornerDirection(n, CornerOf(n, inverse.index[c]), corner);
        const double cosine =
            corner[0] * direction.d[0] + corner[1] * direction.d[1] + corner[2] * direction.d[2];
        expected[c] = 1 / std::acos(std::min(1.0, cosine));
        sum += expected[c];
      }
      // acos loses half of the digits near 1.
      for (int c = 0; c < 4; ++c) ASSERT_NEAR(inverse.weight[c], expected[c] / sum, 1e-5);
    }
    double corner[3];
    CornerDirection(n, CornerOf(n, CornerCount(n) / 3), corner);
    const auto at = LookUp(n, corner, Interpolation::kInverseDistance);
    double there = 0;
    for (int c = 0; c < 4; ++c) there += at.index[c] == CornerCount(n) / 3 ? at.weight[c] : 0;
    EXPECT_NEAR(there, 1, 1e-4);
  }
}

TEST(HealpixCorners, ParentCornersLieAtTheSamePlacesInTheChildLattice) {
  for (const int n : {1, 2, 3, 4, 5, 8, 9, 16, 32}) {
    std::vector<bool> taken(CornerCount(2 * n), false);
    for (int index = 0; index < RingStart(n, 2 * n + 1); ++index) {
      const Corner corner = CornerOf(n, index);
      const Corner child = ToChild(n, corner);
      ASSERT_LT(child.j, CornersInRing(2 * n, child.ring));
      double a[3], b[3];
      CornerDirection(n, corner, a);
      CornerDirection(2 * n, child, b);
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(a[c], b[c], 1e-14);
      ASSERT_EQ(ParentsOf(2 * n, child).count, 0);
      taken[CornerIndex(2 * n, child)] = true;
    }
    for (int index = 0; index < CornerCount(2 * n); ++index)
      ASSERT_EQ(taken[index], ParentsOf(2 * n, CornerOf(2 * n, index)).count == 0);
  }
}

// What a lookup in the parent lattice at the place of a child corner gives.
TEST(HealpixCorners, ParentsAreTheCornersAroundWithTheirBilinearWeights) {
  for (const int n : {1, 2, 3, 4, 5, 8, 9, 16, 32}) {
    const int m = 2 * n;
    for (int index = 0; index < CornerCount(m); ++index) {
      const Corner corner = CornerOf(m, index);
      const Parents parents = ParentsOf(m, corner);
      if (parents.count == 0) continue;
      std::map<int, double> found;
      for (int p = 0; p < parents.count; ++p) {
        ASSERT_LE(parents.corner[p].ring, 2 * m);
        ASSERT_EQ(ParentsOf(m, parents.corner[p]).count, 0);
        found[CornerIndex(m, parents.corner[p])] += 1.0 / parents.count;
      }
      // The extra ring mirrors the one above the equator.
      const Corner above = {corner.ring > 2 * m ? 4 * m - corner.ring : corner.ring, corner.j};
      double d[3];
      CornerDirection(m, above, d);
      const auto lookup = LookUp(n, d);
      std::map<int, double> expected;
      for (int c = 0; c < 4; ++c) {
        if (lookup.weight[c] < 1e-9) continue;
        Corner child = ToChild(n, CornerOf(n, lookup.index[c]));
        if (child.ring > 2 * m) child.ring = 4 * m - child.ring;
        expected[CornerIndex(m, child)] += lookup.weight[c];
      }
      ASSERT_EQ(found.size(), expected.size()) << n << " ring " << corner.ring << " " << corner.j;
      for (const auto& [at, weight] : expected)
        ASSERT_NEAR(found[at], weight, 1e-9) << n << " ring " << corner.ring << " " << corner.j;
    }
  }
}

TEST(HealpixCorners, FoldKeepsAnglesAndForgetsRotation) {
  Random random(6);
  for (int i = 0; i < 20000; ++i) {
    const Vector a = RandomDirection(random);
    const Vector b = RandomDirection(random);
    double wi[3], wo[3];
    std::copy_n(a.d, 3, wi);
    std::copy_n(b.d, 3, wo);
    FoldIsotropic(wi, wo);
    EXPECT_EQ(wi[1], 0);
    EXPECT_GE(wo[1], 0);
    EXPECT_EQ(wi[2], a.d[2]);
    EXPECT_EQ(wo[2], b.d[2]);
    double before = 0;
    double after = 0;
    double length = 0;
    for (int c = 0; c < 3; ++c) {
      before += a.d[c] * b.d[c];
      after += wi[c] * wo[c];
      length += wo[c] * wo[c];
    }
    EXPECT_NEAR(before, after, 1e-14);
    EXPECT_NEAR(length, 1, 1e-14);
    // Turned by some angle and mirrored.
    const double turn = 7 * random.Unit();
    double ti[3], to[3];
    for (const auto& [from, to_fold] : {std::pair(a.d, ti), std::pair(b.d, to)}) {
      to_fold[0] = std::cos(turn) * from[0] - std::sin(turn) * from[1];
      to_fold[1] = -(std::sin(turn) * from[0] + std::cos(turn) * from[1]);
      to_fold[2] = from[2];
    }
    FoldIsotropic(ti, to);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(ti[c], wi[c], 1e-14);
      EXPECT_NEAR(to[c], wo[c], 1e-12);
    }
  }
  float wi[3] = {0, 0, 1};
  float wo[3] = {0.0f, -0.6f, 0.8f};
  FoldIsotropic(wi, wo);
  EXPECT_EQ(wo[0], 0.6f);
  EXPECT_EQ(wo[1], 0.0f);
}

TEST(HealpixCorners, AgreeWithHealpixCxx) {
#ifndef PATINA_HAVE_HEALPIX_CXX
  GTEST_SKIP() << "healpix_cxx was not found (Debian: libhealpix-cxx-dev)";
#else
  Random random(7);
  for (const int n : {1, 2, 3, 4, 5, 6, 7, 8, 9, 32, 64, 100, 1000, kMaxNside}) {
    const T_Healpix_Base<int> reference(n, RING, SET_NSIDE);
    int compared = 0;
    for (int i = 0; i < 20000; ++i) {
      const Vector direction = RandomDirection(random);
      const auto point = LocatePixel(n, direction.d);
      const double edge = std::min({point.u, point.v, 1 - point.u, 1 - point.v});
      if (edge < 1e-9) continue;  // either pixel is right
      ++compared;
      const int pixel = PixelIndex(n, point.ring, point.j);
      ASSERT_EQ(pixel, reference.vec2pix(vec3(direction.d[0], direction.d[1], direction.d[2])));
      std::vector<vec3> corners;
      reference.boundaries(pixel, 1, corners);
      ASSERT_EQ(corners.size(), 4u);
      int index[4];
      PixelCorners(n, point.ring, point.j, index);
      // Theirs run north, west, south, east.
      for (int c = 0; c < 4; ++c) {
        double mine[3];
        CornerDirection(n, CornerOf(n, index[c]), mine);
        const vec3& theirs = corners[(4 - c) % 4];
        ASSERT_NEAR(mine[0], theirs.x, 1e-12) << n << " corner " << c;
        ASSERT_NEAR(mine[1], theirs.y, 1e-12);
        ASSERT_NEAR(mine[2], theirs.z, 1e-12);
      }
    }
    EXPECT_GT(compared, 19000);
  }
#endif
}

}  // namespace
}  // namespace patina::healpix
