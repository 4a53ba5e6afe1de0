#include "pipeline/jobs/preview.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/jobs/pixel_font.h"

namespace patina {
namespace {

using metrics::DensePlane;
using metrics::MapKind;
using metrics::PlanePair;
using metrics::QualityMap;

TEST(GlyphPixel, DrawsLettersDigitsAndSigns) {
  for (const char c : std::string("abcdefghijklmnopqrstuvwxyz0123456789.,:-+_/()B")) {
    int pixels = 0;
    for (int y = 0; y < kGlyphHeight; ++y) {
      for (int x = 0; x < kGlyphWidth; ++x) pixels += GlyphPixel(c, x, y) ? 1 : 0;
    }
    EXPECT_GT(pixels, 1) << c;
  }
  for (int code = 0; code < 256; ++code) EXPECT_FALSE(GlyphPixel(static_cast<char>(code), 5, 0));
  EXPECT_TRUE(GlyphPixel('Q', 1, 2) == GlyphPixel('q', 1, 2));
}

TEST(Preview, ShowsSourceDecodedAndTheirDifference) {
  constexpr int kWidth = 300, kHeight = 200;
  const std::vector<float> source(kWidth * kHeight, 0.5f), decoded(kWidth * kHeight, 0.55f);
  const std::vector<QualityMap> maps = {{"ao", MapKind::kData, 1, false},
                                        {"albedo", MapKind::kSrgbColor, 3, false}};
  std::vector<PlanePair> planes(4);
  planes[0].reference = DensePlane(source.data(), kWidth, kHeight);
  planes[0].test = DensePlane(decoded.data(), kWidth, kHeight);
  planes[1].reference_constant = planes[1].test_constant = 1;  // the rest is a constant red
  ThreadPool pool(2);
  Preview preview;
  preview.Capture(maps, kWidth, kHeight, planes, pool);
  const std::vector<std::string> labels = {"ao", "albedo"};
  const RgbImage sheet = preview.Compose("title", labels);
  auto count = [&](float r, float g, float b) {
    int n = 0;
    for (size_t i = 0; i < sheet.rgb.size(); i += 3) {
      n += std::abs(sheet.rgb[i] - r) < 1e-4f && std::abs(sheet.rgb[i + 1] - g) < 1e-4f &&
                   std::abs(sheet.rgb[i + 2] - b) < 1e-4f
               ? 1
               : 0;
    }
    return n;
  };
  const int small = Preview::kTile * (Preview::kTile * kHeight / kWidth);
  const int detail = Preview::kTile * Preview::kTile;
  EXPECT_EQ(count(0.5f, 0.5f, 0.5f), small + detail);
  EXPECT_EQ(count(0.55f, 0.55f, 0.55f), small + detail);
  EXPECT_EQ(count(0.4f, 0.4f, 0.4f), small);  // eight times the difference
  EXPECT_EQ(count(1, 0, 0), 2 * (small + detail));
  EXPECT_EQ(count(0, 0, 0), small);
}

TEST(Preview, TakesAnySize) {
  ThreadPool pool(1);
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 4000}, {4000, 1}, {191, 193}}) {
    const std::vector<float> plane(static_cast<size_t>(width) * static_cast<size_t>(height), 0.25f);
    const std::vector<QualityMap> maps = {{"normal", MapKind::kNormalXy, 2, false}};
    std::vector<PlanePair> planes(2);
    planes[0].reference = planes[0].test = DensePlane(plane.data(), width, height);
    planes[1].reference_constant = planes[1].test_constant = 0.5f;
    Preview preview;
    preview.Capture(maps, width, height, planes, pool);
    const RgbImage sheet = preview.Compose("", {});
    EXPECT_EQ(sheet.rgb.size(), static_cast<size_t>(sheet.width) * sheet.height * 3);
    EXPECT_GT(sheet.width, 5 * Preview::kTile);
    EXPECT_LT(sheet.height, 400);
  }
}

}  // namespace
}  // namespace patina
