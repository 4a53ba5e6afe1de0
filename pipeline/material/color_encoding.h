// How colours are learned, decided from the values they reach in the working space.
#pragma once

#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/material/map_plan.h"
#include "pipeline/material/reference.h"

namespace patina {

// Logarithms are learned in place of scaled values where the largest |value| of a float map is
// above kMinHdrPeak and more than kMinHdrRange times the median of those that are not 0: then an
// error of one part in a hundred of the largest is more than everything ordinary. Both were
// measured with `patina_hdr_bench`.
inline constexpr float kMinHdrPeak = 4;
inline constexpr float kMinHdrRange = 64;

// Settles encoding and scale of the colour plans of floats, and of those that are converted:
//   kSignedLog as above, with the power of two at the median as scale;
//   kSrgb, of integers, stays unless a colour is below the curve's linear toe, where decoders do
//   not continue it; else kLinear.
// Looks at mip 0 once for each of them. Error: kCorruptData (a conversion gives NaN or infinity).
Status ChooseEncodings(const std::vector<LoadedFile>& files,
                       const std::vector<ReferenceFile>& descriptions, int width, int height,
                       LogEncoding logarithms, ThreadPool& pool, std::vector<MapPlan>* plans);

}  // namespace patina
