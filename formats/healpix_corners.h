// The corners of a HEALPix hemisphere as an interpolation lattice: direction -> four corners and
// weights.
//
// Based on: Gorski et al. 2005 (the pixels), NeuBRDF (values at the corners of pixels, Eq. 1 and
// 2). N = Nside is any number from 1 to kMaxNside. Corners lie on rings k = 0 (the pole, z = 1), N
// (end of the cap, z = 2/3), 2N (equator) and 2N + 1, the extra ring below the equator that the
// equator's pixels need: 6 N^2 + 6 N + 1 corners. Pixels have rings i = 1..2N; j counts eastward
// from azimuth 0 in both.
//
// Directions are unit vectors, z up; z below 0 is taken for 0, and no input, not even NaN, gives
// an index outside the lattice. All functions are pure and allocate nothing. T is float or double.
// Compile with -ffp-contract=off where the same bits are wanted everywhere.
#pragma once

#include <cmath>
#include <cstdint>

namespace patina::healpix {

inline constexpr int kMaxNside = 1024;

// How the four corners of a pixel are mixed. The numbers are written to files.
enum class Interpolation : uint8_t {
  kBilinear = 0,         // continuous, exact at the corners
  kInverseDistance = 1,  // 1 / great-circle distance: the paper's training; jumps across edges
  kUniform = 2           // 1/4 each: the paper's evaluation; constant in each pixel
};

struct Corner {
  int ring = 0;
  int j = 0;
};

// A place in a pixel. (u, v) in [0, 1]^2 are exact bilinear coordinates: north corner (0, 0), east
// (1, 0), south (1, 1), west (0, 1).
template <class T>
struct PixelPoint {
  int ring = 1;
  int j = 0;
  T u = 0;
  T v = 0;
};

// Corner indices and weights of a direction, in the order north, east, south, west.
template <class T>
struct Lookup {
  int index[4] = {};
  T weight[4] = {};
};

// Rings of corners in the hemisphere: 0 .. 2N + 1.
constexpr int RingCount(int nside) { return 2 * nside + 2; }
constexpr int CornersInRing(int nside, int ring) {
  return ring == 0 ? 1 : ring < nside ? 4 * ring : 4 * nside;
}
// The index of the first corner of a ring.
constexpr int RingStart(int nside, int ring) {
  if (ring == 0) return 0;
  return ring <= nside ? 1 + 2 * ring * (ring - 1)
                       : 1 + 2 * nside * (nside - 1) + 4 * nside * (ring - nside);
}
// Corners of a hemisphere with the extra ring.
constexpr int CornerCount(int nside) { return RingStart(nside, 2 * nside + 2); }

constexpr int CornerIndex(int nside, Corner corner) {
  return RingStart(nside, corner.ring) + corner.j;
}

// The inverse of CornerIndex; `index` is below CornerCount.
inline Corner CornerOf(int nside, int index) {
  if (index == 0) return {0, 0};
  const int cap = RingStart(nside, nside);
  if (index >= cap) {
    const int ring = nside + (index - cap) / (4 * nside);
    return {ring, index - RingStart(nside, ring)};
  }
  int ring = static_cast<int>((1.0 + std::sqrt(2.0 * index - 1.0)) * 0.5);
  while (RingStart(nside, ring) > index) --ring;
  while (RingStart(nside, ring + 1) <= index) ++ring;
  return {ring, index - RingStart(nside, ring)};
}

// A ring of the belt is turned by half a step against the ring above it.
constexpr int RingShift(int nside, int ring) { return ring > nside ? (ring - nside) & 1 : 0; }

template <class T>
void CornerDirection(int nside, Corner corner, T xyz[3]) {
  const int k = corner.ring;
  T z, sine;
  int numerator, denominator;  // azimuth in quarter turns
  if (k <= nside) {
    const T part = static_cast<T>(k) / static_cast<T>(nside);
    z = 1 - part * part / 3;
    sine = part * std::sqrt((1 + z) / 3);
    numerator = corner.j;
    denominator = k == 0 ? 1 : k;
  } else {
    z = static_cast<T>(4 * nside - 2 * k) / static_cast<T>(3 * nside);
    sine = std::sqrt((1 - z) * (1 + z));
    numerator = 2 * corner.j + RingShift(nside, k);
    denominator = 2 * nside;
  }
  // The quadrant by exchange of coordinates, so that the four quarters have the same digits.
  const int quadrant = numerator / denominator;
  const T angle = static_cast<T>(1.5707963267948966) * static_cast<T>(numerator % denominator) /
                  static_cast<T>(denominator);
  const T c = sine * std::cos(angle);
  const T s = sine * std::sin(angle);
  xyz[0] = quadrant == 0 ? c : quadrant == 1 ? -s : quadrant == 2 ? -c : s;
  xyz[1] = quadrant == 0 ? s : quadrant == 1 ? c : quadrant == 2 ? -s : -c;
  xyz[2] = z;
}

// The azimuth of (x, y) as quadrant 0..3 and quarter turns in [0, 1] within it; (0, 0) gives 0.
template <class T>
int AzimuthQuadrant(T x, T y, T* quarter_turns) {
  int quadrant = 3;
  T forward = -y;
  T side = x;
  if (x > 0 && y >= 0) {
    quadrant = 0, forward = x, side = y;
  } else if (y > 0 && x <= 0) {
    quadrant = 1, forward = y, side = -x;
  } else if (x < 0 && y <= 0) {
    quadrant = 2, forward = -x, side = -y;
  } else if (x == 0 && y == 0) {
    quadrant = 0, forward = 1, side = 0;
  }
  const T turns = std::atan2(side, forward) * static_cast<T>(0.63661977236758134);
  *quarter_turns = turns >= 0 ? (turns < 1 ? turns : T(1)) : T(0);
  return quadrant;
}

// The pixel of a direction.
template <class T>
PixelPoint<T> LocatePixel(int nside, const T direction[3]) {
  const T z = direction[2] > 0 ? direction[2] : T(0);
  const T n = static_cast<T>(nside);
  T t;
  const int quadrant = AzimuthQuadrant(direction[0], direction[1], &t);
  PixelPoint<T> point;
  if (z > static_cast<T>(2.0 / 3.0)) {
    const T sine = std::sqrt(direction[0] * direction[0] + direction[1] * direction[1]);
    T radius = n * sine / std::sqrt((1 + z) / 3);  // sqrt(3 (1 - z)) would lose the pole
    radius = radius < n ? radius : n;
    const T a = t * radius;
    const T b = (1 - t) * radius;
    int jp = static_cast<int>(a);
    int jm = static_cast<int>(b);
    // Rounding can put a point on the end of the cap beyond it.
    if (jp + jm >= nside) {
      if (jp > 0) {
        --jp;
      } else {
        --jm;
      }
    }
    point.ring = jp + jm + 1;
    point.j = quadrant * point.ring + jp;
    point.u = a - static_cast<T>(jp);
    point.v = b - static_cast<T>(jm);
  } else {
    const T middle = n * (T(0.5) + t);
    const T rise = T(0.75) * n * z;
    const T a = middle - rise;
    const T b = middle + rise;
    int jp = static_cast<int>(std::floor(a));
    int jm = static_cast<int>(std::floor(b));
    if (jm - jp > nside) jp = jm - nside;  // the same on the belt's side
    point.u = a - static_cast<T>(jp);
    point.v = 1 - (b - static_cast<T>(jm));
    jp += quadrant * nside;
    jm += quadrant * nside;
    point.ring = 2 * nside + jp - jm;
    const int twice = jp + jm - nside + 2 - ((nside + 1 + jp - jm) & 1);
    point.j = ((twice + 8 * nside) >> 1) % (4 * nside);
  }
  point.u = point.u < 0 ? T(0) : point.u < 1 ? point.u : T(1);
  point.v = point.v < 0 ? T(0) : point.v < 1 ? point.v : T(1);
  return point;
}

// The corners of a pixel, ring 1..2N: north, east, south, west.
inline void PixelCorners(int nside, int ring, int j, int index[4]) {
  if (ring <= nside) {
    const int q = j / ring;
    const int m = j % ring;
    const int start = RingStart(nside, ring);
    index[0] = ring == 1 ? 0 : RingStart(nside, ring - 1) + (q * (ring - 1) + m) % (4 * (ring - 1));
    index[1] = start + (j + 1) % (4 * ring);
    index[2] = ring < nside ? RingStart(nside, ring + 1) + q * (ring + 1) + m + 1
                            : RingStart(nside, nside + 1) + j;
    index[3] = start + j;
  } else {
    const int length = 4 * nside;
    const int start = RingStart(nside, ring);
    const int shift = (ring - nside) & 1;
    index[0] = start - length + j;
    index[1] = start + (j + 1 - shift) % length;
    index[2] = start + length + j;
    index[3] = start + (j - shift + length) % length;
  }
}

template <class T>
void BilinearWeights(T u, T v, T weight[4]) {
  weight[0] = (1 - u) * (1 - v);
  weight[1] = u * (1 - v);
  weight[2] = u * v;
  weight[3] = (1 - u) * v;
}

// NeuBRDF, Eq. 1. A distance below 1e-7 counts as 1e-7.
template <class T>
void InverseDistanceWeights(const T direction[3], const T corner[4][3], T weight[4]) {
  T sum = 0;
  for (int c = 0; c < 4; ++c) {
    T square = 0;
    for (int d = 0; d < 3; ++d) {
      const T difference = direction[d] - corner[c][d];
      square += difference * difference;
    }
    const T half_chord = std::sqrt(square) / 2;
    const T distance = 2 * std::asin(half_chord < 1 ? half_chord : T(1));
    weight[c] = 1 / (distance > T(1e-7) ? distance : T(1e-7));
    sum += weight[c];
  }
  for (int c = 0; c < 4; ++c) weight[c] /= sum;
}

template <class T>
Lookup<T> LookUp(int nside, const T direction[3],
                 Interpolation interpolation = Interpolation::kBilinear) {
  const PixelPoint<T> point = LocatePixel(nside, direction);
  Lookup<T> lookup;
  PixelCorners(nside, point.ring, point.j, lookup.index);
  if (interpolation == Interpolation::kBilinear) {
    BilinearWeights(point.u, point.v, lookup.weight);
  } else if (interpolation == Interpolation::kInverseDistance) {
    T corners[4][3];
    for (int c = 0; c < 4; ++c)
      CornerDirection(nside, CornerOf(nside, lookup.index[c]), corners[c]);
    InverseDistanceWeights(direction, corners, lookup.weight);
  } else {
    for (T& weight : lookup.weight) weight = T(0.25);
  }
  return lookup;
}

// ---- The lattice of Nside 2N over the one of Nside N ----

// The corner of lattice 2N at the place of a corner of lattice N. The extra ring of N has no
// counterpart in the hemisphere of 2N.
constexpr Corner ToChild(int nside, Corner corner) {
  return {2 * corner.ring, 2 * corner.j + RingShift(nside, corner.ring)};
}

// Corners of the lattice `child_nside` that a corner of it which is no corner of the lattice
// `child_nside` / 2 lies between: the two ends of an edge of a parent pixel, or all four corners of
// a parent pixel if it is the centre of one.
struct Parents {
  int count = 0;  // 0: a corner of the parent lattice; else 2 or 4, each with the weight 1 / count
  Corner corner[4];
};

// `child_nside` is even. A parent corner on the ring two below the equator is replaced by its
// mirror image two above, which has the same azimuth: so all parents lie in the same hemisphere's
// lattice, on rings up to the equator. The four of a centre on the equator then name one twice.
inline Parents ParentsOf(int child_nside, Corner corner) {
  const int m = child_nside;
  const int k = corner.ring;
  const int j = corner.j;
  const int parent = m / 2;
  Parents result;
  const auto mirrored = [&](int ring) { return ring > 2 * m ? 4 * m - ring : ring; };
  const auto add = [&](int ring, int at) {
    const int count = CornersInRing(m, ring);
    result.corner[result.count++] = {mirrored(ring), (at + count) % count};
  };
  if (k % 2 == 0) {
    if ((j - RingShift(parent, k / 2)) % 2 == 0) return result;
    if (k < m) {  // cap: (p, r) are the distances along the quadrant's two sides, p + r = ring
      const int q = j / k;
      const int p = j % k;
      add(k - 2, q * (k - 2) + p - 1);
      add(k, j + 1);
      add(k + 2, q * (k + 2) + p + 1);
      add(k, j - 1);
    } else if (k == m) {  // north in the cap, south in the belt
      const int q = j / k;
      const int p = j % k;
      add(k - 2, q * (k - 2) + p - 1);
      add(k, j + 1);
      add(k + 2, j);
      add(k, j - 1);
    } else {
      add(k - 2, j);
      add(k, j + 1);
      add(k + 2, j);
      add(k, j - 1);
    }
    return result;
  }
  if (k < m) {
    const int q = j / k;
    const int p = j % k;
    const int step = p % 2;  // which of p and r is odd: the edge runs along it
    add(k - 1, q * (k - 1) + p - step);
    add(k + 1, q * (k + 1) + p + step);
  } else {
    const bool falls_eastward = (j - RingShift(parent, (k - 1) / 2)) % 2 == 0;
    add(k - 1, falls_eastward ? j : j + 1);
    add(k + 1, falls_eastward ? j + 1 : j);
  }
  return result;
}

// ---- Pairs of directions ----

// Turns both directions of an isotropic material about z, and mirrors them, so that wi has azimuth
// 0 and wo the azimuth |phi_o - phi_i| in [0, pi]. A wi within 1e-7 of the pole has no azimuth:
// then wo gets 0 as well, which keeps the result the same for every rotation of the pair.
template <class T>
void FoldIsotropic(T wi[3], T wo[3]) {
  const T radius = std::sqrt(wi[0] * wi[0] + wi[1] * wi[1]);
  T x, y;
  if (radius < T(1e-7)) {
    x = std::sqrt(wo[0] * wo[0] + wo[1] * wo[1]);
    y = 0;
  } else {
    const T c = wi[0] / radius;
    const T s = wi[1] / radius;
    x = c * wo[0] + s * wo[1];
    y = std::abs(c * wo[1] - s * wo[0]);
  }
  wi[0] = radius;
  wi[1] = 0;
  wo[0] = x;
  wo[1] = y;
}

}  // namespace patina::healpix
