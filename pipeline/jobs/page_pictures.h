// The pictures of a report page: every map at several mips.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/map_picture.h"
#include "pipeline/metrics/quality.h"

namespace patina {

// Three pictures as they stand in the page, as data URIs.
struct PageTrio {
  std::string map;
  int mip = 0;          // of those that are stored
  bool texels = false;  // texel for texel, from the middle of the mip; else all of it
  int mip_width = 0, mip_height = 0;
  int width = 0, height = 0;                // of the pictures
  std::string source, decoded, difference;  // source and difference are empty if there is none
};

class PagePictures {
 public:
  // Mips that are shown, as far as there are so many.
  static constexpr int kMips[] = {0, 2, 4};

  // One mip, as LevelViewer gets it. Pictures become smaller the more maps there are, so that the
  // page stays below three megabytes; maps that are constant on both sides have none.
  void Capture(int mip, std::span<const metrics::QualityMap> maps, int width, int height,
               std::span<const metrics::PlanePair> planes, ThreadPool& pool);

  // Encodes what was captured, in the order of the maps, each from fine to coarse. `scratch` is the
  // beginning of paths for files that are gone afterwards. Errors: those of EncodePng.
  Result<std::vector<PageTrio>> Encode(const std::string& scratch, ThreadPool& pool);

 private:
  struct Shot {
    size_t map = 0;
    bool grey = false;
    PageTrio trio;
    PictureTriple pictures;
  };
  std::vector<Shot> shots_;
};

// A single trio; empty pictures are left out. Errors: those of EncodePng.
Status EncodeTrio(const PictureTriple& pictures, bool grey, const std::string& scratch,
                  PageTrio* trio);

}  // namespace patina
