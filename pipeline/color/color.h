// Transfer curves: the one place that knows their constants. They say nothing of primaries.
//
// Source of the curve: IEC 61966-2-1 (sRGB), with the published constants: slope 12.92 below
// 0.0031308 (linear) or 0.04045 (coded), else 1.055 x^(1/2.4) - 0.055. Both curves go through the
// origin as odd functions for negative values and on beyond 1, so that nothing is clipped here.
// Pure functions of their arguments; safe from any thread.
#pragma once

#include <cstddef>
#include <cstdint>

namespace patina {

// Exact piecewise curves, in double.
double SrgbToLinear(double coded);
double LinearToSrgb(double linear);

// The camera's curve of ITU-R BT.709: slope 4.5 below the knee, else 1.0993 x^0.45 - 0.0993, with
// the constants in full (BT.2020), so that both parts and their slopes meet. Odd, as above.
double Rec709ToLinear(double coded);
double LinearToRec709(double linear);

// The encoding signed_log of containers: coded = sign(x) log2(1 + |x| / scale), and back. For
// scale > 0; linear below scale, logarithmic beyond.
void SignedLogRow(const float* in, size_t count, float scale, float* out);
double SignedLogToLinear(double coded, double scale);

// Rounded from the exact curve: coded = code / 255.
float Srgb8ToLinear(uint8_t code);

// Table versions for whole rows. `out` may be `in`. NaN gives NaN.
//   Decode: within 1e-7 of the exact curve for |coded| <= 1; exact curve rounded to float beyond.
//   Encode: within 1e-6 of the exact curve for |linear| <= 1; likewise.
// 0 and 1 are mapped to themselves exactly.
void SrgbToLinearRow(const float* in, size_t count, float* out);
void LinearToSrgbRow(const float* in, size_t count, float* out);

}  // namespace patina
