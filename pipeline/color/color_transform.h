// Conversions of rows of colours, whoever does the arithmetic.
#pragma once

#include <cstddef>
#include <memory>

#include "pipeline/color/color_tag.h"
#include "pipeline/color/primaries.h"

namespace patina {

// A fixed conversion of RGB. Safe from any thread; a pixel gives the same bits in any row.
class ColorTransform {
 public:
  virtual ~ColorTransform() = default;

  // Converts planes of `count` floats in place. A pixel with a NaN or an infinity becomes NaN in
  // all three; finite ones may still leave the range of floats.
  void Apply(float* r, float* g, float* b, size_t count) const;

 private:
  // At most kRun pixels, all finite.
  virtual void Convert(float* r, float* g, float* b, size_t count) const noexcept = 0;

 protected:
  static constexpr size_t kRun = 1024;
};
using ColorTransformPtr = std::shared_ptr<const ColorTransform>;

// Whether it makes twice as much of twice as much grey: of linear light, to linear light.
bool IsProportional(const ColorTransform& transform);

// Curve, then matrix. nullptr if the primaries span no triangle.
ColorTransformPtr TransformFromTag(const TransferCurve& curve, const Primaries& from,
                                   const Primaries& to);

}  // namespace patina
