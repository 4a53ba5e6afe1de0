#include "pipeline/layered/kernel_table.inl"

namespace patina::layered {

const KernelTable kScatteringKernels = MakeKernels<true, true>();

}  // namespace patina::layered
