#include "pipeline/svbrdf/image_set_source.h"

#include <algorithm>
#include <numeric>

namespace patina::svbrdf {

ImageSetSource::ImageSetSource(ImageSet set) : set_(std::move(set)) {
  for (const SetImage& image : set_.images) pairs_.push_back({image.light, image.view, image.file});
}

std::vector<size_t> ImageSetSource::planes() const {
  std::vector<size_t> order(pairs_.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const auto height = [&](size_t i) { return std::min(pairs_[i].light.z, pairs_[i].view.z); };
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return height(a) > height(b); });
  std::vector<size_t> picked;
  for (const size_t at : {size_t{0}, order.size() / 2, order.size() - 1}) {
    if (std::find(picked.begin(), picked.end(), order[at]) == picked.end())
      picked.push_back(order[at]);
  }
  return picked;
}

size_t ImageSetSource::SamplesWorth(size_t trained, size_t texels) const {
  constexpr size_t kOfATexel = 16;
  return std::min(trained, kOfATexel * set_.images.size() * texels);
}

Result<std::vector<float>> ImageSetSource::Values(size_t pair, std::span<const TexelPlace> texels,
                                                  ThreadPool&) const {
  PATINA_ASSIGN(const PlaneLevel image, ReadSetImage(set_, pair));
  std::vector<float> values;
  values.reserve(3 * texels.size());
  for (const TexelPlace& texel : texels) {
    for (int c = 0; c < 3; ++c) values.push_back(image.Row(c, texel.y)[texel.x]);
  }
  return values;
}

}  // namespace patina::svbrdf
