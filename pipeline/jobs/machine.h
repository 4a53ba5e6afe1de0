// What the machine and this process say about themselves (Linux).
#pragma once

#include <cstdint>
#include <string>

namespace patina {

// The CPU's name as the kernel gives it; "unknown" if it does not.
std::string CpuName();

// The most memory this process has had resident since it began, or since the last ResetPeakMemory
// that worked. 0 if the kernel does not say.
uint64_t PeakMemoryBytes();
void ResetPeakMemory();

// CPUs that this process may run on, at least 1.
int UsableCpus();

}  // namespace patina
