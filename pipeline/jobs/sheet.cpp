#include "pipeline/jobs/sheet.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "pipeline/jobs/pixel_font.h"

namespace patina {
namespace {

constexpr int kGap = 10;
constexpr int kLabelHeight = 2 * kGlyphHeight + 6;
constexpr int kTextScale = 2;
constexpr float kBackground = 0.11f;
constexpr float kInk = 0.86f;

void Paste(const RgbImage& picture, int left, int top, RgbImage* sheet) {
  for (int y = 0; y < picture.height; ++y) {
    const float* from = picture.rgb.data() + static_cast<size_t>(y) * picture.width * 3;
    float* to = sheet->rgb.data() + (static_cast<size_t>(top + y) * sheet->width + left) * 3;
    for (int i = 0; i < 3 * picture.width; ++i) to[i] = std::clamp(from[i], 0.0f, 1.0f);
  }
}

void Write(std::string_view text, int left, int top, RgbImage* sheet) {
  for (size_t i = 0; i < text.size(); ++i) {
    for (int y = 0; y < kGlyphHeight * kTextScale; ++y) {
      for (int x = 0; x < kGlyphWidth * kTextScale; ++x) {
        const int column = left + static_cast<int>(i) * kGlyphWidth * kTextScale + x;
        if (column >= sheet->width || top + y >= sheet->height) continue;
        if (!GlyphPixel(text[i], x / kTextScale, y / kTextScale)) continue;
        float* pixel =
            sheet->rgb.data() + (static_cast<size_t>(top + y) * sheet->width + column) * 3;
        std::fill(pixel, pixel + 3, kInk);
      }
    }
  }
}

}  // namespace

RgbImage DifferenceOf(const RgbImage& a, const RgbImage& b) {
  RgbImage difference = a;
  for (size_t i = 0; i < a.rgb.size(); ++i)
    difference.rgb[i] = std::min(1.0f, kSheetDifferenceGain * std::fabs(a.rgb[i] - b.rgb[i]));
  return difference;
}

RgbImage ComposeSheet(const std::string& title, std::span<const std::string> heads,
                      std::span<const SheetRow> rows) {
  int row_height = 0;
  if (!rows.empty()) {
    for (const RgbImage* picture : rows[0].pictures)
      row_height = std::max(row_height, picture->height);
  }
  const int columns = static_cast<int>(heads.size());
  const int top = kGap + 2 * kLabelHeight;
  RgbImage sheet;
  sheet.width = columns * (kSheetTile + kGap) + kGap;
  sheet.height = top + static_cast<int>(rows.size()) * (kLabelHeight + row_height + kGap);
  sheet.rgb.assign(static_cast<size_t>(sheet.width) * sheet.height * 3, kBackground);
  const auto left = [](size_t column) {
    return kGap + static_cast<int>(column) * (kSheetTile + kGap);
  };
  Write(title, kGap, kGap, &sheet);
  for (size_t c = 0; c < heads.size(); ++c) Write(heads[c], left(c), kGap + kLabelHeight, &sheet);
  for (size_t i = 0; i < rows.size(); ++i) {
    const int y = top + static_cast<int>(i) * (kLabelHeight + row_height + kGap);
    Write(rows[i].label, kGap, y, &sheet);
    for (size_t c = 0; c < rows[i].pictures.size(); ++c)
      Paste(*rows[i].pictures[c], left(c), y + kLabelHeight, &sheet);
  }
  return sheet;
}

}  // namespace patina
