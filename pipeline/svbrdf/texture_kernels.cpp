#include "pipeline/svbrdf/texture_kernels.h"

namespace patina {

namespace simd_avx2 {
extern const svbrdf::TextureKernels kTextureKernels;
}
namespace simd_avx512 {
extern const svbrdf::TextureKernels kTextureKernels;
}

namespace svbrdf {

const TextureKernels& TextureKernelsFor(SimdTarget target) {
  return target == SimdTarget::kAvx512 ? simd_avx512::kTextureKernels : simd_avx2::kTextureKernels;
}

}  // namespace svbrdf
}  // namespace patina
