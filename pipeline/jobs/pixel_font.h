// Small fixed-width text for pictures: letters, digits and what a measurement needs.
#pragma once

#include <string_view>

namespace patina {

inline constexpr int kGlyphWidth = 6;   // with the gap to the next glyph
inline constexpr int kGlyphHeight = 8;  // with the descender

// Whether pixel (x, y) of a character is set; x in [0, kGlyphWidth), y in [0, kGlyphHeight).
// Upper-case letters appear as lower case where the font has none of their own, unknown characters
// as blanks.
bool GlyphPixel(char character, int x, int y);

}  // namespace patina
