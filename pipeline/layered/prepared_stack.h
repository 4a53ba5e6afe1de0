// A stack as the kernels read it, and the kernels of each set of effects.
#pragma once

#include <cstdint>

#include "formats/layered/layered_stack.h"
#include "pipeline/base/rng.h"
#include "pipeline/layered/microfacet.h"

namespace patina::layered {

// What a kernel can simulate. Each effect is a compile-time constant of a kernel.
struct Effects {
  bool deep = false;         // more than one layer
  bool rough = false;        // a dielectric surface that is not smooth
  bool anisotropic = false;  // a surface with an azimuth of its own; implies `rough` of kernels
  bool absorption = false;   // light is lost in a layer
  bool scattering = false;   // implies `absorption` of kernels
  bool colour = false;       // three channels differ

  bool operator==(const Effects&) const = default;
};

// A surface, in its frame: turned by (cos_turn, sin_turn) about z.
struct PreparedSurface {
  Ggx ggx;
  double cos_turn = 1, sin_turn = 0;
  bool smooth = false;
};

struct PreparedInterface {
  PreparedSurface surface;
  double eta = 1;  // index below over index above
};

struct PreparedMedium {
  double thickness = 0;
  double extinction[3] = {0, 0, 0};
  double scattering[3] = {0, 0, 0};
  double mean_extinction = 0;  // of the channels
  double asymmetry = 0;
  bool extinguishes = false;
  bool scatters = false;
};

struct PreparedPart {
  BaseKind kind = BaseKind::kDiffuse;
  double weight = 0;
  double share = 1;  // of the samples
  double albedo[3] = {0, 0, 0};  // times the weight
  double eta[3] = {1, 1, 1}, k[3] = {0, 0, 0};  // relative to the last layer
  PreparedSurface surface;
};

struct PreparedStack {
  int layers = 0;
  PreparedInterface interfaces[kMaxLayers];  // [i]: on top of media[i]
  PreparedMedium media[kMaxLayers];
  int parts = 0;  // of the base; 0: black
  PreparedPart base[kMaxParts];
  Effects effects;

  bool diffuse_base() const { return parts == 1 && base[0].kind == BaseKind::kDiffuse; }
};

// The stack must be valid (CheckStack).
PreparedStack Prepare(const Stack& stack);

// Where and how a walk left the stack.
struct Exit {
  bool left = false;    // false: absorbed
  bool smooth = false;  // only smooth surfaces were met: it left in the one direction possible
  Vec direction;        // away from the surface, z > 0
  double weight[3] = {0, 0, 0};
  int events = 0;  // surfaces met and scatterings
};

// Adds `paths` unbiased estimates of f(wi, wo) and their squares, one after the other from one
// generator. Both directions of unit length and above the horizon; at least one layer.
using EstimateKernel = void (*)(const PreparedStack& stack, const Vec& wi, const Vec& wo, int paths,
                                Rng* rng, double sum[3], double squares[3]);

// The kernel that simulates these effects and the fewest others.
EstimateKernel KernelFor(const Effects& effects);

// f of the bare base, exactly; smooth parts add nothing.
void EvaluateBareBase(const PreparedStack& stack, const Vec& wi, const Vec& wo, double f[3]);

// A walk without connections from the direction w: its exits are distributed such that the mean of
// weight over those in a solid angle is the share of the light from w that leaves there, including
// what smooth surfaces reflect.
Exit WalkOnce(const PreparedStack& stack, const Vec& w, Rng* rng);

}  // namespace patina::layered
