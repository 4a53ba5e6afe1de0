// One mip of a map as pictures: the source, what is decoded, and how they differ.
#pragma once

#include <array>
#include <span>

#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/sheet.h"
#include "pipeline/metrics/quality.h"

namespace patina {

struct PicturePair {
  RgbImage source, decoded;
};
struct PictureTriple {
  RgbImage source, decoded;
  RgbImage difference;  // |source - decoded| of the shown values, times kSheetDifferenceGain
};

// Views one mip of a map, which must outlive it.
class MapView {
 public:
  // planes: those of the map, as QualityMeter::AddLevel takes them.
  MapView(const metrics::QualityMap& map, int width, int height,
          std::span<const metrics::PlanePair> planes);

  // The whole mip, each pixel the mean of its texels, reduced to at most `longest` pixels a side.
  PictureTriple Reduce(int longest, ThreadPool& pool) const;
  // Texel for texel from the middle, at most `side` a side.
  PicturePair Detail(int side) const;

 private:
  using Rgb = std::array<float, 3>;

  // One side (reference or test) of the channels.
  struct Side {
    std::array<metrics::PlanarView, 4> planes{};
    std::array<float, 4> constants{};
    int channels = 0;
    metrics::MapKind kind = metrics::MapKind::kData;
    Matrix3 to_rec709 = kIdentity3;
    bool same_space = true;

    float Coded(int channel, int x, int y) const;
    // As a person is to see it: sRGB-coded.
    Rgb Shown(int x, int y) const;
  };

  int width_, height_;
  Side source_, decoded_;
};

}  // namespace patina
