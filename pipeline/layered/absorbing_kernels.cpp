#include "pipeline/layered/kernel_table.inl"

namespace patina::layered {

const KernelTable kAbsorbingKernels = MakeKernels<true, false>();

}  // namespace patina::layered
