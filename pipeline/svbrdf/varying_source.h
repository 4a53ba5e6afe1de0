// Where a spatially varying BRDF is learned from: measured images, or a model whose numbers are
// maps.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/svbrdf/texel_pool.h"

namespace patina::svbrdf {

// A light and a view, unit vectors as in SetImage.
struct DirectionPair {
  brdf::Direction light, view;
  std::string name;  // for reports
};

struct TexelPlace {
  int x = 0, y = 0;
};

// Immutable; all functions may be called by several threads at once.
class VaryingSource {
 public:
  virtual ~VaryingSource() = default;

  virtual int width() const = 0;  // of level 0
  virtual int height() const = 0;
  virtual AddressMode address() const = 0;
  // Whether f is reciprocal and no azimuth but the one between the directions counts, everywhere.
  virtual bool isotropic() const = 0;
  // Texels a side that Values may be asked for at once without taking long.
  virtual int plane_side() const = 0;

  // Training samples. Errors: those of what is read on the way; kCancelled.
  virtual Result<TexelPool> Draw(const TexelPoolOptions& options, ThreadPool& pool) const = 0;
  // How many are worth drawing for a training of `trained` samples on a texture of `texels` texels
  // on all levels.
  virtual size_t SamplesWorth(size_t trained, size_t texels) const = 0;

  // What it is measured at: images, or pairs that stand for all; at least one.
  virtual const std::vector<DirectionPair>& pairs() const = 0;
  // Up to three of them that are shown, indices into pairs().
  virtual std::vector<size_t> planes() const = 0;
  // f of texels of level 0 under one of the pairs: [texel][red, green, blue]. Errors: as Draw.
  virtual Result<std::vector<float>> Values(size_t pair, std::span<const TexelPlace> texels,
                                            ThreadPool& pool) const = 0;
};

}  // namespace patina::svbrdf
