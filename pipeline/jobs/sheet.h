// Labelled pictures in rows and columns, for a person to look at.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace patina {

// An image for a person: sRGB-coded, row-major, three interleaved channels in [0,1].
struct RgbImage {
  int width = 0;
  int height = 0;
  std::vector<float> rgb;
};

inline constexpr int kSheetTile = 192;            // pixels a side: the most that a picture has
inline constexpr float kSheetDifferenceGain = 8;  // what differences are shown multiplied by

// The difference of two pictures of one size, times kSheetDifferenceGain.
RgbImage DifferenceOf(const RgbImage& a, const RgbImage& b);

struct SheetRow {
  std::string label;
  std::vector<const RgbImage*> pictures;  // by column, at most as many as there are heads
};

// A title, a head above each column and a label above each row. Every row is as high as the highest
// picture of the first. Text that does not fit is cut off.
RgbImage ComposeSheet(const std::string& title, std::span<const std::string> heads,
                      std::span<const SheetRow> rows);

}  // namespace patina
