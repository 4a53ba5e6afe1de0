#include "pipeline/jobs/preview.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/color/color.h"
#include "pipeline/metrics/normal_angle.h"

namespace patina {
namespace {

using metrics::MapKind;
using metrics::PlanarView;
using metrics::PlanePair;
using Rgb = std::array<float, 3>;

// One side (reference or test) of the channels of a map.
struct Side {
  std::array<PlanarView, 4> planes{};
  std::array<float, 4> constants{};
  int channels = 0;
  MapKind kind = MapKind::kData;

  float Coded(int channel, int x, int y) const {
    const PlanarView& plane = planes[static_cast<size_t>(channel)];
    return plane.data != nullptr ? plane.Row(y)[x] : constants[static_cast<size_t>(channel)];
  }

  // As a person is to see it: sRGB-coded.
  Rgb Shown(int x, int y) const {
    const float first = Coded(0, x, y);
    if (kind == MapKind::kNormalXy && channels >= 2) {
      const float second = Coded(1, x, y);
      return {first, second, metrics::CodedNormalZ(first, second)};
    }
    Rgb rgb{first, first, first};
    if (channels == 2) rgb = {first, Coded(1, x, y), 0};
    if (channels >= 3) rgb = {first, Coded(1, x, y), Coded(2, x, y)};
    if (kind == MapKind::kLinearColor) {
      for (float& c : rgb) c = static_cast<float>(LinearToSrgb(c));
    }
    return rgb;
  }
};

RgbImage MakeImage(int width, int height, float grey) {
  return {width, height, std::vector<float>(static_cast<size_t>(width) * height * 3, grey)};
}

}  // namespace

void Preview::Capture(std::span<const metrics::QualityMap> maps, int width, int height,
                      std::span<const PlanePair> planes, ThreadPool& pool) {
  rows_.clear();
  const int longer = std::max(width, height);
  const int small_width =
      longer <= kTile ? width : std::max(1, static_cast<int>(int64_t{width} * kTile / longer));
  const int small_height =
      longer <= kTile ? height : std::max(1, static_cast<int>(int64_t{height} * kTile / longer));
  const int detail_width = std::min(width, kTile);
  const int detail_height = std::min(height, kTile);
  const int detail_x = (width - detail_width) / 2;
  const int detail_y = (height - detail_height) / 2;

  size_t plane = 0;
  for (const metrics::QualityMap& map : maps) {
    Side source, decoded;
    source.kind = decoded.kind = map.kind;
    source.channels = decoded.channels = std::min(map.channels, 4);
    for (int c = 0; c < source.channels; ++c) {
      const PlanePair& pair = planes[plane + c];
      source.planes[static_cast<size_t>(c)] = pair.reference;
      source.constants[static_cast<size_t>(c)] = pair.reference_constant;
      decoded.planes[static_cast<size_t>(c)] = pair.test;
      decoded.constants[static_cast<size_t>(c)] = pair.test_constant;
    }
    plane += static_cast<size_t>(map.channels);

    Row row;
    row.source = row.decoded = row.difference = MakeImage(small_width, small_height, 0);
    row.source_detail = row.decoded_detail = MakeImage(detail_width, detail_height, 0);
    pool.ParallelFor(small_height, [&](int y, int) {
      const int y0 = static_cast<int>(int64_t{y} * height / small_height);
      const int y1 = std::max(y0 + 1, static_cast<int>(int64_t{y + 1} * height / small_height));
      for (int x = 0; x < small_width; ++x) {
        const int x0 = static_cast<int>(int64_t{x} * width / small_width);
        const int x1 = std::max(x0 + 1, static_cast<int>(int64_t{x + 1} * width / small_width));
        Rgb a{}, b{}, d{};
        for (int sy = y0; sy < y1; ++sy) {
          for (int sx = x0; sx < x1; ++sx) {
            const Rgb s = source.Shown(sx, sy);
            const Rgb t = decoded.Shown(sx, sy);
            for (size_t c = 0; c < 3; ++c) {
              a[c] += s[c];
              b[c] += t[c];
              d[c] += std::fabs(s[c] - t[c]);
            }
          }
        }
        const float scale = 1.0f / static_cast<float>((y1 - y0) * (x1 - x0));
        const size_t at = (static_cast<size_t>(y) * small_width + x) * 3;
        for (size_t c = 0; c < 3; ++c) {
          row.source.rgb[at + c] = a[c] * scale;
          row.decoded.rgb[at + c] = b[c] * scale;
          row.difference.rgb[at + c] = kSheetDifferenceGain * d[c] * scale;
        }
      }
    });
    for (int y = 0; y < detail_height; ++y) {
      for (int x = 0; x < detail_width; ++x) {
        const Rgb s = source.Shown(detail_x + x, detail_y + y);
        const Rgb t = decoded.Shown(detail_x + x, detail_y + y);
        const size_t at = (static_cast<size_t>(y) * detail_width + x) * 3;
        std::copy(s.begin(), s.end(),
                  row.source_detail.rgb.begin() + static_cast<std::ptrdiff_t>(at));
        std::copy(t.begin(), t.end(),
                  row.decoded_detail.rgb.begin() + static_cast<std::ptrdiff_t>(at));
      }
    }
    rows_.push_back(std::move(row));
  }
}

RgbImage Preview::Compose(const std::string& title, std::span<const std::string> labels) const {
  static const std::string kHeads[] = {"source", "decoded", "difference x8", "source 1:1",
                                       "decoded 1:1"};
  std::vector<SheetRow> rows;
  for (size_t i = 0; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    rows.push_back(
        {i < labels.size() ? labels[i] : "",
         {&row.source, &row.decoded, &row.difference, &row.source_detail, &row.decoded_detail}});
  }
  return ComposeSheet(title, kHeads, rows);
}

}  // namespace patina
