// Whether a table that could be anisotropic is: brushed metal and cloth are, most of what is
// measured that way is not, and an isotropic model costs a third of the training.
#pragma once

#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

// The mean of |log(1 + f) - its mean over the turns| over pairs of directions and turns, as a share
// of the mean of log(1 + f): 0 if turning both directions about the normal changes nothing. The
// pairs are fixed: colatitudes from 2 degrees to where the data ends, differences of azimuth in
// steps of 30 degrees, 24 turns. Turns that lack data are passed over; a table without data is 0.
double MeasureAnisotropy(const Table& table, double max_theta_rad);

// Up to here a table counts as isotropic.
inline constexpr double kIsotropicWithin = 0.01;

}  // namespace patina::brdf
