#include "pipeline/image/resize.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace patina {
namespace {

struct Taps {
  std::array<int, 4> at;
  std::array<float, 4> weight;
};

// For every position of the new grid, four positions of the old one.
std::vector<Taps> MakeTaps(int from, int to, bool wrap) {
  std::vector<Taps> all(to);
  for (int i = 0; i < to; ++i) {
    const double position = (i + 0.5) * from / to - 0.5;
    const double floor = std::floor(position);
    double weights[4];
    CatmullRomWeights(position - floor, weights);
    for (int tap = 0; tap < 4; ++tap) {
      int at = static_cast<int>(floor) - 1 + tap;
      at = wrap ? ((at % from) + from) % from : std::clamp(at, 0, from - 1);
      all[i].at[tap] = at;
      all[i].weight[tap] = static_cast<float>(weights[tap]);
    }
  }
  return all;
}

}  // namespace

Image ResizeBicubic(const Image& image, const ImageStats& stats, int width, int height, bool wrap,
                    ThreadPool& pool) {
  Image result;
  result.path = image.path;
  result.info = image.info;
  result.info.width = width;
  result.info.height = height;
  result.info.type = SampleType::kFloat;
  result.Allocate();
  const int channels = image.channels();
  const std::vector<Taps> columns = MakeTaps(image.width(), width, wrap);
  const std::vector<Taps> rows = MakeTaps(image.height(), height, wrap);
  std::vector<std::vector<float>> scratch(pool.threads());
  for (auto& rows_of_worker : scratch)
    rows_of_worker.resize(static_cast<size_t>(image.width()) * 2);
  pool.ParallelFor(height, [&](int y, int worker) {
    float* source = scratch[worker].data();
    float* mixed = source + image.width();
    float* out =
        reinterpret_cast<float*>(result.bytes.data() + static_cast<size_t>(y) * result.row_bytes());
    for (int c = 0; c < channels; ++c) {
      std::fill(mixed, mixed + image.width(), 0.0f);
      for (int tap = 0; tap < 4; ++tap) {
        LoadRow(image, rows[y].at[tap], c, source);
        const float weight = rows[y].weight[tap];
        for (int x = 0; x < image.width(); ++x) mixed[x] += weight * source[x];
      }
      for (int x = 0; x < width; ++x) {
        const Taps& taps = columns[x];
        float sum = 0;
        for (int tap = 0; tap < 4; ++tap) sum += taps.weight[tap] * mixed[taps.at[tap]];
        out[static_cast<size_t>(x) * channels + c] = std::clamp(sum, stats.min[c], stats.max[c]);
      }
    }
  });
  return result;
}

}  // namespace patina
