// Random places in a texture and its mips to learn from.
#pragma once

#include <vector>

#include "pipeline/base/rng.h"

namespace patina::svbrdf {

// Levels are drawn by their share of the texels, small ones more often; half of the places lie on
// texel centres of a level, the others anywhere between it and the next.
class PlaceDrawer {
 public:
  PlaceDrawer(int width, int height, int levels);

  // Texture coordinates u, v and the level s.
  void Draw(Rng* rng, float* u, float* v, float* s) const;

 private:
  int width_, height_, levels_;
  std::vector<double> shares_;  // cumulative
};

}  // namespace patina::svbrdf
