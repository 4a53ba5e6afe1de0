// Fits the tables of an importance sampler to a BRDF.
#pragma once

#include <functional>

#include "formats/decoder/patina_brdf_sampler.h"

namespace patina::brdf {

// The luminance of f at unit vectors above the horizon, 1/sr; not finite and negative values count
// as 0. Called from one thread, in a fixed order.
using Luminance = std::function<double(const float wi[3], const float wo[3])>;

struct SamplerShape {
  int theta_i_bins = 16;
  int theta_h_cells = 64;
  // Isotropic: |phi_h - phi_i| over [0, pi]; 1 is uniform about the normal. Anisotropic: phi_h over
  // [0, 2 pi).
  int phi_cells = 1;
  bool isotropic = true;
};

// 1 kB with an isotropic material, 17 kB with an anisotropic one.
inline SamplerShape DefaultSamplerShape(bool isotropic) {
  SamplerShape shape;
  shape.isotropic = isotropic;
  shape.phi_cells = isotropic ? 1 : 16;
  return shape;
}

// For each bin of theta_i, by quadrature over the half vectors of every cell: tables proportional
// to the light that a cell reflects, with none, half or nine tenths of the diffuse floor left to
// the cosine part, and the mixture in steps of 1/20 that gives the least variance of f cos(theta_o)
// / pdf. The cosine part keeps at least a tenth, so the pdf is 0 nowhere above the horizon. The
// same bytes for the same values of f. `shape` is within the limits of BrdfSamplerTables.
BrdfSamplerTables FitSampler(const SamplerShape& shape, const Luminance& luminance);

// E[(f cos / pdf)^2] - E[f cos / pdf]^2 of one sample, averaged over `directions` wi stratified in
// cos(theta_i) and `samples` samples each, relative to the square of the mean; fixed seed. With an
// empty sampler: of cosine sampling.
double RelativeVariance(const BrdfSampler& sampler, const Luminance& luminance, int directions,
                        int samples);

}  // namespace patina::brdf
