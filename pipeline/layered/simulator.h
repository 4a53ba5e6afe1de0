// Simulates the reflectance of a layered material.
//
// Based on: Guo, Hasan, Zhao 2018 ("Position-free Monte Carlo simulation for arbitrary layered
// BSDFs"). The walk and what is done differently: walk.inl. Directions as in brdf_source.h.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/brdf/brdf_source.h"
#include "formats/layered/layered_stack.h"
#include "pipeline/base/rng.h"
#include "pipeline/layered/prepared_stack.h"

namespace patina::layered {

// An unbiased estimate of f, 1/sr, without the cosine, and of its error.
struct Estimate {
  std::array<double, 3> f = {0, 0, 0};
  std::array<double, 3> variance = {0, 0, 0};  // of f; 0 where f is exact
  int paths = 0;                               // that f is the mean of; 0 where it is exact
  int spent = 0;                               // with those that only told how many are needed
};

// When an estimate is good enough, as far as its pilot tells: rare bright paths may be missing
// there, so that single estimates are worse. The error of f is counted as the trainer counts it, as
// that of log(1 + f c), c the larger cosine of the two directions, in the worst channel.
struct Accuracy {
  double standard_error = 0.01;
  int pilot_paths = 32;  // at first; two or more. They say how many f takes, and are no part of it
  int min_paths = 32;    // two or more
  int max_paths = 4096;
};

// Immutable once made; all functions may be called by several threads at once.
class Simulator {
 public:
  // The stack must be valid (CheckStack).
  explicit Simulator(const Stack& stack);

  const Effects& effects() const { return stack_.effects; }
  bool isotropic() const { return !stack_.effects.anisotropic; }
  // Whether Estimate is exact: nothing lies on the base.
  bool closed_form() const { return stack_.layers == 0; }

  // Adds `paths` estimates of f and their squares, one after the other from the generator; nothing
  // unless both directions are above the horizon. What smooth surfaces send in the one direction
  // possible is no part of f.
  void AddPaths(const brdf::Direction& wi, const brdf::Direction& wo, int paths, Rng* rng,
                double sum[3], double squares[3]) const;

  // The mean of `paths` estimates, two or more.
  Estimate Average(const brdf::Direction& wi, const brdf::Direction& wo, int paths,
                   uint64_t seed) const;

  // As many paths as the accuracy asks for. The number follows from a pilot, of a quarter as
  // many at the least, whose paths are not used again, so that the mean stays unbiased. The same
  // for a seed and a pair of directions.
  Estimate Evaluate(const brdf::Direction& wi, const brdf::Direction& wo, const Accuracy& accuracy,
                    uint64_t seed) const;

  // The error of an estimate as `Accuracy` counts it.
  static double StandardError(const Estimate& estimate, const brdf::Direction& wi,
                              const brdf::Direction& wo);

  // One light path from w until it leaves or is absorbed, with what smooth surfaces reflect.
  Exit Walk(const brdf::Direction& w, Rng* rng) const;

  // Importance sampling: a direction wo, and the density of drawing it, from a mixture of the lobes
  // of the uppermost surface, of the base seen through the layers, and of the cosine. u: three
  // numbers in [0, 1). False: the sample is lost, with a chance that the density accounts for.
  bool Sample(const brdf::Direction& wi, const double u[3], brdf::Direction* wo, double* pdf) const;
  // Per solid angle; 0 below the horizon.
  double Pdf(const brdf::Direction& wi, const brdf::Direction& wo) const;

 private:
  struct LobeShares {
    double top, base, cosine;
  };
  LobeShares SharesFor(const Vec& wi) const;

  PreparedStack stack_;
  EstimateKernel kernel_;
  PreparedSurface base_lobe_;  // of the base, as rough as it looks from above
  bool has_base_lobe_ = false;
};

// What a stack's kernel simulates, and what it leaves out, in words.
std::vector<std::string> EffectNames(const Effects& effects);
std::vector<std::string> LeftOutNames(const Effects& effects);

}  // namespace patina::layered
