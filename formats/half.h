// Half-precision floats (IEEE 754 binary16) as their bits, in plain scalar code.
#pragma once

#include <cstdint>
#include <cstring>

namespace patina {

inline constexpr float kMaxHalf = 65504.0f;

// The value of a half, exactly; infinities and NaN (with payload) included.
inline float HalfToFloat(uint16_t half) {
  const uint32_t sign = static_cast<uint32_t>(half & 0x8000u) << 16;
  const uint32_t magnitude = half & 0x7FFFu;
  uint32_t bits;
  if (magnitude >= 0x7C00u) {
    bits = 0x7F800000u | (magnitude & 0x3FFu) << 13;
  } else if (magnitude >= 0x400u) {
    bits = (magnitude << 13) + (112u << 23);
  } else {
    // Denormal: magnitude * 2^-24, exact in float and never a denormal there.
    const float value = static_cast<float>(static_cast<int32_t>(magnitude)) * 0x1p-24f;
    std::memcpy(&bits, &value, sizeof bits);
  }
  bits |= sign;
  float result;
  std::memcpy(&result, &bits, sizeof result);
  return result;
}

// The nearest half, ties to even; beyond 65520 infinity; NaN stays a (quiet) NaN. Same as F16C's
// VCVTPS2PH.
inline uint16_t FloatToHalf(float value) {
  uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  const uint32_t sign = (bits >> 16) & 0x8000u;
  const uint32_t magnitude = bits & 0x7FFFFFFFu;
  uint32_t half;
  if (magnitude > 0x7F800000u) {
    half = 0x7E00u | ((magnitude >> 13) & 0x3FFu);
  } else if (magnitude >= 0x47800000u) {  // 65536 and more
    half = 0x7C00u;
  } else if (magnitude >= 0x38800000u) {  // 2^-14 and more: a normal half
    const uint32_t odd = (magnitude >> 13) & 1u;
    half =
        (magnitude - (112u << 23) + 0xFFFu + odd) >> 13;  // may carry into infinity, which is right
  } else if (magnitude < 0x33000000u) {                   // below half of the least denormal
    half = 0;
  } else {
    const uint32_t exponent = magnitude >> 23;  // 102..112
    const uint32_t mantissa = (magnitude & 0x7FFFFFu) | 0x800000u;
    const uint32_t shift = 126u - exponent;  // 14..24
    half = mantissa >> shift;
    const uint32_t rest = mantissa & ((1u << shift) - 1u);
    const uint32_t tie = 1u << (shift - 1u);
    if (rest > tie || (rest == tie && (half & 1u) != 0)) ++half;
  }
  return static_cast<uint16_t>(sign | half);
}

inline bool HalfIsFinite(uint16_t half) { return (half & 0x7C00u) != 0x7C00u; }

}  // namespace patina
