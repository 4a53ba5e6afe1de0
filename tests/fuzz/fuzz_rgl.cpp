// ParseRgl takes any bytes; what it accepts evaluates to finite values.
#include "formats/brdf/rgl.h"
#include "formats/brdf/write_brdf.h"
#include "tests/fuzz/brdf_properties.h"

using namespace patina;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  brdf::CheckSource(brdf::ParseRgl({data, size}, "fuzz.bsdf"));
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  brdf::RglLayout layout;
  layout.theta_count = 2;
  layout.phi_count = 3;
  layout.warp_side = 4;
  layout.colour_side = 3;
  std::vector<std::vector<uint8_t>> seeds = {brdf::EncodeRgl(brdf::SmoothBrdf, layout, "seed")};
  layout.isotropic = false;
  seeds.push_back(brdf::EncodeRgl(brdf::SkewBrdf, layout, "seed"));
  layout.reduction = 2;
  seeds.push_back(brdf::EncodeRgl(brdf::TurnedBrdf, layout, "seed"));
  for (const auto& seed : seeds) FUZZ_CHECK(brdf::ParseRgl(seed, "seed").has_value());
  return seeds;
}
