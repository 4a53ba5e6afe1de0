// A model whose numbers are maps as a source of spatially varying reflectance: f at any pair of
// directions, place and level. Coarser levels are means of f over the texels below them: filtered
// reflectance, not the reflectance of filtered numbers.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "pipeline/layered/simulator.h"
#include "pipeline/svbrdf/footprint.h"
#include "pipeline/svbrdf/texel_model.h"
#include "pipeline/svbrdf/varying_source.h"

namespace patina::svbrdf {

// Maps of more texels a side are learned from a mip of so many at the most: what trains is many
// times as large as the maps.
inline constexpr int kMaxModelledSide = 1024;

struct ModelledOptions {
  layered::Accuracy learned;         // of samples to learn from
  layered::Accuracy measured;        // of what is compared with
  size_t samples = size_t{1} << 20;  // worth drawing
  uint64_t seed = 1;
};

class ModelledSource : public VaryingSource {
 public:
  ModelledSource(std::shared_ptr<const TexelModel> model, const ModelledOptions& options);

  int width() const override { return std::max(1, model_->width() >> first_mip_); }
  int height() const override { return std::max(1, model_->height() >> first_mip_); }
  AddressMode address() const override { return model_->address(); }
  bool isotropic() const override { return model_->isotropic(); }
  int plane_side() const override { return model_->exact() ? 512 : 96; }
  Result<TexelPool> Draw(const TexelPoolOptions& options, ThreadPool& pool) const override;
  size_t SamplesWorth(size_t trained, size_t texels) const override;
  const std::vector<DirectionPair>& pairs() const override { return pairs_; }
  std::vector<size_t> planes() const override { return {0, 1, 2}; }
  Result<std::vector<float>> Values(size_t pair, std::span<const TexelPlace> texels,
                                    ThreadPool& pool) const override;

  // Of texels of the model, with levels down to `levels` of the source.
  FootprintFinder Finder(int levels) const {
    return {model_->width(), model_->height(), first_mip_ + levels, model_->address()};
  }
  // A lookup at level s of the source, in a Finder.
  Footprint FootprintAt(const FootprintFinder& finder, float u, float v, float s) const {
    return finder.At(u, v, s + static_cast<float>(first_mip_));
  }
  // f of a footprint: exactly where the model is exact and the footprint small, else the mean of
  // random draws, each of a texel of the footprint.
  layered::Estimate Estimate(const FootprintFinder& finder, const Footprint& footprint,
                             const brdf::Direction& wi, const brdf::Direction& wo,
                             const layered::Accuracy& accuracy, Rng* rng) const;

 private:
  std::vector<float> StartOf(int levels, int features, ThreadPool& pool) const;

  std::shared_ptr<const TexelModel> model_;
  int first_mip_ = 0;  // of the model's texels: level 0 of the source
  ModelledOptions options_;
  std::vector<DirectionPair> pairs_;
};

}  // namespace patina::svbrdf
