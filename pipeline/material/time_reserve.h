// How much of a job's time budget is needed for what follows the training.
#pragma once

#include "pipeline/material/feature_store.h"
#include "pipeline/material/target_pyramid.h"

namespace patina {

// Everything is counted in samples of training, whose rate this machine shows from the first steps on: constants in seconds
// would be those of another machine.
class TimeReserve {
 public:
  // `encodes`: full encodes of all blocks during the training, 0 for the quick export. `tune_samples`: trained after it.
  TimeReserve(const MaterialReference& reference, const FeatureStore& store, int encodes, double tune_samples, int threads);

  // A training step, and an encode during the training: what they took.
  void CountStep(double samples, double seconds);
  void CountEncode(double seconds);

  // Wall seconds that the job still takes when training ends now and goes through all encodes to come.
  double Seconds() const;

 private:
  int encodes_left_;
  bool quick_;
  double encode_samples_ = 0;
  double later_samples_ = 0;
  double last_encode_s_ = 0;
  double recent_samples_, recent_s_;  // steps of about the last kHorizonS
};

}  // namespace patina
