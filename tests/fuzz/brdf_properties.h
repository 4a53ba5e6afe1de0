// What holds for every BRDF that a reader accepts.
#pragma once

#include <cmath>

#include "formats/brdf/brdf_source.h"
#include "tests/formats/brdf/brdf_samples.h"
#include "tests/fuzz/fuzz_target.h"

namespace patina::brdf {

inline void CheckSource(const Result<Source>& source) {
  if (!source) {
    FUZZ_CHECK(!source.error().message.empty() && source.error().code != ErrorCode::kInternal);
    return;
  }
  FUZZ_CHECK(source->invalid_cells <= source->cells);
  for (const Sample& sample : source->samples) {
    FUZZ_CHECK(sample.wi.z > 0 && sample.wo.z > 0 && sample.weight > 0 &&
               std::isfinite(sample.weight));
    for (const float value : sample.rgb) FUZZ_CHECK(std::isfinite(value));
  }
  if (source->table == nullptr) {
    FUZZ_CHECK(!source->samples.empty());
    return;
  }
  for (const double theta_i : {0.0, 40.0, 89.99}) {
    for (const double theta_o : {0.0, 60.0, 90.0}) {
      for (const double phi : {0.0, 77.0, 180.0, 359.9}) {
        float rgb[3];
        const bool valid =
            source->table->Evaluate(FromDegrees(theta_i, 0), FromDegrees(theta_o, phi), rgb);
        for (const float value : rgb) FUZZ_CHECK(std::isfinite(value) && (valid || value == 0));
      }
    }
  }
}

}  // namespace patina::brdf
