// A model of reflectance whose numbers are maps: f at each texel.
#pragma once

#include <cstddef>

#include "formats/brdf/brdf_source.h"
#include "pipeline/base/rng.h"
#include "pipeline/material/target_pyramid.h"

namespace patina::svbrdf {

// Immutable once made; all functions may be called by several threads at once. Texels count row by
// row from the top.
class TexelModel {
 public:
  virtual ~TexelModel() = default;

  virtual int width() const = 0;
  virtual int height() const = 0;
  virtual AddressMode address() const = 0;
  virtual bool isotropic() const = 0;  // as VaryingSource::isotropic
  // Whether a draw is f itself, so that one is enough.
  virtual bool exact() const = 0;

  // Adds up `draws` unbiased estimates of f(wi, wo), 1/sr, of a texel, and their squares. Both
  // directions above the horizon.
  virtual void AddDraws(size_t texel, const brdf::Direction& wi, const brdf::Direction& wo,
                        int draws, Rng* rng, double sum[3], double squares[3]) const = 0;

  // The numbers of a texel: what tells texels apart.
  virtual int numbers() const = 0;
  virtual void Numbers(size_t texel, float* out) const = 0;
};

}  // namespace patina::svbrdf
