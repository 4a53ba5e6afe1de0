// Which instruction set the kernels run on.
#pragma once

#include <string>

#include "formats/base/result.h"

namespace patina {

enum class SimdTarget { kAvx2, kAvx512 };

const char* SimdTargetName(SimdTarget target);  // "avx2", "avx512"
bool SimdTargetSupported(SimdTarget target);

// The best target of this CPU, or the one named by ForceSimdTarget or by the environment variable PATINA_SIMD.
// Errors: kInvalidArgument for an unknown name, kUnsupported when the CPU lacks it (or lacks AVX2 altogether).
Result<SimdTarget> ActiveSimdTarget();

// "avx2", "avx512" or "auto"; overrides the environment. For the command line and for tests.
Status ForceSimdTarget(const std::string& name);

}  // namespace patina
