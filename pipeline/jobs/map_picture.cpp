#include "pipeline/jobs/map_picture.h"

#include <algorithm>
#include <cmath>

#include "pipeline/color/color.h"
#include "pipeline/metrics/normal_angle.h"

namespace patina {
namespace {

using metrics::MapKind;
using metrics::PlanarView;
using metrics::PlanePair;

RgbImage MakeImage(int width, int height) {
  return {width, height, std::vector<float>(static_cast<size_t>(width) * height * 3)};
}

}  // namespace

float MapView::Side::Coded(int channel, int x, int y) const {
  const PlanarView& plane = planes[static_cast<size_t>(channel)];
  return plane.data != nullptr ? plane.Row(y)[x] : constants[static_cast<size_t>(channel)];
}

MapView::Rgb MapView::Side::Shown(int x, int y) const {
  const float first = Coded(0, x, y);
  if (kind == MapKind::kNormalXy && channels >= 2) {
    const float second = Coded(1, x, y);
    return {first, second, metrics::CodedNormalZ(first, second)};
  }
  Rgb rgb{first, first, first};
  if (channels == 2) rgb = {first, Coded(1, x, y), 0};
  if (channels >= 3) rgb = {first, Coded(1, x, y), Coded(2, x, y)};
  const bool convert = !same_space && channels == 3 && kind != MapKind::kData;
  if (kind != MapKind::kLinearColor && !convert) return rgb;
  std::array<double, 3> linear{rgb[0], rgb[1], rgb[2]};
  if (kind == MapKind::kSrgbColor) {
    for (double& c : linear) c = SrgbToLinear(c);
  }
  for (size_t c = 0; c < 3; ++c) {
    const double* m = to_rec709.data() + 3 * c;
    rgb[c] = static_cast<float>(
        LinearToSrgb(m[0] * linear[0] + m[1] * linear[1] + m[2] * linear[2]));
  }
  return rgb;
}

MapView::MapView(const metrics::QualityMap& map, int width, int height,
                 std::span<const PlanePair> planes)
    : width_(width), height_(height) {
  source_.kind = decoded_.kind = map.kind;
  source_.to_rec709 = decoded_.to_rec709 = map.to_rec709;
  source_.same_space = decoded_.same_space = map.to_rec709 == kIdentity3;
  source_.channels = decoded_.channels = std::min(map.channels, 4);
  for (size_t c = 0; c < static_cast<size_t>(source_.channels); ++c) {
    source_.planes[c] = planes[c].reference;
    source_.constants[c] = planes[c].reference_constant;
    decoded_.planes[c] = planes[c].test;
    decoded_.constants[c] = planes[c].test_constant;
  }
}

PictureTriple MapView::Reduce(int longest, ThreadPool& pool) const {
  const int longer = std::max(width_, height_);
  const auto reduced = [&](int side) {
    return longer <= longest ? side
                             : std::max(1, static_cast<int>(int64_t{side} * longest / longer));
  };
  const int width = reduced(width_), height = reduced(height_);
  PictureTriple triple;
  triple.source = triple.decoded = triple.difference = MakeImage(width, height);
  pool.ParallelFor(height, [&](int y, int) {
    const int y0 = static_cast<int>(int64_t{y} * height_ / height);
    const int y1 = std::max(y0 + 1, static_cast<int>(int64_t{y + 1} * height_ / height));
    for (int x = 0; x < width; ++x) {
      const int x0 = static_cast<int>(int64_t{x} * width_ / width);
      const int x1 = std::max(x0 + 1, static_cast<int>(int64_t{x + 1} * width_ / width));
      Rgb a{}, b{}, d{};
      for (int sy = y0; sy < y1; ++sy) {
        for (int sx = x0; sx < x1; ++sx) {
          const Rgb s = source_.Shown(sx, sy);
          const Rgb t = decoded_.Shown(sx, sy);
          for (size_t c = 0; c < 3; ++c) {
            a[c] += s[c];
            b[c] += t[c];
            d[c] += std::fabs(s[c] - t[c]);
          }
        }
      }
      const float scale = 1.0f / static_cast<float>((y1 - y0) * (x1 - x0));
      const size_t at = (static_cast<size_t>(y) * width + x) * 3;
      for (size_t c = 0; c < 3; ++c) {
        triple.source.rgb[at + c] = a[c] * scale;
        triple.decoded.rgb[at + c] = b[c] * scale;
        triple.difference.rgb[at + c] = kSheetDifferenceGain * d[c] * scale;
      }
    }
  });
  return triple;
}

PicturePair MapView::Detail(int side) const {
  const int width = std::min(width_, side), height = std::min(height_, side);
  const int left = (width_ - width) / 2, top = (height_ - height) / 2;
  PicturePair pair{MakeImage(width, height), MakeImage(width, height)};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Rgb s = source_.Shown(left + x, top + y);
      const Rgb t = decoded_.Shown(left + x, top + y);
      const size_t at = (static_cast<size_t>(y) * width + x) * 3;
      std::copy(s.begin(), s.end(), pair.source.rgb.begin() + static_cast<std::ptrdiff_t>(at));
      std::copy(t.begin(), t.end(), pair.decoded.rgb.begin() + static_cast<std::ptrdiff_t>(at));
    }
  }
  return pair;
}

}  // namespace patina
