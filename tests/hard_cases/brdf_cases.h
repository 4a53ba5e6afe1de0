// BRDFs that are hard to learn, and small trainings of them.
#pragma once

#include <string>
#include <vector>

#include "formats/brdf/brdf_source.h"
#include "pipeline/brdf/train_brdf.h"

namespace patina::test {

struct BrdfCase {
  std::string name;
  std::string why;  // it is hard
  brdf::Source source;
};

brdf::Source OrdinaryBrdf();  // plastic
std::vector<BrdfCase> BrdfCases();

brdf::ModelShape SmallBrdf();
brdf::TrainOptions QuickBrdfTraining();
// An error fails the test.
brdf::TrainedBrdf MustTrainBrdf(const brdf::Source& source, const brdf::TrainOptions& options,
                                int threads);
bool SameBrdf(const brdf::TrainedBrdf& a, const brdf::TrainedBrdf& b);
// All that is written, and the losses.
void ExpectFinite(const brdf::TrainedBrdf& model);

}  // namespace patina::test
