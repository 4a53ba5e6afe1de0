// The contact sheet of a container: for each map the source, what the container decodes to, and
// their difference.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/map_picture.h"
#include "pipeline/jobs/sheet.h"
#include "pipeline/metrics/quality.h"

namespace patina {

// Collects small pictures of mip 0 while it is in memory, and lays them out once the measures are
// known. Columns: source, decoded and difference (times kSheetDifferenceGain) reduced to at most
// kTile texels a side, then source and decoded texel for texel from the middle of the texture.
class Preview {
 public:
  static constexpr int kTile = kSheetTile;

  // planes: those of `maps` in order, as QualityMeter::AddLevel takes them, of mip 0.
  void Capture(std::span<const metrics::QualityMap> maps, int width, int height,
               std::span<const metrics::PlanePair> planes, ThreadPool& pool);

  // The sheet. labels: one for each map of Capture.
  RgbImage Compose(const std::string& title, std::span<const std::string> labels) const;

 private:
  struct Row {
    PictureTriple whole;
    PicturePair detail;
  };
  std::vector<Row> rows_;
};

}  // namespace patina
