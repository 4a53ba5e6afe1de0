// A set of measured images as a source of spatially varying reflectance.
#pragma once

#include <utility>
#include <vector>

#include "pipeline/svbrdf/image_set.h"
#include "pipeline/svbrdf/varying_source.h"

namespace patina::svbrdf {

class ImageSetSource : public VaryingSource {
 public:
  explicit ImageSetSource(ImageSet set);

  const ImageSet& set() const { return set_; }

  int width() const override { return set_.width; }
  int height() const override { return set_.height; }
  AddressMode address() const override { return set_.address; }
  bool isotropic() const override { return false; }
  int plane_side() const override { return kMaxSetSide; }
  Result<TexelPool> Draw(const TexelPoolOptions& options, ThreadPool& pool) const override {
    return DrawTexels(set_, options, pool);
  }
  size_t SamplesWorth(size_t trained, size_t texels) const override;
  const std::vector<DirectionPair>& pairs() const override { return pairs_; }
  // Those whose steeper direction is the nearest to the normal, the median, and the farthest; fewer
  // of sets that have fewer.
  std::vector<size_t> planes() const override;
  Result<std::vector<float>> Values(size_t pair, std::span<const TexelPlace> texels,
                                    ThreadPool& pool) const override;

 private:
  ImageSet set_;
  std::vector<DirectionPair> pairs_;
};

}  // namespace patina::svbrdf
