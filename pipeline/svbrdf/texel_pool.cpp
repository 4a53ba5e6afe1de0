#include "pipeline/svbrdf/texel_pool.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>
#include <utility>

#include "pipeline/base/rng.h"

namespace patina::svbrdf {
namespace {

// The share of samples that a small mip gets at least.
constexpr double kLevelFloor = 0.01;
constexpr float kOffGridShare = 0.5f;

PlaneLevel NextMip(const PlaneLevel& level) {
  PlaneLevel next;
  next.Allocate(NextMipSide(level.width), NextMipSide(level.height), level.planes);
  for (int p = 0; p < level.planes; ++p) {
    for (int y = 0; y < next.height; ++y) {
      float* row = next.Row(p, y);
      std::fill(row, row + next.width, 0.0f);
      const BoxTaps taps = BoxTapsFor(level.height, y);
      for (int k = 0; k < taps.count; ++k)
        AddBoxRow(level.Row(p, taps.first + k), level.width, taps.weight[k], row);
    }
  }
  return next;
}

std::vector<double> LevelShares(const ImageSet& set, int levels) {
  std::vector<double> texels, cumulative;
  double all = 0, total = 0;
  for (int l = 0; l < levels; ++l) {
    texels.push_back(static_cast<double>(std::max(1, set.width >> l)) *
                     std::max(1, set.height >> l));
    all += texels.back();
  }
  for (const double count : texels) {
    total += std::max(count / all, kLevelFloor);
    cumulative.push_back(total);
  }
  for (double& share : cumulative) share /= total;
  return cumulative;
}

class Drawer {
 public:
  Drawer(const ImageSet& set, const TexelPoolOptions& options)
      : set_(set), options_(options), shares_(LevelShares(set, options.levels)) {}

  void Draw(size_t image, const std::vector<PlaneLevel>& mips, size_t count,
            TexelSample* out) const {
    Rng rng(options_.seed, image + 1);
    for (size_t i = 0; i < count; ++i) {
      TexelSample& sample = out[i];
      sample.image = static_cast<uint32_t>(image);
      const double pick = static_cast<double>(rng.Uniform());
      int level = 0;
      while (level + 1 < options_.levels && pick >= shares_[level]) ++level;
      const PlaneLevel& at = mips[level];
      if (rng.Uniform() < kOffGridShare) {
        sample.u = rng.Uniform();
        sample.v = rng.Uniform();
        const float fraction = rng.Uniform();
        sample.s = static_cast<float>(level) + (level + 1 < options_.levels ? fraction : 0.0f);
      } else {
        const auto x = static_cast<float>(rng.Below(static_cast<uint32_t>(at.width)));
        const auto y = static_cast<float>(rng.Below(static_cast<uint32_t>(at.height)));
        sample.u = (x + 0.5f) / static_cast<float>(at.width);
        sample.v = (y + 0.5f) / static_cast<float>(at.height);
        sample.s = static_cast<float>(level);
      }
      const float low = std::floor(sample.s), fraction = sample.s - low;
      AddLevel(mips[static_cast<size_t>(low)], sample.u, sample.v, 1 - fraction, sample.value);
      if (fraction > 0)
        AddLevel(mips[static_cast<size_t>(low) + 1], sample.u, sample.v, fraction, sample.value);
    }
  }

 private:
  void AddLevel(const PlaneLevel& level, float u, float v, float share, float value[3]) const {
    const TexelTap x = TexelTapAt(u, level.width, set_.address);
    const TexelTap y = TexelTapAt(v, level.height, set_.address);
    for (int c = 0; c < 3; ++c) {
      const float *top = level.Row(c, y.a), *bottom = level.Row(c, y.b);
      const float upper = top[x.a] * (1 - x.f) + top[x.b] * x.f;
      const float lower = bottom[x.a] * (1 - x.f) + bottom[x.b] * x.f;
      value[c] += share * (upper * (1 - y.f) + lower * y.f);
    }
  }

  const ImageSet& set_;
  const TexelPoolOptions& options_;
  std::vector<double> shares_;
};

}  // namespace

std::vector<PlaneLevel> MipsOf(PlaneLevel image, int levels) {
  std::vector<PlaneLevel> mips;
  mips.push_back(std::move(image));
  while (static_cast<int>(mips.size()) < levels) mips.push_back(NextMip(mips.back()));
  return mips;
}

Result<TexelPool> DrawTexels(const ImageSet& set, const TexelPoolOptions& options,
                             ThreadPool& pool) {
  const size_t images = set.images.size();
  const size_t each = std::max<size_t>(1, (options.count + images - 1) / images);
  TexelPool drawn;
  drawn.lookups.Reset(images);
  drawn.samples.resize(each * images);
  for (size_t i = 0; i < images; ++i) {
    brdf::LookUpPair(options.grid, set.images[i].light, set.images[i].view, &drawn.lookups[i]);
    drawn.lookups[i].cosine = set.images[i].light.z;
    drawn.lookups[i].importance = 1;
  }
  const Drawer drawer(set, options);
  std::mutex mutex;
  std::optional<std::pair<size_t, Error>> first_error;
  std::atomic<size_t> done{0};
  pool.ParallelFor(static_cast<int>(images), [&](int task, int worker) {
    const auto image = static_cast<size_t>(task);
    if (options.cancel != nullptr && options.cancel->cancelled()) return;
    auto planes = ReadSetImage(set, image);
    if (!planes) {
      const std::lock_guard lock(mutex);
      if (!first_error || image < first_error->first) first_error.emplace(image, planes.error());
      return;
    }
    drawer.Draw(image, MipsOf(std::move(*planes), options.levels), each,
                drawn.samples.data() + image * each);
    const size_t count = done.fetch_add(1, std::memory_order_relaxed) + 1;
    if (worker == 0 && options.on_progress)
      options.on_progress(static_cast<double>(count) / static_cast<double>(images));
  });
  if (options.cancel != nullptr && options.cancel->cancelled())
    return Fail(ErrorCode::kCancelled, "interrupted");
  if (first_error) return Fail(std::move(first_error->second));
  Rng rng(options.seed, 0);
  for (size_t i = drawn.samples.size(); i > 1; --i) {
    const size_t j = rng.Below(static_cast<uint32_t>(i));
    std::swap(drawn.samples[i - 1], drawn.samples[j]);
  }
  return drawn;
}

}  // namespace patina::svbrdf
