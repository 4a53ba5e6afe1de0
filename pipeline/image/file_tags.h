// Colour tags in the bytes of files: PNG chunks and ICC profiles.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "pipeline/color/color_tag.h"

namespace patina {

// What the sRGB, gAMA and cHRM chunks of a PNG file say (PNG 1.2, 11.3.3); sRGB goes before the
// others. A gamma of 1/2.2 without other primaries than those of sRGB is what programs write for
// sRGB, and is taken for it. Empty if there are none, or for a file that is no PNG or ends early.
ColorTag TagFromPngChunks(const std::string& path);

// What an ICC profile of RGB or grey says (ICC.1:2010): matrix and curve. A profile that needs a
// table of colours (CMYK, A2B0 alone), that has three different curves, or that is damaged gives an
// empty tag with a problem.
ColorTag TagFromIccProfile(std::span<const uint8_t> profile);

// What the chromaticities attribute of an OpenEXR file says of its linear values: x, y of red,
// green, blue and white.
ColorTag TagFromChromaticities(std::span<const float, 8> values);

}  // namespace patina
