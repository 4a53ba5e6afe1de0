// A KernelTable of one kind of medium; see effect_kernels.h.
#pragma once

#include "pipeline/layered/effect_kernels.h"
#include "pipeline/layered/walk.inl"

namespace patina::layered {

template <bool deep, int roughness, bool absorption, bool scattering, bool colour,
          bool diffuse_base>
struct EffectSet {
  static constexpr bool kDeep = deep;
  static constexpr bool kRough = roughness > 0;
  static constexpr bool kAnisotropic = roughness > 1;
  static constexpr bool kAbsorption = absorption;
  static constexpr bool kScattering = scattering;
  static constexpr bool kColour = colour;
  static constexpr bool kConnect = true;
  static constexpr bool kDiffuseBase = diffuse_base;
};

// The base is looked at once for all paths: a walk over a diffuse one that also has the code of
// mixtures and conductors takes a tenth longer, for what it then keeps in memory.
template <bool deep, int roughness, bool absorption, bool scattering, bool colour>
void EstimateOverBase(const PreparedStack& stack, const Vec& wi, const Vec& wo, int paths, Rng* rng,
                      double sum[3], double squares[3]) {
  if (stack.diffuse_base()) {
    Kernel<EffectSet<deep, roughness, absorption, scattering, colour, true>>::Estimate(
        stack, wi, wo, paths, rng, sum, squares);
  } else {
    Kernel<EffectSet<deep, roughness, absorption, scattering, colour, false>>::Estimate(
        stack, wi, wo, paths, rng, sum, squares);
  }
}

template <bool deep, int roughness, bool absorption, bool scattering, bool colour>
inline constexpr EstimateKernel kKernel =
    &EstimateOverBase<deep, roughness, absorption, scattering, colour>;

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
