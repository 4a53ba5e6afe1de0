// Which features of a neural texture share a BC6H texture, and in which units.
//
// The network's first layer is linear in the features of a texel, so that they may be replaced by
// any invertible mixture of them. In a block of BC6H the three features of a texel lie on one or
// two lines: little is lost where one of the three matters and the others hardly do.
#pragma once

#include <span>
#include <vector>

namespace patina::svbrdf {

// Features x of a texel as places y of its textures: y = 1 + forward (x - mean), and
// x = mean + backward (y - 1).
struct FeatureBasis {
  std::vector<double> mean;      // [feature]
  std::vector<double> forward;   // [place][feature]
  std::vector<double> backward;  // [feature][place]
};

// Deviation of y in the feature of a texture that matters most.
inline constexpr double kFeatureSpread = 0.25;

// Principal components of the texels in units of the loss, in the order of what they matter: the
// first ones lead a texture each, the others follow in turn, with deviations from kFeatureSpread
// down to a tenth of it by what they matter beside the one that leads. mean, covariance: of the
// texels, [feature] and [feature][feature]; importance: mean product of the loss's derivatives,
// [feature][feature], zeros if none matters. The number of features is a multiple of three.
FeatureBasis PrincipalBasis(std::vector<double> mean, std::span<const double> covariance,
                            std::span<const double> importance);

}  // namespace patina::svbrdf
