// How long a container takes to decode on one core.
#pragma once

#include <memory>
#include <string>

#include "formats/base/result.h"

namespace patina {

// Rounds of several timers are taken in turns, so that a machine whose speed drifts treats all alike.
class DecodeTimer {
 public:
  static constexpr int kRounds = 7;

  // container: as OpenContainer takes it. Errors: those of OpenContainer and of the decoders.
  static Result<std::unique_ptr<DecodeTimer>> Open(const std::string& container);
  virtual ~DecodeTimer() = default;

  // Decodes for about 50 milliseconds of this thread's CPU time, which is what is measured.
  virtual void Round() = 0;
  // Nanoseconds of a texel with all its channels (material: rows of mip 0 or the finest stored mip,
  // reference decoder), or of a pair of directions (BRDF: batches, SIMD kernels); the median of the
  // rounds. 0 of a material that has nothing to decode. At least one round first.
  virtual double MedianNs() const = 0;
};

}  // namespace patina
