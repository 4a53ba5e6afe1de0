// Sparse lists of measurements, as CSV or JSON.
//
// CSV: one measurement a line, comma-separated, spaces ignored; empty lines and lines that begin
// with # are skipped. A first line with names gives the order of the columns: wix, wiy, wiz, wox,
// woy, woz (vectors) or theta_i, phi_i, theta_o, phi_o (degrees), and r, g, b, and optionally
// weight. Without names the order is wix,wiy,wiz,wox,woy,woz,r,g,b[,weight]. A comment line "#
// anisotropic" says that azimuths matter; without it the list is isotropic.
//
// JSON: {"samples": [{"wi": [x, y, z], "wo": [x, y, z], "rgb": [r, g, b], "weight": 1}, ...],
// "isotropic": true}; weight and isotropic are optional and default to these values. Other members
// are ignored.
//
// rgb is f in 1/sr, linear Rec. 709, without the cosine. Vectors are normalised, with a warning
// where their length is not 1 within 0.001. Left out with a warning that counts them and names the
// first: directions at or below the horizon (z below 1e-6) or without a length, values that are
// negative, not finite or above 1e30, weights that are not above 0.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

inline constexpr uint64_t kMaxSparseCsvBytes = uint64_t{64} << 20;
inline constexpr uint64_t kMaxSparseJsonBytes =
    uint64_t{16} << 20;  // a parsed document takes many times its text

// `name` begins the messages. Errors: kCorruptData: a line or member that does not parse, a list
// without a usable sample.
Result<Source> ParseSparseCsv(std::string_view text, const std::string& name);
Result<Source> ParseSparseJson(std::string_view text, const std::string& name);

// Errors as the functions above and ReadFile.
Result<Source> ReadSparseCsv(const std::string& path);
Result<Source> ReadSparseJson(const std::string& path);

}  // namespace patina::brdf
