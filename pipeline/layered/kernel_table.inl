// A KernelTable of one kind of medium; see effect_kernels.h.
#pragma once

#include "pipeline/layered/effect_kernels.h"
#include "pipeline/layered/walk.inl"

namespace patina::layered {

template <bool deep, int roughness, bool absorption, bool scattering, bool colour>
struct EffectSet {
  static constexpr bool kDeep = deep;
  static constexpr bool kRough = roughness > 0;
  static constexpr bool kAnisotropic = roughness > 1;
  static constexpr bool kAbsorption = absorption;
  static constexpr bool kScattering = scattering;
  static constexpr bool kColour = colour;
  static constexpr bool kConnect = true;
};

template <bool deep, int roughness, bool absorption, bool scattering, bool colour>
inline constexpr EstimateKernel kKernel =
    &Kernel<EffectSet<deep, roughness, absorption, scattering, colour>>::Estimate;

template <bool absorption, bool scattering>
constexpr KernelTable MakeKernels() {
  return {{{{kKernel<false, 0, absorption, scattering, false>,
             kKernel<false, 0, absorption, scattering, true>},
            {kKernel<false, 1, absorption, scattering, false>,
             kKernel<false, 1, absorption, scattering, true>},
            {kKernel<false, 2, absorption, scattering, false>,
             kKernel<false, 2, absorption, scattering, true>}},
           {{kKernel<true, 0, absorption, scattering, false>,
             kKernel<true, 0, absorption, scattering, true>},
            {kKernel<true, 1, absorption, scattering, false>,
             kKernel<true, 1, absorption, scattering, true>},
            {kKernel<true, 2, absorption, scattering, false>,
             kKernel<true, 2, absorption, scattering, true>}}}};
}

}  // namespace patina::layered
