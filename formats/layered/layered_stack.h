// A layered material: flat dielectric layers, with absorption and scattering in them, on a base.
//
// Based on: Guo, Hasan, Zhao 2018 ("Position-free Monte Carlo simulation for arbitrary layered
// BSDFs"), whose configurations these are.
#pragma once

#include <array>
#include <string>
#include <vector>

namespace patina::layered {

using Rgb = std::array<double, 3>;  // linear Rec. 709

// Limits of what a stack may hold.
inline constexpr int kMaxLayers = 8;
inline constexpr int kMaxParts = 4;
inline constexpr double kMaxIor = 10;
inline constexpr double kMaxThickness = 1e6;
inline constexpr double kMaxCoefficient = 1e6;  // 1/length, of absorption and of scattering
inline constexpr double kMaxAsymmetry = 0.99;
// A surface of less roughness is smooth: light is reflected and refracted in one direction only.
inline constexpr double kMinRoughness = 1e-4;

// GGX roughness alpha along the two axes of a surface, which are turned by `rotation_rad` against
// x and y. 0 and 0: smooth; else each at least kMinRoughness and at most 1.
struct Roughness {
  double x = 0, y = 0;
  double rotation_rad = 0;

  bool smooth() const { return x < kMinRoughness && y < kMinRoughness; }
  bool anisotropic() const { return x != y; }
};

// A layer: its upper surface and what is below that. Lengths in any one unit.
struct Layer {
  double ior = 1.5;  // real, at least 1; equal to that above: there is no surface
  Roughness roughness;
  double thickness = 0;
  Rgb absorption = {0, 0, 0};  // per length
  Rgb scattering = {0, 0, 0};
  double asymmetry = 0;  // g of Henyey and Greenstein
};

enum class BaseKind { kDiffuse, kConductor };

// One of the surfaces that a base is a mixture of.
struct BasePart {
  BaseKind kind = BaseKind::kDiffuse;
  double weight = 1;
  Rgb albedo = {0.5, 0.5, 0.5};  // of a diffuse one
  Rgb eta = {1, 1, 1};           // of a conductor: real part of the refractive index
  Rgb k = {0, 0, 0};             // and the imaginary one
  Roughness roughness;           // of a conductor
};

struct Stack {
  std::vector<Layer> layers;    // from the top down; none: the bare base
  std::vector<BasePart> parts;  // of the base, weights sum to at most 1; none: black
};

// Metals by name, each with the index as tabulated at 630, 532 and 465 nm, about what red, green
// and blue see.
struct Metal {
  const char* name;
  Rgb eta, k;
};
const std::vector<Metal>& Metals();

}  // namespace patina::layered
