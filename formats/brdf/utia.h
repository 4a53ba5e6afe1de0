// UTIA .bin: anisotropic tables of the UTIA BRDF database (Filip and Vavra 2014).
//
// Raw float64 without a header: planes R, G, B of 288 x 288; row 48 * it_i + ip_i of the light,
// column 48 * it_v + ip_v of the view; theta in steps of 15 degrees from 0 to 75, phi in steps
// of 7.5 from 0. The values are taken for f in linear Rec. 709; the database does not vouch for
// their absolute scale.
//
// Bilinear in theta and phi of both directions, phi wrapping round. Beyond 75 degrees, where
// nothing was measured, the value of the last ring holds; Source::max_theta_rad tells.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

inline constexpr int kUtiaThetas = 6;
inline constexpr int kUtiaPhis = 48;
inline constexpr double kUtiaThetaStepDegrees = 15;
inline constexpr double kUtiaPhiStepDegrees = 7.5;
inline constexpr int kUtiaSide = kUtiaThetas * kUtiaPhis;
inline constexpr int kUtiaCells = kUtiaSide * kUtiaSide;
inline constexpr uint64_t kUtiaFileBytes = uint64_t{3} * kUtiaCells * 8;

// `name` begins the messages. Cells with a negative, infinite or NaN channel, or one above 1e30,
// are left out with a warning. Errors: kCorruptData (also for a table without a valid cell).
Result<Source> ParseUtia(std::span<const uint8_t> bytes, const std::string& name);

// Errors as ParseUtia and ReadFile.
Result<Source> ReadUtia(const std::string& path);

}  // namespace patina::brdf
