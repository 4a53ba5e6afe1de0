// Values of a baked BRDF at given pairs of directions.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace patina {

inline constexpr uint64_t kMaxPairsBytes = uint64_t{256} << 20;  // larger files are refused

// Unit vectors, z along the normal, both pointing away from the surface.
struct DirectionPair {
  float wi[3];
  float wo[3];
};

// One pair a line, wix,wiy,wiz,wox,woy,woz; spaces, empty lines and lines that begin with # are
// skipped, and so is a first line with these six names. Lengths within 0.001 of 1 are made 1.
// Errors: kInvalidArgument, naming the line, for everything else. `name` begins the messages.
Result<std::vector<DirectionPair>> ParsePairs(std::string_view text, const std::string& name);

// A line r,g,b for each pair: f in 1/sr, linear Rec. 709, without the cosine, by the reference
// decoder; digits enough to read the same floats back. 0,0,0 where a direction is not above the
// horizon. `container` as for OpenContainer. Errors: those of OpenContainer, VerifyPayloads,
// ReadTextFile and ParsePairs; kUnsupported for a container of another kind.
Result<std::string> EvaluatePairsFile(const std::string& container, const std::string& pairs_file);

}  // namespace patina
