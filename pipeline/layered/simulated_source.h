// A layered material as a source of BRDF data, like a measured one.
#pragma once

#include <memory>
#include <string>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"
#include "pipeline/layered/simulator.h"

namespace patina::layered {

// How much a stack may be simulated. Paths of stacks in which light meets more than eight surfaces
// and particles get less of them, at the price of noise.
struct Effort {
  Accuracy accuracy;  // of values to learn from
  int draft_paths = 24;  // of EvaluateDraft
  uint64_t seed = 1;
};

// The source; `stack` must be valid (CheckStack). Values to learn from are weighted by
// 1 / (1 + (their standard error / 0.05)^2). Mirror images that smooth surfaces make are no part of
// f, which a warning says. Errors: kInvalidArgument, where nothing else is reflected; the message
// names no file.
Result<brdf::Source> SimulatedSource(const Stack& stack, const Effort& effort);

// The same of a file. Errors: those of ReadStack and SimulatedSource.
Result<brdf::Source> OpenSimulated(const std::string& path, const Effort& effort);

}  // namespace patina::layered
