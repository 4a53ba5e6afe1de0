#include "pipeline/layered/presets.h"

namespace patina::layered {
namespace {

Layer MakeLayer(double ior, double alpha) {
  Layer layer;
  layer.ior = ior;
  layer.roughness = {alpha, alpha, 0};
  return layer;
}

BasePart Diffuse(const Rgb& albedo, double weight) {
  BasePart part;
  part.albedo = albedo;
  part.weight = weight;
  return part;
}

BasePart MetalOf(const char* name, const Roughness& roughness, double weight) {
  BasePart part;
  part.kind = BaseKind::kConductor;
  part.roughness = roughness;
  part.weight = weight;
  for (const Metal& metal : Metals()) {
    if (std::string(name) != metal.name) continue;
    part.eta = metal.eta;
    part.k = metal.k;
  }
  return part;
}

// A stained lacquer on brown wood.
Stack LacqueredWood() {
  Stack stack;
  Layer lacquer = MakeLayer(1.5, 0.08);
  lacquer.thickness = 1;
  lacquer.absorption = {0.05, 0.25, 0.6};
  stack.layers = {lacquer};
  stack.parts = {Diffuse({0.45, 0.25, 0.12}, 1)};
  return stack;
}

// Clear coat over a binder of pigments in which flakes lie. Flakes are facets of two kinds: most
// lie flat, some are tilted; between them there is pigment.
Stack CarPaint() {
  Stack stack;
  const Layer coat = MakeLayer(1.5, 0.05);
  Layer binder = MakeLayer(1.45, 0);
  binder.thickness = 1;
  binder.absorption = {0.9, 0.25, 0.08};
  stack.layers = {coat, binder};
  stack.parts = {MetalOf("aluminium", {0.15, 0.15, 0}, 0.35),
                 MetalOf("aluminium", {0.5, 0.5, 0}, 0.35), Diffuse({0.05, 0.1, 0.35}, 0.3)};
  return stack;
}

Stack CoatedMetal() {
  Stack stack;
  Layer coat = MakeLayer(1.5, 0.1);
  coat.thickness = 1;
  coat.absorption = {0.02, 0.1, 0.4};
  stack.layers = {coat};
  stack.parts = {MetalOf("copper", {0.25, 0.25, 0}, 1)};
  return stack;
}

// Ground glass, a little cloudy, on white paper.
Stack FrostedGlass() {
  Stack stack;
  Layer glass = MakeLayer(1.52, 0.35);
  glass.thickness = 1;
  glass.absorption = {0.06, 0.01, 0.03};
  glass.scattering = {0.5, 0.5, 0.5};
  glass.asymmetry = 0.6;
  stack.layers = {glass};
  stack.parts = {Diffuse({0.9, 0.9, 0.9}, 1)};
  return stack;
}

// Fibres without a surface: a thick slab that scatters forwards, on a darker ground.
Stack Fabric() {
  Stack stack;
  Layer fibres = MakeLayer(1, 0);
  fibres.thickness = 1;
  fibres.scattering = {3.4, 2.2, 2.6};
  fibres.absorption = {0.15, 1.1, 0.8};
  fibres.asymmetry = 0.35;
  stack.layers = {fibres};
  stack.parts = {Diffuse({0.2, 0.05, 0.08}, 1)};
  return stack;
}

// Brushed steel under varnish.
Stack BrushedCoated() {
  Stack stack;
  stack.layers = {MakeLayer(1.5, 0.1)};
  stack.parts = {MetalOf("iron", {0.35, 0.12, 0}, 1)};
  return stack;
}

}  // namespace

const std::vector<Preset>& Presets() {
  static const std::vector<Preset> presets = {
      {"lacquered_wood", "a stained lacquer on a diffuse base", LacqueredWood()},
      {"car_paint", "clear coat and binder over flakes and pigment", CarPaint()},
      {"coated_metal", "tinted varnish on copper", CoatedMetal()},
      {"frosted_glass", "rough cloudy glass on white", FrostedGlass()},
      {"fabric", "a scattering slab without a surface", Fabric()},
      {"brushed_coated", "varnish on brushed steel, anisotropic", BrushedCoated()},
  };
  return presets;
}

}  // namespace patina::layered
