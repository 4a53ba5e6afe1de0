// MERL .binary: isotropic tables of the MERL BRDF database (Matusik et al. 2003).
//
// Three int32 (90, 90, 180), then float64 planes R, G, B; f = value * (1, 1.15, 1.66)/1500. Index
// (theta_h * 90 + theta_d) * 180 + phi_d, theta_h warped: cell i covers ((i/90)^2, ((i+1)/90)^2) *
// pi/2; theta_d covers [0, pi/2] and phi_d [0, pi) evenly (reciprocity gives the rest).
//
// Node convention: a value stands at the middle of its cell in these (warped) coordinates, node i
// of theta_h at
// ((i + 1/2)/90)^2 * pi/2. Between nodes the table is trilinear; beyond the first and last node of
// theta_h and theta_d the value holds; phi_d wraps round with period pi.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

inline constexpr int kMerlThetaH = 90;
inline constexpr int kMerlThetaD = 90;
inline constexpr int kMerlPhiD = 180;
inline constexpr int kMerlCells = kMerlThetaH * kMerlThetaD * kMerlPhiD;
inline constexpr int kMerlHeaderBytes = 12;
inline constexpr uint64_t kMerlFileBytes = kMerlHeaderBytes + uint64_t{3} * kMerlCells * 8;
inline constexpr double kMerlScale[3] = {1.0 / 1500, 1.15 / 1500, 1.66 / 1500};

// Angles of the middle of a cell.
struct MerlNode {
  double theta_h, theta_d, phi_d;
};
MerlNode MerlNodeAt(int theta_h, int theta_d, int phi_d);

// Whether the bytes begin with the header of a table of these dimensions.
bool LooksLikeMerl(std::span<const uint8_t> bytes);

// `name` begins the messages. Cells with a negative, infinite or NaN channel, or one above 1e30,
// are left out, in all channels. Such cells are counted as invalid, with a warning, where the
// middle of the cell is above the horizon; the others stand for no directions. Errors: kCorruptData
// (also for a table without a valid cell).
Result<Source> ParseMerl(std::span<const uint8_t> bytes, const std::string& name);

// Errors as ParseMerl and ReadFile.
Result<Source> ReadMerl(const std::string& path);

}  // namespace patina::brdf
