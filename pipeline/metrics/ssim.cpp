#include "pipeline/metrics/ssim.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace patina::metrics {
namespace {

constexpr int kTaps = 11;
constexpr int kRadius = kTaps / 2;
constexpr int kRowsPerTask = 64;
constexpr int kMoments = 4;  // windowed means of a, b, a^2 + b^2, a b: all that Eq. 13 asks for

std::array<float, kTaps> Window() {
  constexpr double kSigma = 1.5;
  std::array<double, kTaps> weights;
  double sum = 0;
  for (int k = 0; k < kTaps; ++k) {
    weights[k] = std::exp(-0.5 * (k - kRadius) * (k - kRadius) / (kSigma * kSigma));
    sum += weights[k];
  }
  std::array<float, kTaps> window;
  for (int k = 0; k < kTaps; ++k) window[k] = static_cast<float>(weights[k] / sum);
  return window;
}

// The windows along one axis of `size` texels: `count` of them, window i on texels first + i -
// kRadius and on.
struct Axis {
  explicit Axis(int size) : texels(size), cut(size < kTaps), count(cut ? size : size - kTaps + 1) {}
  int texels;
  bool cut;  // shorter than the window
  int count;
};

// The weights of window i of a cut axis for texels 0..texels-1.
std::array<float, kTaps> CutWeights(const Axis& axis, int i,
                                    const std::array<float, kTaps>& window) {
  std::array<float, kTaps> weights = {};
  double sum = 0;
  for (int t = 0; t < axis.texels; ++t) {
    const int k = t - i + kRadius;
    if (k >= 0 && k < kTaps) sum += static_cast<double>(window[k]);
  }
  for (int t = 0; t < axis.texels; ++t) {
    const int k = t - i + kRadius;
    if (k >= 0 && k < kTaps) weights[t] = static_cast<float>(static_cast<double>(window[k]) / sum);
  }
  return weights;
}

// out[x] = sum over k of weights[k] * rows[k][x]. Straight-line so that the compiler vectorises
// over x.
void Combine11(float* __restrict out, const std::array<const float*, kTaps>& rows,
               const std::array<float, kTaps>& w, int count) {
  const float *r0 = rows[0], *r1 = rows[1], *r2 = rows[2], *r3 = rows[3], *r4 = rows[4],
              *r5 = rows[5], *r6 = rows[6], *r7 = rows[7], *r8 = rows[8], *r9 = rows[9],
              *r10 = rows[10];
  for (int x = 0; x < count; ++x) {
    out[x] = w[5] * r5[x] + w[4] * (r4[x] + r6[x]) + w[3] * (r3[x] + r7[x]) +
             w[2] * (r2[x] + r8[x]) + w[1] * (r1[x] + r9[x]) + w[0] * (r0[x] + r10[x]);
  }
}

class StripFilter {
 public:
  StripFilter(const PlanarView& a, const PlanarView& b, const std::array<float, kTaps>& window)
      : a_(a), b_(b), window_(window), horizontal_(a.width), vertical_(a.height) {
    const size_t width = static_cast<size_t>(a.width);
    for (auto& row : products_) row.resize(width);
    ring_.resize(static_cast<size_t>(kTaps) * kMoments * width);
    for (auto& row : means_) row.resize(width);
  }

  // Sums of SSIM over window rows [begin, end), one for each row, in order.
  void Sum(int begin, int end, double c1, double c2, double* sums) {
    int next = vertical_.cut ? 0 : begin;
    for (int i = begin; i < end; ++i) {
      const int last = vertical_.cut ? vertical_.texels - 1 : i + kTaps - 1;
      for (; next <= last; ++next) FilterRow(next);
      for (int m = 0; m < kMoments; ++m) MeansOfRow(i, m);
      *sums++ = SumOfRow(c1, c2);
    }
  }

 private:
  float* Ring(int row, int moment) {
    return ring_.data() +
           static_cast<size_t>((row % kTaps) * kMoments + moment) * static_cast<size_t>(a_.width);
  }

