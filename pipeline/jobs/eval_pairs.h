// Values of a baked BRDF at given pairs of directions, and at places where it varies.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace patina {

inline constexpr uint64_t kMaxPairsBytes = uint64_t{256} << 20;  // larger files are refused

// Unit vectors, z along the normal, both pointing away from the surface; and a place.
struct DirectionPair {
  float wi[3];
  float wo[3];
  double u = 0, v = 0;  // texture coordinates, v downwards
  double level = 0;     // of detail, in mips
};

enum class PairColumns {
  kDirections,  // wix,wiy,wiz,wox,woy,woz
  kPlaces       // these and u,v, and level or nothing, which is level 0
};

// One pair a line; spaces, empty lines and lines that begin with # are skipped, and so is a first
// line with the columns' names. All lines have as many values as the first one. Lengths within
// 0.001 of 1 are made 1. Errors: kInvalidArgument, naming the line, for everything else. `name`
// begins the messages.
Result<std::vector<DirectionPair>> ParsePairs(std::string_view text, PairColumns columns,
                                              const std::string& name);

// A line r,g,b for each pair: f in 1/sr, linear Rec. 709, without the cosine, by the reference
// decoder; digits enough to read the same floats back. 0,0,0 where a direction is not above the
// horizon. Of a BRDF that varies the pairs have places: beyond 0 to 1 the texture is repeated or
// clamped as it was baked, and levels beyond the first and last mip are those. `container` as for
// OpenContainer. Errors: those of OpenContainer, VerifyPayloads, ReadTextFile and ParsePairs;
// kUnsupported for a material.
Result<std::string> EvaluatePairsFile(const std::string& container, const std::string& pairs_file);

}  // namespace patina
