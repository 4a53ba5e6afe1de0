// Elementary functions of the simulator, inline and with the same bits on every CPU: libm chooses
// among variants, with and without fused operations, when a program starts.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

// Inlined wherever it is used: with two dozen kernels in a file the compiler's own limits would
// call these functions, at a tenth of a kernel's time.
#define PATINA_HOT [[gnu::always_inline]]

namespace patina::layered {

inline constexpr double kPi = 3.14159265358979323846;

// sin and cos of 2 pi u, u in [0, 1]; within 1e-12.
PATINA_HOT inline void SinCosTurns(double u, double* sine, double* cosine) {
  const int quarter = static_cast<int>(4 * u + 0.5);
  const double x = 2 * kPi * (u - 0.25 * quarter);  // within pi/4
  const double z = x * x;
  const double s =
      x * (1 + z * (-1.0 / 6 +
                    z * (1.0 / 120 +
                         z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800 +
                                                                     z * (1.0 / 6227020800)))))));
  const double c =
      1 + z * (-0.5 + z * (1.0 / 24 +
                           z * (-1.0 / 720 +
                                z * (1.0 / 40320 + z * (-1.0 / 3628800 + z * (1.0 / 479001600))))));
  // A quarter turns (c, s) into (-s, c).
  const bool odd = (quarter & 1) != 0;
  const double along = odd ? s : c;
  const double across = odd ? c : s;
  *cosine = ((quarter + 1) & 2) != 0 ? -along : along;
  *sine = (quarter & 2) != 0 ? -across : across;
}

// The natural logarithm of a positive normal number, within 2e-16 relative to max(1, |result|).
inline double Log(double x) {
  const uint64_t bits = std::bit_cast<uint64_t>(x);
  // The mantissa in [sqrt(1/2), sqrt(2)).
  const uint64_t shifted = bits - 0x3FE6A09E667F3BCDull;
  const int64_t exponent = static_cast<int64_t>(shifted) >> 52;
  const double m = std::bit_cast<double>(bits - (static_cast<uint64_t>(exponent) << 52));
  const double s = (m - 1) / (m + 1);
  const double z = s * s;
  const double series =
      1 + z * (1.0 / 3 +
               z * (1.0 / 5 +
                    z * (1.0 / 7 +
                         z * (1.0 / 9 +
                              z * (1.0 / 11 + z * (1.0 / 13 + z * (1.0 / 15 + z * (1.0 / 17))))))));
  return 2 * s * series + static_cast<double>(exponent) * 0.693147180559945309;
}

// e^x for x <= 0, within 1e-14 relative; 0 below -708.
inline double ExpOfNegative(double x) {
  if (!(x > -708)) return 0;
  const int n = static_cast<int>(x * 1.44269504088896341 - 0.5);
  const double r = (x - n * 0.6931471803691238) - n * 1.9082149292705877e-10;
  const double e =
      1 +
      r * (1 +
           r * (1.0 / 2 +
                r * (1.0 / 6 +
                     r * (1.0 / 24 +
                          r * (1.0 / 120 +
                               r * (1.0 / 720 +
                                    r * (1.0 / 5040 + r * (1.0 / 40320 +
                                                           r * (1.0 / 362880 +
                                                                r * (1.0 / 3628800 +
                                                                     r * (1.0 / 39916800)))))))))));
  return e * std::bit_cast<double>(static_cast<uint64_t>(1023 + n) << 52);
}

struct Vec {
  double x = 0, y = 0, z = 0;
};

inline Vec operator+(const Vec& a, const Vec& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(const Vec& a) { return {-a.x, -a.y, -a.z}; }
inline Vec operator*(double s, const Vec& a) { return {s * a.x, s * a.y, s * a.z}; }
inline double Dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec Normalized(const Vec& a) { return (1 / std::sqrt(Dot(a, a))) * a; }
// The direction seen in a mirror in the plane of the surface.
inline Vec Flipped(const Vec& a) { return {a.x, a.y, -a.z}; }

}  // namespace patina::layered
