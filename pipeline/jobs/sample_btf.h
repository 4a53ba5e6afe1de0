// A synthetic BTF: a bumpy surface of two materials whose reflectance is known everywhere, as a set
// of images.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"

namespace patina {

inline constexpr int kMaxSampleBtfSide = 1024;
inline constexpr int kMaxSampleBtfImages = 22801;  // 151 x 151, as in the largest measured sets

// Round bumps of rough dark plastic on a ground of brushed-over brass; normals tilt with the bumps,
// and their flanks shade each other. Repeats in both directions.
class SampleBtf {
 public:
  explicit SampleBtf(uint64_t seed);

  // f (1/sr) at texture coordinates u, v; both directions above the horizon.
  void Evaluate(double u, double v, const brdf::Direction& wi, const brdf::Direction& wo,
                float rgb[3]) const;

 private:
  struct Wave {
    int x, y;  // periods over the texture
    double amplitude, phase;
  };
  // Height and its derivatives by u and v, of a texture of side 1.
  void Relief(double u, double v, double* height, double slope[2]) const;

  std::vector<Wave> waves_;
};

struct SampleBtfOptions {
  int size = 64;     // texels a side
  int images = 256;  // rounded down to a square: as many lights as views
  uint64_t seed = 1;
};

// Directions that cover the hemisphere down to 75 degrees evenly, the first near the normal.
std::vector<brdf::Direction> SampleDirections(int count);

// Writes bumps.btf.json and an image (*.exr, half floats) for each pair of directions into
// `folder`, the list last, and returns the paths, the list first. Errors: those of MakeDirectories,
// WriteImage and WriteFileDurably; kCancelled.
Result<std::vector<std::string>> WriteSampleBtf(const std::string& folder,
                                                const SampleBtfOptions& options, ThreadPool& pool,
                                                const CancelToken& cancel, ProgressSink& progress);

}  // namespace patina
