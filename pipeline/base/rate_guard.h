// What the trainers do when a step gives a value that is not finite: back to the last good state, with lower rates.
#pragma once

#include <cstddef>

#include "formats/base/result.h"

namespace patina {

// Rates of the steps first .. last-1 are multiplied by `scale`. Tests make a training diverge with it; no job sets it.
struct RateFault {
  int first = 0;
  int last = 0;
  double scale = 1;
};

// Counts the steps of a training and its rollbacks, and says when its state is to be saved. Depends on nothing but what it
// is told, so that a training with rollbacks is as reproducible as one without.
class RateGuard {
 public:
  // A rollback lowers all rates to this share; after so many the training is given up: rates are then a trillionth.
  static constexpr double kLowering = 0.25;
  static constexpr int kMaxRollbacks = 20;
  // A state is saved every kMinSteps steps. A large one more rarely: copying it may cost about a hundredth of the steps'
  // time, which is kBytesPerStep for steps of half a millisecond.
  static constexpr int kMinSteps = 64;
  static constexpr size_t kBytesPerStep = 32768;
  // A state is not good if the last step erred so many times more than the first: it may be about to overflow.
  static constexpr double kMaxGrowth = 100;

  explicit RateGuard(const RateFault& fault = {}) : fault_(fault) {}

  // The factor of all rates of the step that comes next.
  double NextFactor() {
    const int step = step_++;
    return step >= fault_.first && step < fault_.last ? factor_ * fault_.scale : factor_;
  }

  // After a good step with this mean error: whether to save the state, of this size, now.
  bool SaveIsDue(double error, size_t state_bytes) {
    if (first_error_ < 0) first_error_ = error;
    const size_t interval = state_bytes / kBytesPerStep > kMinSteps ? state_bytes / kBytesPerStep : kMinSteps;
    if (static_cast<size_t>(++since_saved_) < interval || !(error <= kMaxGrowth * first_error_)) return false;
    since_saved_ = 0;
    return true;
  }

  // A step was undone. kOutOfRange if it was the last that may be. samples: trained on so far, for the message.
  Status RolledBack(double samples);

  int rollbacks() const { return rollbacks_; }

 private:
  RateFault fault_;
  double factor_ = 1;
  double first_error_ = -1;
  int step_ = 0;
  int since_saved_ = 0;
  int rollbacks_ = 0;
};

}  // namespace patina
