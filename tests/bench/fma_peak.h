// The machine's own fused multiply-add rate, as the ceiling that the kernels are held against.
#pragma once

namespace patina {

inline constexpr int kFmaChains =
    12;  // independent vector chains: enough to hide the latency of two units

// Runs kFmaChains * iterations vector multiply-adds of the target's full width; returns a value to
// keep them alive.
double FmaLoopAvx2(long iterations);
double FmaLoopAvx512(long iterations);
inline constexpr int kLanesAvx2 = 8, kLanesAvx512 = 16;

}  // namespace patina
