// Region-1 masks of the 32 BC6H partitions as a plain array, for kernels.
#pragma once

#include <cstdint>

namespace patina {

// kPartitionMasks[p] == bc6h::PartitionMask(p), as an int for lane masks; filled before main.
extern const uint32_t* const kPartitionMasks;

}  // namespace patina
