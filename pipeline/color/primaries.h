// Chromaticities of RGB spaces, and the matrices between them.
//
// Based on: SMPTE RP 177 (matrix from primaries), Bradford cone responses for another white, as ICC
// and ACES use. Pure functions of their arguments; double throughout.
#pragma once

#include <array>
#include <optional>
#include <string_view>

namespace patina {

// CIE 1931 x, y.
struct Chromaticity {
  double x = 0;
  double y = 0;
  bool operator==(const Chromaticity&) const = default;
};

struct Primaries {
  Chromaticity red, green, blue, white;
  bool operator==(const Primaries&) const = default;
};

inline constexpr Primaries kRec709Primaries{
    {0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, {0.3127, 0.3290}};
// ACES2065-1 and ACEScg: SMPTE ST 2065-1, Academy S-2014-004.
inline constexpr Primaries kAp0Primaries{
    {0.7347, 0.2653}, {0.0, 1.0}, {0.0001, -0.0770}, {0.32168, 0.33767}};
inline constexpr Primaries kAp1Primaries{
    {0.713, 0.293}, {0.165, 0.830}, {0.128, 0.044}, {0.32168, 0.33767}};

// Row-major: out[i] = sum_j m[3 i + j] in[j].
using Matrix3 = std::array<double, 9>;
inline constexpr Matrix3 kIdentity3{1, 0, 0, 0, 1, 0, 0, 0, 1};

Matrix3 Multiply(const Matrix3& a, const Matrix3& b);
// nullopt if it has none, or only one that means nothing in float.
std::optional<Matrix3> Inverse(const Matrix3& m);

// RGB to XYZ with the white at Y = 1. nullopt if the primaries span no triangle or are not finite.
std::optional<Matrix3> RgbToXyz(const Primaries& primaries);
// RGB of one space to RGB of another, adapted to its white by Bradford. nullopt as above.
std::optional<Matrix3> ConversionMatrix(const Primaries& from, const Primaries& to);

// Whether the matrix between them is that of no change, to `tolerance` in each entry. Primaries
// that are given for another white, as ICC profiles do, compare as what they mean.
bool AreSameSpace(const Primaries& a, const Primaries& b, double tolerance);

// What physical colours of a container are. Names reach jobs and manifests.
enum class WorkingSpace { kLinearRec709, kAcesCg };
const char* WorkingSpaceName(WorkingSpace space);  // "lin_rec709", "acescg"
std::optional<WorkingSpace> ParseWorkingSpace(std::string_view name);
const Primaries& PrimariesOf(WorkingSpace space);

}  // namespace patina
