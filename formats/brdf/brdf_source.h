// A measured or tabulated BRDF, whatever file it came from: f(wi, wo) in 1/sr, without the cosine,
// linear Rec. 709.
//
// Directions are unit vectors in the frame of the surface, z along the normal, both pointing away
// from the surface.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina::brdf {

struct Direction {
  float x = 0, y = 0, z = 1;
};

// One measurement of a sparse list.
struct Sample {
  Direction wi, wo;
  float rgb[3] = {0, 0, 0};  // f, 1/sr
  float weight = 1;          // relative, > 0
};

// Where a format interpolates between cells that are not all valid, the valid ones decide.
class Table {
 public:
  virtual ~Table() = default;

  // f at a pair of directions. Returns false where the file has no valid data near them, or below
  // the horizon; rgb is then zero. Values are finite; noise of the measurement may make them
  // negative. Thread-safe.
  virtual bool Evaluate(const Direction& wi, const Direction& wo, float rgb[3]) const = 0;
};

struct Source {
  std::string format;  // "merl", "rgl", "utia", "sparse"
  bool isotropic = true;
  float max_theta_rad = 1.5707964f;    // largest colatitude with data
  std::shared_ptr<const Table> table;  // null for a sparse list
  std::vector<Sample> samples;         // of a sparse list; else empty
  uint64_t cells = 0;                  // colours in the file
  // Of those, the ones that were left out: negative, not finite. Cells of a MERL table that stand
  // for directions below the horizon are no data and not counted.
  uint64_t invalid_cells = 0;
  // Data that was repaired or left out, with counts and the first place.
  std::vector<std::string> warnings;
};

// The kinds of file by name: "x.binary" MERL, "x.bsdf" RGL, "x.bin" UTIA (or MERL, by its header),
// "x.csv" and "x.json" sparse lists. HasBrdfExtension tells whether OpenBrdf would try; a .json
// must be told from a job by its content.
bool HasBrdfExtension(const std::string& path);

// Reads a file of any of the formats. Errors: kNotFound, kIo, kCorruptData, kUnsupported,
// kOutOfRange; they name the file, the place and the remedy.
Result<Source> OpenBrdf(const std::string& path);

}  // namespace patina::brdf