  void FilterRow(int y) {
    const float *a = a_.Row(y), *b = b_.Row(y);
    float *squares = products_[0].data(), *cross = products_[1].data();
    for (int x = 0; x < a_.width; ++x) {
      squares[x] = a[x] * a[x] + b[x] * b[x];
      cross[x] = a[x] * b[x];
    }
    const float* rows[kMoments] = {a, b, squares, cross};
    for (int m = 0; m < kMoments; ++m) FilterAcross(Ring(y, m), rows[m]);
  }

  void FilterAcross(float* out, const float* in) const {
    if (!horizontal_.cut) {
      std::array<const float*, kTaps> shifted;
      for (int k = 0; k < kTaps; ++k) shifted[k] = in + k;
      Combine11(out, shifted, window_, horizontal_.count);
      return;
    }
    for (int i = 0; i < horizontal_.count; ++i) {
      const auto weights = CutWeights(horizontal_, i, window_);
      float sum = 0;
      for (int t = 0; t < horizontal_.texels; ++t) sum += weights[t] * in[t];
      out[i] = sum;
    }
  }

  void MeansOfRow(int i, int moment) {
    float* out = means_[moment].data();
    if (!vertical_.cut) {
      std::array<const float*, kTaps> rows;
      for (int k = 0; k < kTaps; ++k) rows[k] = Ring(i + k, moment);
      Combine11(out, rows, window_, horizontal_.count);
      return;
    }
    const auto weights = CutWeights(vertical_, i, window_);
    std::fill(out, out + horizontal_.count, 0.0f);
    for (int t = 0; t < vertical_.texels; ++t) {
      const float* row = Ring(t, moment);
      for (int x = 0; x < horizontal_.count; ++x) out[x] += weights[t] * row[x];
    }
  }

  double SumOfRow(double c1_double, double c2_double) const {
    const float c1 = static_cast<float>(c1_double), c2 = static_cast<float>(c2_double);
    const float *mean_a = means_[0].data(), *mean_b = means_[1].data(), *squares = means_[2].data(),
                *cross = means_[3].data();
    double sum = 0;
    constexpr int kBlock = 16;
    for (int x = 0; x < horizontal_.count; x += kBlock) {
      float values[kBlock];
      const int n = std::min(kBlock, horizontal_.count - x);
      for (int i = 0; i < n; ++i) {
        const float ab = mean_a[x + i] * mean_b[x + i];
        const float aa_bb = mean_a[x + i] * mean_a[x + i] + mean_b[x + i] * mean_b[x + i];
        values[i] = (2.0f * ab + c1) * (2.0f * (cross[x + i] - ab) + c2) /
                    ((aa_bb + c1) * (squares[x + i] - aa_bb + c2));
      }
      for (int i = 0; i < n; ++i) sum += static_cast<double>(values[i]);
    }
    return sum;
  }

  const PlanarView& a_;
  const PlanarView& b_;
  const std::array<float, kTaps>& window_;
  Axis horizontal_, vertical_;
  std::array<std::vector<float>, 2> products_;
  std::vector<float> ring_;  // the last kTaps rows, filtered across
  std::array<std::vector<float>, kMoments> means_;
};

}  // namespace

double MeanSsim(const PlanarView& reference, const PlanarView& test, ThreadPool& pool,
                double peak) {
  if (reference.width <= 0 || reference.height <= 0) return 1.0;
  const auto window = Window();
  const int rows = Axis(reference.height).count;
  const double c1 = (0.01 * peak) * (0.01 * peak), c2 = (0.03 * peak) * (0.03 * peak);
  std::vector<double> sums(static_cast<size_t>(rows));
  std::vector<StripFilter> filters(static_cast<size_t>(pool.threads()),
                                   StripFilter(reference, test, window));
  pool.ParallelFor((rows + kRowsPerTask - 1) / kRowsPerTask, [&](int task, int worker) {
    const int begin = task * kRowsPerTask;
    filters[worker].Sum(begin, std::min(rows, begin + kRowsPerTask), c1, c2, sums.data() + begin);
  });
  double total = 0;
  for (const double sum : sums) total += sum;
  return total / (static_cast<double>(rows) * Axis(reference.width).count);
}

}  // namespace patina::metrics
