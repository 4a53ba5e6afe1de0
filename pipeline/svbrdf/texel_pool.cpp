#include "pipeline/svbrdf/texel_pool.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>
#include <utility>

#include "pipeline/base/rng.h"
#include "pipeline/svbrdf/place_drawer.h"

namespace patina::svbrdf {
namespace {

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

class Drawer {
 public:
  Drawer(const ImageSet& set, const TexelPoolOptions& options)
      : set_(set), options_(options), places_(set.width, set.height, options.levels) {}

  void Draw(size_t image, const std::vector<PlaneLevel>& mips, size_t count,
            TexelSample* out) const {
    Rng rng(options_.seed, image + 1);
    for (size_t i = 0; i < count; ++i) {
      TexelSample& sample = out[i];
      sample.pair = static_cast<uint32_t>(image);
      places_.Draw(&rng, &sample.u, &sample.v, &sample.s);
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
  PlaceDrawer places_;
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
  Shuffle(options.seed, &drawn.samples);
  return drawn;
}

void Shuffle(uint64_t seed, std::vector<TexelSample>* samples) {
  Rng rng(seed, 0);
  for (size_t i = samples->size(); i > 1; --i)
    std::swap((*samples)[i - 1], (*samples)[rng.Below(static_cast<uint32_t>(i))]);
}

}  // namespace patina::svbrdf
