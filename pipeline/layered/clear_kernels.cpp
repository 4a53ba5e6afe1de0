#include "pipeline/layered/kernel_table.inl"

namespace patina::layered {

const KernelTable kClearKernels = MakeKernels<false, false>();

}  // namespace patina::layered
