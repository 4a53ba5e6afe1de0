// The contact sheet of a container: for each map the source, what the container decodes to, and
// their difference.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "pipeline/base/thread_pool.h"
#include "pipeline/metrics/quality.h"

namespace patina {

// An image for a person: sRGB-coded, row-major, three interleaved channels in [0,1].
struct RgbImage {
  int width = 0;
  int height = 0;
  std::vector<float> rgb;
};

// Collects small pictures of mip 0 while it is in memory, and lays them out once the measures are
// known. Columns: source, decoded and difference (times kDifferenceGain) reduced to at most kTile
// texels a side, then source and decoded texel for texel from the middle of the texture.
class Preview {
 public:
  static constexpr int kTile = 192;
  static constexpr float kDifferenceGain = 8;

  // planes: those of `maps` in order, as QualityMeter::AddLevel takes them, of mip 0.
  void Capture(std::span<const metrics::QualityMap> maps, int width, int height,
               std::span<const metrics::PlanePair> planes, ThreadPool& pool);

  // The sheet. labels: one for each map of Capture.
  RgbImage Compose(const std::string& title, std::span<const std::string> labels) const;

 private:
  struct Row {
    RgbImage source, decoded, difference, source_detail, decoded_detail;
  };
  std::vector<Row> rows_;
};

}  // namespace patina
