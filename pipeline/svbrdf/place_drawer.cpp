#include "pipeline/svbrdf/place_drawer.h"

#include <algorithm>

namespace patina::svbrdf {
namespace {

// The share of samples that a small mip gets at least.
constexpr double kLevelFloor = 0.01;
constexpr float kOffGridShare = 0.5f;

}  // namespace

PlaceDrawer::PlaceDrawer(int width, int height, int levels)
    : width_(width), height_(height), levels_(levels) {
  std::vector<double> texels;
  double all = 0, total = 0;
  for (int l = 0; l < levels; ++l) {
    texels.push_back(static_cast<double>(std::max(1, width >> l)) * std::max(1, height >> l));
    all += texels.back();
  }
  for (const double count : texels) {
    total += std::max(count / all, kLevelFloor);
    shares_.push_back(total);
  }
  for (double& share : shares_) share /= total;
}

void PlaceDrawer::Draw(Rng* rng, float* u, float* v, float* s) const {
  const double pick = static_cast<double>(rng->Uniform());
  int level = 0;
  while (level + 1 < levels_ && pick >= shares_[static_cast<size_t>(level)]) ++level;
  if (rng->Uniform() < kOffGridShare) {
    *u = rng->Uniform();
    *v = rng->Uniform();
    const float fraction = rng->Uniform();
    *s = static_cast<float>(level) + (level + 1 < levels_ ? fraction : 0.0f);
    return;
  }
  const int width = std::max(1, width_ >> level), height = std::max(1, height_ >> level);
  const auto x = static_cast<float>(rng->Below(static_cast<uint32_t>(width)));
  const auto y = static_cast<float>(rng->Below(static_cast<uint32_t>(height)));
  *u = (x + 0.5f) / static_cast<float>(width);
  *v = (y + 0.5f) / static_cast<float>(height);
  *s = static_cast<float>(level);
}

}  // namespace patina::svbrdf
