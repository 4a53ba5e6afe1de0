#include "pipeline/brdf/grouping.h"

#include <algorithm>
#include <cmath>

#include "formats/brdf/angles.h"
#include "pipeline/brdf/train_brdf.h"

namespace patina::brdf {
namespace {

// log(1 + f) of three channels on a fixed grid of angles; 0 where there is no data.
std::vector<double> Looks(const Source& source) {
  constexpr int kHalf = 12, kDifference = 6, kAzimuths = 6;
  std::vector<double> looks;
  for (int h = 0; h < kHalf; ++h) {
    const double u = (h + 0.5) / kHalf;
    for (int d = 0; d < kDifference; ++d) {
      for (int a = 0; a < kAzimuths; ++a) {
        Direction wi, wo;
        FromHalfDifference(u * u * static_cast<double>(kHalfPi),
                           (d + 0.5) / kDifference * static_cast<double>(kHalfPi),
                           (a + 0.5) / kAzimuths * static_cast<double>(kPi), &wi, &wo);
        float rgb[3] = {0, 0, 0};
        if (wi.z > 0 && wo.z > 0) source.table->Evaluate(wi, wo, rgb);
        for (const float f : rgb)
          looks.push_back(std::log1p(std::max(0.0, static_cast<double>(f))));
      }
    }
  }
  return looks;
}

double Distance(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum);
}

// Groups of sources of one kind, appended.
void GroupKind(std::span<const Source* const> sources, std::vector<size_t> left, size_t most,
               std::vector<std::vector<size_t>>* groups) {
  std::vector<std::vector<double>> looks(sources.size());
  for (const size_t i : left) looks[i] = Looks(*sources[i]);
  while (!left.empty()) {
    const auto total = [&](size_t i) {
      double sum = 0;
      for (const size_t other : left) sum += Distance(looks[i], looks[other]);
      return sum;
    };
    size_t seed = left.front();
    double farthest = -1;
    for (const size_t i : left) {
      const double sum = total(i);
      if (sum > farthest) farthest = sum, seed = i;
    }
    std::stable_sort(left.begin(), left.end(), [&](size_t a, size_t b) {
      return Distance(looks[seed], looks[a]) < Distance(looks[seed], looks[b]);
    });
    const size_t count = std::min(most, left.size());
    std::vector<size_t> group(left.begin(), left.begin() + static_cast<std::ptrdiff_t>(count));
    left.erase(left.begin(), left.begin() + static_cast<std::ptrdiff_t>(count));
    std::sort(group.begin(), group.end());
    std::sort(left.begin(), left.end());
    groups->push_back(std::move(group));
  }
}

}  // namespace

std::vector<std::vector<size_t>> GroupAlike(std::span<const Source* const> sources, size_t most) {
  std::vector<std::vector<size_t>> groups;
  std::vector<size_t> kinds[4];
  for (size_t i = 0; i < sources.size(); ++i) {
    const SourceKind kind = KindOf(*sources[i]);
    if (kind.list) {
      groups.push_back({i});
    } else {
      kinds[(kind.isotropic ? 0 : 1) + (kind.simulated ? 2 : 0)].push_back(i);
    }
  }
  for (std::vector<size_t>& kind : kinds)
    GroupKind(sources, std::move(kind), std::max<size_t>(1, most), &groups);
  std::sort(groups.begin(), groups.end());
  return groups;
}

}  // namespace patina::brdf
