// Writers for the formats that the readers take: an analytic BRDF as bytes of a measurement.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

// f(wi, wo) in 1/sr, without the cosine, linear Rec. 709; both directions above the surface. A
// negative channel marks a measurement that failed: each writer stores it so that the readers leave
// it out. Called in the same order every time, by one thread.
using BrdfFunction = std::function<void(const Direction& wi, const Direction& wo, float rgb[3])>;

// A MERL table (merl.h), of an isotropic reciprocal BRDF: f at the middle of each cell with phi_h =
// 0; -1 for cells below the horizon.
std::vector<uint8_t> EncodeMerl(const BrdfFunction& brdf);

// A UTIA table (utia.h): f at its nodes.
std::vector<uint8_t> EncodeUtia(const BrdfFunction& brdf);

// How an RGL file is laid out. The GGX distribution with these alphas makes the parameterisation
// (sigma, ndf, vndf): it should have the shape of the material's highlight, no more.
struct RglLayout {
  bool isotropic = true;  // then alpha_y, phi_count and reduction are not used
  double alpha_x = 0.3;
  double alpha_y = 0.3;
  int theta_count = 12;  // light colatitudes 0 to 90 degrees, even steps; 2 and more
  int phi_count = 9;     // light azimuths; 3 and more
  int reduction = 1;     // 1, 2 (the same turned by 180 degrees) or 4 (mirrored in x and in y): a
                         // circle, a half, a quarter
  int warp_side = 128;   // nodes of sigma, ndf and vndf a side; 2 and more
  int colour_side = 32;  // nodes of rgb and luminance a side; 2 and more
};

// An RGL file (rgl.h) with rgb colours. Places that stand for directions below the horizon hold 0.
std::vector<uint8_t> EncodeRgl(const BrdfFunction& brdf, const RglLayout& layout,
                               const std::string& description);

// Measurements at the given pairs (wi, wo), with names in the first line; "# anisotropic" where
// that is so.
std::string EncodeSparseCsv(const BrdfFunction& brdf,
                            std::span<const std::pair<Direction, Direction>> pairs, bool isotropic);
std::string EncodeSparseJson(const BrdfFunction& brdf,
                             std::span<const std::pair<Direction, Direction>> pairs,
                             bool isotropic);

}  // namespace patina::brdf
