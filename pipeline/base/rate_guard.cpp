#include "pipeline/base/rate_guard.h"

#include <cstdio>
#include <string>

namespace patina {

Status RateGuard::RolledBack(double samples) {
  factor_ *= kLowering;
  since_saved_ = 0;
  if (++rollbacks_ < kMaxRollbacks) return {};
  char text[256];
  std::snprintf(text, sizeof text,
                "the training was given up after %d rollbacks, %.0f samples in: it runs into values that are not finite "
                "even with rates lowered to %.0e; look for enormous values in the source, or bring its range down",
                rollbacks_, samples, factor_);
  return Fail(ErrorCode::kOutOfRange, text);
}

}  // namespace patina
