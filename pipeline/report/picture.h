// Pictures that are part of the page itself.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina {

// The bytes of an 8-bit PNG: rows from the top of 1 or 3 interleaved channels in [0, 1].
// scratch_path: a file that is written and removed again, since images are written to files only.
// Errors: those of WriteImage and ReadFile.
Result<std::vector<uint8_t>> EncodePng(const std::string& scratch_path, int width, int height,
                                       int channels, const float* values);

std::string Base64(std::span<const uint8_t> bytes);  // RFC 4648, section 4, padded

std::string PngDataUri(std::span<const uint8_t> png);

}  // namespace patina
