#include "pipeline/material/window_kernels.h"

#include <array>

#include "formats/bc6h.h"
#include "pipeline/material/partition_masks.h"

namespace patina {
namespace {

std::array<uint32_t, bc6h::kPartitionCount> MakeMasks() {
  std::array<uint32_t, bc6h::kPartitionCount> masks{};
  for (int p = 0; p < bc6h::kPartitionCount; ++p) masks[p] = bc6h::PartitionMask(p);
  return masks;
}

const std::array<uint32_t, bc6h::kPartitionCount> kMasks = MakeMasks();

}  // namespace

const uint32_t* const kPartitionMasks = kMasks.data();

namespace simd_avx2 {
extern const MaterialKernels kKernels;
}
namespace simd_avx512 {
extern const MaterialKernels kKernels;
}

const MaterialKernels& KernelsFor(SimdTarget target) {
  return target == SimdTarget::kAvx512 ? simd_avx512::kKernels : simd_avx2::kKernels;
}

}  // namespace patina
