// The tables of kernels, one file for each kind of medium so that they compile side by side.
#pragma once

#include "pipeline/layered/prepared_stack.h"

namespace patina::layered {

// [deep][0 smooth, 1 rough, 2 anisotropic][colour]
struct KernelTable {
  EstimateKernel kernel[2][3][2];
};
extern const KernelTable kClearKernels;
extern const KernelTable kAbsorbingKernels;
extern const KernelTable kScatteringKernels;

}  // namespace patina::layered
