// Runs that must give the same bytes with any number of threads and on every SIMD target.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <vector>

#include "pipeline/kernels/dispatch.h"

namespace patina::test {

struct Setting {
  int threads = 1;
  SimdTarget target = SimdTarget::kAvx2;
};

// One thread and three, and one on each further target that the CPU has.
inline std::vector<Setting> Settings() {
  const SimdTarget best =
      SimdTargetSupported(SimdTarget::kAvx512) ? SimdTarget::kAvx512 : SimdTarget::kAvx2;
  std::vector<Setting> settings = {{1, best}, {3, best}};
  if (best == SimdTarget::kAvx512) {
    settings.push_back({1, SimdTarget::kAvx2});
  } else {
    static const bool said = std::printf("this CPU has no AVX-512: that target is skipped\n") > 0;
    (void)said;
  }
  return settings;
}

// run(threads) for each setting; same(first, other) for the results. Returns the first.
template <class Run, class Same>
auto Everywhere(Run&& run, Same&& same) {
  const std::vector<Setting> settings = Settings();
  EXPECT_TRUE(ForceSimdTarget(SimdTargetName(settings[0].target)));
  auto first = run(settings[0].threads);
  for (size_t i = 1; i < settings.size(); ++i) {
    EXPECT_TRUE(ForceSimdTarget(SimdTargetName(settings[i].target)));
    EXPECT_TRUE(same(first, run(settings[i].threads)))
        << settings[i].threads << " threads, " << SimdTargetName(settings[i].target);
  }
  EXPECT_TRUE(ForceSimdTarget("auto"));
  return first;
}

}  // namespace patina::test
