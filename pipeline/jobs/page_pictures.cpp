#include "pipeline/jobs/page_pictures.h"

#include <algorithm>
#include <cmath>

#include "pipeline/report/picture.h"

namespace patina {
namespace {

// Values of all pictures together: at eight bits, which noise does not compress, and in Base64.
constexpr double kPageValues = 2.6e6;
// Pixels of a map's pictures of one kind over those of the overview.
constexpr double kAllOverOverview = 1.9;
constexpr double kDetailSide = 0.75;  // sides over that of the overview
constexpr double kCoarseSide = 0.5;
constexpr int kLeastSide = 64;
constexpr int kMostSide = 512;

bool Constant(std::span<const metrics::PlanePair> planes) {
  return std::all_of(planes.begin(), planes.end(), [](const metrics::PlanePair& pair) {
    return pair.reference.data == nullptr && pair.test.data == nullptr;
  });
}

// Side of the overviews: source and decoded in their channels, the difference as one.
int OverviewSide(std::span<const metrics::QualityMap> maps,
                 std::span<const metrics::PlanePair> planes) {
  int values = 0;
  for (const metrics::QualityMap& map : maps) {
    const auto own = planes.first(static_cast<size_t>(map.channels));
    planes = planes.subspan(own.size());
    if (!Constant(own)) values += 2 * (map.channels == 1 ? 1 : 3) + 1;
  }
  if (values == 0) return kMostSide;
  const double side = std::sqrt(kPageValues / (kAllOverOverview * values));
  return std::clamp(static_cast<int>(side), kLeastSide, kMostSide);
}

PictureTriple WithDifference(PicturePair pair) {
  PictureTriple triple{std::move(pair.source), std::move(pair.decoded), {}};
  triple.difference = triple.source;
  for (size_t i = 0; i < triple.difference.rgb.size(); ++i) {
    triple.difference.rgb[i] =
        kSheetDifferenceGain * std::fabs(triple.source.rgb[i] - triple.decoded.rgb[i]);
  }
  return triple;
}

enum class Tone { kColor, kFirst, kLargest };

Result<std::string> Encode(const RgbImage& image, Tone tone, const std::string& scratch) {
  if (image.rgb.empty()) return std::string();
  const int channels = tone == Tone::kColor ? 3 : 1;
  std::vector<float> grey;
  if (tone != Tone::kColor) {
    grey.resize(image.rgb.size() / 3);
    for (size_t i = 0; i < grey.size(); ++i) {
      const float* rgb = image.rgb.data() + 3 * i;
      grey[i] = tone == Tone::kFirst ? rgb[0] : std::max({rgb[0], rgb[1], rgb[2]});
    }
  }
  const float* values = tone == Tone::kColor ? image.rgb.data() : grey.data();
  PATINA_ASSIGN(const std::vector<uint8_t> png,
                EncodePng(scratch, image.width, image.height, channels, values));
  return PngDataUri(png);
}

}  // namespace

Status EncodeTrio(const PictureTriple& pictures, bool grey, const std::string& scratch,
                  PageTrio* trio) {
  const Tone tone = grey ? Tone::kFirst : Tone::kColor;
  PATINA_ASSIGN(trio->source, Encode(pictures.source, tone, scratch + ".s.png"));
  PATINA_ASSIGN(trio->decoded, Encode(pictures.decoded, tone, scratch + ".d.png"));
  PATINA_ASSIGN(trio->difference, Encode(pictures.difference, Tone::kLargest, scratch + ".e.png"));
  trio->width = pictures.decoded.width;
  trio->height = pictures.decoded.height;
  return {};
}

void PagePictures::Capture(int mip, std::span<const metrics::QualityMap> maps, int width,
                           int height, std::span<const metrics::PlanePair> planes,
                           ThreadPool& pool) {
  if (std::find(std::begin(kMips), std::end(kMips), mip) == std::end(kMips)) return;
  const int side = OverviewSide(maps, planes);
  for (size_t m = 0; m < maps.size(); ++m) {
    const auto own = planes.first(static_cast<size_t>(maps[m].channels));
    planes = planes.subspan(own.size());
    if (Constant(own)) continue;
    const MapView view(maps[m], width, height, own);
    Shot shot;
    shot.map = m;
    shot.grey = maps[m].channels == 1;
    shot.trio.map = maps[m].name;
    shot.trio.mip = mip;
    shot.trio.mip_width = width;
    shot.trio.mip_height = height;
    const int longest = mip == 0 ? side : static_cast<int>(kCoarseSide * side);
    shot.pictures = view.Reduce(longest, pool);
    shot.trio.texels = std::max(width, height) <= longest;
    shots_.push_back(shot);
    if (mip != 0 || shot.trio.texels) continue;
    shot.trio.texels = true;
    shot.pictures = WithDifference(view.Detail(static_cast<int>(kDetailSide * side)));
    shots_.push_back(std::move(shot));
  }
}

Result<std::vector<PageTrio>> PagePictures::Encode(const std::string& scratch, ThreadPool& pool) {
  std::stable_sort(shots_.begin(), shots_.end(),
                   [](const Shot& a, const Shot& b) { return a.map < b.map; });
  std::vector<Status> encoded(shots_.size());
  pool.ParallelFor(static_cast<int>(shots_.size()), [&](int i, int) {
    Shot& shot = shots_[static_cast<size_t>(i)];
    encoded[static_cast<size_t>(i)] =
        EncodeTrio(shot.pictures, shot.grey, scratch + std::to_string(i), &shot.trio);
  });
  std::vector<PageTrio> trios;
  for (size_t i = 0; i < shots_.size(); ++i) {
    if (!encoded[i]) return Fail(encoded[i].error());
    trios.push_back(std::move(shots_[i].trio));
  }
  return trios;
}

}  // namespace patina
