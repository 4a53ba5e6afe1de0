#include "pipeline/layered/prepared_stack.h"

#include "pipeline/layered/effect_kernels.h"
#include "pipeline/layered/walk.inl"

namespace patina::layered {
namespace {

// All effects, without connections. Two kernels serve every stack: exits are asked for by tests and
// tables of energy only.
template <bool diffuse_base>
struct ExitEffects {
  static constexpr bool kDeep = true, kRough = true, kAnisotropic = true, kAbsorption = true,
                        kScattering = true, kColour = true, kConnect = false,
                        kDiffuseBase = diffuse_base;
};

PreparedSurface PrepareSurface(const Roughness& roughness) {
  PreparedSurface surface;
  surface.smooth = roughness.smooth();
  surface.ggx = {std::max(roughness.x, kMinRoughness), std::max(roughness.y, kMinRoughness)};
  if (roughness.anisotropic()) {
    const double turns = roughness.rotation_rad / (2 * kPi);
    SinCosTurns(turns - std::floor(turns), &surface.sin_turn, &surface.cos_turn);
  }
  return surface;
}

bool Differ(const double v[3]) { return v[0] != v[1] || v[1] != v[2]; }

PreparedMedium PrepareMedium(const Layer& layer, Effects* effects) {
  PreparedMedium medium;
  medium.thickness = layer.thickness;
  medium.asymmetry = layer.asymmetry;
  for (int c = 0; c < 3; ++c) {
    medium.scattering[c] = layer.thickness > 0 ? layer.scattering[c] : 0;
    medium.extinction[c] = medium.scattering[c] + (layer.thickness > 0 ? layer.absorption[c] : 0);
    medium.mean_extinction += medium.extinction[c] / 3;
    medium.scatters = medium.scatters || medium.scattering[c] > 0;
    medium.extinguishes = medium.extinguishes || medium.extinction[c] > 0;
    if (medium.extinction[c] > medium.scattering[c]) effects->absorption = true;
  }
  effects->scattering = effects->scattering || medium.scatters;
  effects->colour = effects->colour || Differ(medium.extinction) || Differ(medium.scattering);
  return medium;
}

PreparedPart PreparePart(const BasePart& given, double ior_above, Effects* effects) {
  PreparedPart part;
  part.kind = given.kind;
  part.weight = given.weight;
  double reflected = 0;
  for (int c = 0; c < 3; ++c) {
    part.albedo[c] = given.albedo[c];
    part.eta[c] = given.eta[c] / ior_above;
    part.k[c] = given.k[c] / ior_above;
    reflected += given.kind == BaseKind::kDiffuse ? part.albedo[c]
                                                  : FresnelConductor(1, part.eta[c], part.k[c]);
  }
  // What reflects little is still sampled, since its lobe may be where nothing else is.
  part.share = part.weight * std::max(reflected / 3, 0.05);
  if (given.kind == BaseKind::kDiffuse) {
    effects->colour = effects->colour || Differ(part.albedo);
  } else {
    part.surface = PrepareSurface(given.roughness);
    effects->colour = effects->colour || Differ(part.eta) || Differ(part.k);
    effects->anisotropic = effects->anisotropic || given.roughness.anisotropic();
  }
  for (double& albedo : part.albedo) albedo *= part.weight;
  return part;
}

}  // namespace

PreparedStack Prepare(const Stack& stack) {
  PreparedStack prepared;
  prepared.layers = static_cast<int>(stack.layers.size());
  Effects& effects = prepared.effects;
  effects.deep = prepared.layers > 1;
  double above = 1;
  for (int i = 0; i < prepared.layers; ++i) {
    const Layer& layer = stack.layers[static_cast<size_t>(i)];
    PreparedInterface& interface = prepared.interfaces[i];
    interface.eta = layer.ior / above;
    interface.surface = PrepareSurface(layer.roughness);
    // Without a change of the index there is nothing for facets to refract.
    if (layer.ior == above) interface.surface.smooth = true;
    if (!interface.surface.smooth) {
      effects.rough = true;
      effects.anisotropic = effects.anisotropic || layer.roughness.anisotropic();
    }
    prepared.media[i] = PrepareMedium(layer, &effects);
    above = layer.ior;
  }
  double shares = 0;
  for (const BasePart& part : stack.parts) {
    if (!(part.weight > 0)) continue;
    prepared.base[prepared.parts] = PreparePart(part, above, &effects);
    shares += prepared.base[prepared.parts++].share;
  }
  for (int p = 0; p < prepared.parts; ++p) prepared.base[p].share /= shares;
  return prepared;
}

EstimateKernel KernelFor(const Effects& effects) {
  const KernelTable& table = effects.scattering   ? kScatteringKernels
                             : effects.absorption ? kAbsorbingKernels
                                                  : kClearKernels;
  const int roughness = effects.anisotropic ? 2 : effects.rough ? 1 : 0;
  return table.kernel[effects.deep ? 1 : 0][roughness][effects.colour ? 1 : 0];
}

void EvaluateBareBase(const PreparedStack& stack, const Vec& wi, const Vec& wo, double f[3]) {
  Kernel<ExitEffects<false>>::EvaluateBase(stack, wi, wo, f);
  for (int c = 0; c < 3; ++c) f[c] /= wo.z;
}

Exit WalkOnce(const PreparedStack& stack, const Vec& w, Rng* rng) {
  return stack.diffuse_base() ? Kernel<ExitEffects<true>>::WalkAlone(stack, w, rng)
                              : Kernel<ExitEffects<false>>::WalkAlone(stack, w, rng);
}

}  // namespace patina::layered
