// A layered material as a source of BRDF data, like a measured one.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"
#include "pipeline/layered/simulator.h"

namespace patina::layered {

// How much a stack may be simulated. Paths of stacks in which light meets more than eight surfaces
// and particles get less of them, at the price of noise.
struct Effort {
  Accuracy accuracy;     // of values to learn from
  int draft_paths = 24;  // of EvaluateDraft
  uint64_t seed = 1;
};

// What a few walks tell of a stack.
struct Outlook {
  double events = 0;    // surfaces met and scatterings of a walk, mean
  double mirrored = 0;  // share of light that smooth surfaces send in one direction
};
// Errors: kInvalidArgument, where nothing else is reflected; the message names no file.
Result<Outlook> LookAhead(const Simulator& simulator);
std::vector<std::string> WarningsOf(const Outlook& outlook);
Effort ScaledFor(const Outlook& outlook, Effort effort);

// How much a value of that standard error is to count, 0 to 1.
double TrustOf(double standard_error);
// Squared errors are summed as integers: their order, which threads decide, must not count.
uint64_t CountedSquare(double standard_error);
double MeanOfCounted(uint64_t squares, uint64_t pairs);  // root mean square

// The source; `stack` must be valid (CheckStack). Values to learn from are weighted by
// TrustOf their standard error, 1 / (1 + (it / 0.05)^2). Mirror images that smooth surfaces make
// are no part of f, which a warning says. Errors: kInvalidArgument, where nothing else is
// reflected; the message names no file.
Result<brdf::Source> SimulatedSource(const Stack& stack, const Effort& effort);

}  // namespace patina::layered
