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

  // The same to learn from. weight: how much the value is to count beside others, above 0, at most
  // 1; less where it is noisy.
  virtual bool EvaluateToLearn(const Direction& wi, const Direction& wo, float rgb[3],
                               float* weight) const {
    *weight = 1;
    return Evaluate(wi, wo, rgb);
  }
};

// What a simulation took.
struct SimulationCost {
  uint64_t pairs = 0;         // of directions
  uint64_t paths = 0;         // with those that only told how many are needed
  double standard_error = 0;  // root mean square over the pairs, of log(1 + f c), c the larger cosine
};

// A table without a file: each value is the mean of random paths, the same ones for the same pair.
class SimulatedTable : public Table {
 public:
  // Of all calls of EvaluateToLearn so far.
  virtual SimulationCost Spent() const = 0;

  // The same f with more noise, where many pairs are summed: in an image.
  virtual void EvaluateDraft(const Direction& wi, const Direction& wo, float rgb[3]) const = 0;
};

struct Source {
  std::string format;  // "merl", "rgl", "utia", "sparse", "layered"
  bool isotropic = true;
  float max_theta_rad = 1.5707964f;    // largest colatitude with data
  std::shared_ptr<const Table> table;  // null for a sparse list
  std::vector<Sample> samples;         // of a sparse list; else empty
  std::shared_ptr<const SimulatedTable> simulated;      // the table, where it is simulated; else null
  std::vector<std::string> effects, left_out_effects;  // of the simulation
  uint64_t cells = 0;                  // colours in the file; 0 where there is none
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
