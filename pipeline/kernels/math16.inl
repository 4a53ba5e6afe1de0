// Elementary functions of sixteen lanes, the same bits on every target. Included inside a target
// section, after simd16.h. Polynomials and reductions follow the Cephes library's single-precision
// functions; errors are stated per function.

namespace patina::PATINA_SIMD {

// e^x for x in [-87, 88], within 2 ulp; clamped beyond.
PATINA_INLINE F16 Exp(F16 x) {
  x = Min(Max(x, Set(-87.0f)), Set(88.0f));
  const I16 n = RoundToInt(x * Set(1.44269504f));
  const F16 k = ToFloat(n);
  F16 r = NegMulAdd(k, Set(0.693359375f), x);
  r = NegMulAdd(k, Set(-2.12194440e-4f), r);
  F16 p = Set(1.9875691500e-4f);
  p = MulAdd(p, r, Set(1.3981999507e-3f));
  p = MulAdd(p, r, Set(8.3334519073e-3f));
  p = MulAdd(p, r, Set(4.1665795894e-2f));
  p = MulAdd(p, r, Set(1.6666665459e-1f));
  p = MulAdd(p, r, Set(5.0000001201e-1f));
  p = MulAdd(p, r * r, r + Set(1.0f));
  return p * AsFloat(ShiftLeft<23>(n + SetI(127)));
}

// Natural logarithm for normal x > 0, within 2 ulp.
PATINA_INLINE F16 Log(F16 x) {
  const I16 bits = AsInt(x);
  // Mantissa in [sqrt(1/2), sqrt(2)).
  const I16 shifted = bits + SetI(0x3F800000 - 0x3F3504F3);
  const F16 e = ToFloat(ShiftRight<23>(shifted) + SetI(-127));
  const F16 m = AsFloat((shifted & SetI(0x007FFFFF)) + SetI(0x3F3504F3)) - Set(1.0f);
  const F16 z = m * m;
  F16 p = Set(7.0376836292e-2f);
  p = MulAdd(p, m, Set(-1.1514610310e-1f));
  p = MulAdd(p, m, Set(1.1676998740e-1f));
  p = MulAdd(p, m, Set(-1.2420140846e-1f));
  p = MulAdd(p, m, Set(1.4249322787e-1f));
  p = MulAdd(p, m, Set(-1.6668057665e-1f));
  p = MulAdd(p, m, Set(2.0000714765e-1f));
  p = MulAdd(p, m, Set(-2.4999993993e-1f));
  p = MulAdd(p, m, Set(3.3333331174e-1f));
  F16 y = p * m * z;
  y = MulAdd(e, Set(-2.12194440e-4f), y);
  y = MulAdd(z, Set(-0.5f), y);
  return MulAdd(e, Set(0.693359375f), m + y);
}

// Angle of (x, y) in [0, pi] for y >= 0, within 4e-7; 0 for (0, 0).
PATINA_INLINE F16 Atan2Upper(F16 y, F16 x) {
  const F16 ax = Abs(x);
  const M16 steep = y > ax;
  const F16 low = Select(steep, ax, y), high = Max(Select(steep, y, ax), Set(1e-37f));
  // atan on [0, 1]: one more halving at tan(pi/8) keeps the polynomial short.
  const M16 far = low > Set(0.4142135623f) * high;
  const F16 t = Select(far, low - high, low) / Select(far, low + high, high);
  const F16 z = t * t;
  F16 p = Set(8.05374449538e-2f);
  p = MulAdd(p, z, Set(-1.38776856032e-1f));
  p = MulAdd(p, z, Set(1.99777106478e-1f));
  p = MulAdd(p, z, Set(-3.33329491539e-1f));
  F16 angle = MulAdd(p * z, t, t);
  angle = Select(far, angle + Set(0.78539816f), angle);
  angle = Select(steep, Set(1.57079633f) - angle, angle);
  return Select(x < Zero(), Set(3.14159265f) - angle, angle);
}

}  // namespace patina::PATINA_SIMD
