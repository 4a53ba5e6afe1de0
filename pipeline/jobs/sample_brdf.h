// Sample BRDFs on disk: analytic materials in the formats of measurements, to bake without a
// download.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/brdf/write_brdf.h"

namespace patina {

enum class AnalyticBrdf {
  kPlastic,  // red diffuse base under a coat of refractive index 1.5, GGX alpha 0.15
  kMetal,    // gold-like conductor (Schlick), GGX alpha 0.25
  kMirror,   // conductor with a lobe of 0.1 degree, GGX alpha 0.00175
  kBrushed,  // anisotropic conductor, GGX alpha 0.2 along x, 0.02 along y
  kRings,  // isotropic and reciprocal, but smooth in no simple coordinates: rings round the normal
           // on one side of the plane of incidence, retro-reflection, a thin film's colours
};

// f(wi, wo) in 1/sr, without the cosine, linear Rec. 709, finite and at least 0; zero unless both z
// are above 0. Reciprocal; all but kBrushed isotropic.
void EvaluateAnalytic(AnalyticBrdf material, const brdf::Direction& wi, const brdf::Direction& wo,
                      float rgb[3]);

struct MeasurementNoise {
  double relative = 0;       // standard deviation, as a share of the value; drawn per channel
  double absolute = 0;       // standard deviation, 1/sr; drawn per channel
  double invalid_share = 0;  // of the measurements fail: -1 in all channels
  uint64_t seed = 1;
};

// The material as an instrument with this noise sees it: each call is one measurement, so the
// sequence of calls decides. Values are held at 0 and more, as negative ones mean failure in these
// formats.
brdf::BrdfFunction MeasuredBrdf(AnalyticBrdf material, const MeasurementNoise& noise);

// The sample files:
//   plastic.binary metal.binary mirror.binary rings.binary rings_noisy.binary   MERL tables, 35.0
//   MB each brushed.bsdf brushed.bin     kBrushed as RGL and as UTIA file, 23 MB and 2 MB
//   sparse.csv                   448 measurements of kPlastic, directions of a low-discrepancy
//   sequence
const std::vector<std::string>& SampleBrdfNames();

// The bytes of one of them; `noise` is that of rings_noisy.binary, the others have none.
std::vector<uint8_t> EncodeSampleBrdf(const std::string& name, const MeasurementNoise& noise);

struct SampleBrdfOptions {
  MeasurementNoise noise{0.03, 0.002, 0.1, 1};
  std::vector<std::string> files;  // of SampleBrdfNames(); empty: all
};

// Writes the sample files into `folder` (made if missing), replacing files of the same names.
// Errors: kInvalidArgument (noise that is negative, not finite or above 1000, a share outside 0 to
// 1, a name that is none), kIo, kResourceExhausted.
Status WriteSampleBrdfs(const std::string& folder, const SampleBrdfOptions& options);

}  // namespace patina
