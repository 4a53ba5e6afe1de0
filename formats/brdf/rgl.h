// RGL .bsdf: measurements of the EPFL material database (Dupuy and Jakob 2018), a tensor file
// (tensor_file.h) with the fields
//   theta_i [T], phi_i [P]        light directions, radians, increasing; at most 2 azimuths: an
//   isotropic material sigma, ndf [h, w]             projected area and normal density over (phi,
//   theta) of a direction vndf [P, T, h, w]             density of visible normals, the
//   parameterisation of what follows rgb [P, T, 3, h, w]           or spectra [P, T, L, h, w] with
//   wavelengths [L] in nm jacobian [1]                  1: the colours are f cos(theta_o) 4
//   sigma/ndf; 0: f cos(theta_o) reduction [1]                 optional: 2 for a material that is
//   the same turned by pi, 4 for one mirrored in x and in y.
//                                 Else told by the range of phi_i: 2 pi / range.
// and others (description, luminance, valid, version) that are not needed here: tensors are
// complete, holes of the measurement were filled by its authors.
//
// Differs from the published evaluator, which returns f cos(theta_o): the cosine is divided out.
// Within 0.6 degrees of the horizon the cosine of that angle stands for it, so that noise there
// stays bounded. Spectra become linear Rec. 709 under D65, a perfect white (1, 1, 1).
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

inline constexpr uint64_t kMaxRglBytes = uint64_t{1} << 30;

// `name` begins the messages. Colours that are not finite, above 1e30 in size or of negative
// luminance are left out with a warning; a single negative channel is a colour outside Rec. 709 and
// stays. Errors: kCorruptData (also without a valid colour, and for a parameterisation with bad
// values), kUnsupported.
Result<Source> ParseRgl(std::span<const uint8_t> bytes, const std::string& name);

// Errors as ParseRgl and ReadFile.
Result<Source> ReadRgl(const std::string& path);

}  // namespace patina::brdf
