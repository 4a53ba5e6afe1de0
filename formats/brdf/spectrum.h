// Spectra to linear Rec. 709.
#pragma once

#include <array>
#include <span>
#include <vector>

namespace patina::brdf {

// Weights that turn a reflectance sampled at `wavelengths_nm` (finite, strictly increasing, one or
// more) into linear Rec. 709 rgb under illuminant D65, for the CIE 1931 observer: rgb[c] = sum_i
// weights[i][c] * reflectance[i]. Between the wavelengths the spectrum is linear, beyond them it
// holds. A reflectance of 1 everywhere gives exactly (1, 1, 1) up to rounding.
std::vector<std::array<double, 3>> SpectrumToRec709(std::span<const double> wavelengths_nm);

}  // namespace patina::brdf
