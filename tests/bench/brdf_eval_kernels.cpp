#include "tests/bench/brdf_eval_kernels.h"

#include <algorithm>

namespace patina {

namespace simd_avx2 {
extern const bench::PeerKernels kPeerKernels;
}
namespace simd_avx512 {
extern const bench::PeerKernels kPeerKernels;
}

namespace bench {

NbrdfScratch::NbrdfScratch() : outputs(size_t{4} * 16 * kNbrdfChunkTiles) {
  constexpr size_t kSamples = size_t{16} * kNbrdfChunkTiles;
  for (int l = 0; l < kNbrdfLayers; ++l) {
    activations[l].Reset(kNbrdfRows[l] * kSamples);
    gradients[l].Reset(kNbrdfRows[l] * kSamples);
    std::fill_n(activations[l].data() + kNbrdfInputs[l] * kSamples, kSamples, 1.0f);
  }
}

const PeerKernels& PeerKernelsFor(SimdTarget target) {
  return target == SimdTarget::kAvx512 ? simd_avx512::kPeerKernels : simd_avx2::kPeerKernels;
}

}  // namespace bench
}  // namespace patina
