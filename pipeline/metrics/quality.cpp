#include "pipeline/metrics/quality.h"

#include <algorithm>
#include <array>
#include <utility>

#include "pipeline/color/color.h"
#include "pipeline/metrics/flip.h"
#include "pipeline/metrics/normal_angle.h"
#include "pipeline/metrics/psnr.h"
#include "pipeline/metrics/ssim.h"

namespace patina::metrics {
namespace {

// A plane that a view of real memory can be taken of: constants are filled in.
class FullPlane {
 public:
  FullPlane(const PlanarView& view, float constant, int width, int height) : view_(view) {
    if (view.data != nullptr) return;
    storage_.assign(static_cast<size_t>(width) * height, constant);
    view_ = DensePlane(storage_.data(), width, height);
  }
  FullPlane(const FullPlane&) = delete;
  FullPlane& operator=(const FullPlane&) = delete;

  // Values that may be changed, row after row.
  float* Own() {
    if (storage_.empty()) {
      const size_t width = static_cast<size_t>(view_.width);
      storage_.resize(width * view_.height);
      for (int y = 0; y < view_.height; ++y)
        std::copy_n(view_.Row(y), width, storage_.data() + y * width);
      view_ = DensePlane(storage_.data(), view_.width, view_.height);
    }
    return storage_.data();
  }

  const PlanarView& view() const { return view_; }

 private:
  PlanarView view_;
  std::vector<float> storage_;
};

bool IsConstant(const PlanePair& pair) {
  return pair.reference.data == nullptr && pair.test.data == nullptr;
}

// As sRGB codes of Rec. 709.
void CodeForDisplay(const QualityMap& map, std::array<FullPlane, 3>* planes, ThreadPool& pool) {
  const bool same_space = map.channels < 3 || map.to_rec709 == kIdentity3;
  if (map.kind == MapKind::kSrgbColor && same_space) return;
  float* rgb[3];
  for (size_t c = 0; c < 3; ++c) rgb[c] = (*planes)[c].Own();
  const PlanarView& size = (*planes)[0].view();
  const size_t width = static_cast<size_t>(size.width);
  pool.ParallelFor(size.height, [&](int y, int) {
    float* row[3];
    for (size_t c = 0; c < 3; ++c) {
      row[c] = rgb[c] + static_cast<size_t>(y) * width;
      if (map.kind == MapKind::kSrgbColor) SrgbToLinearRow(row[c], width, row[c]);
    }
    for (size_t x = 0; x < width && !same_space; ++x) {
      const double in[3] = {row[0][x], row[1][x], row[2][x]};
      for (size_t c = 0; c < 3; ++c) {
        const double* m = map.to_rec709.data() + 3 * c;
        row[c][x] = static_cast<float>(m[0] * in[0] + m[1] * in[1] + m[2] * in[2]);
      }
    }
    for (float* values : row) LinearToSrgbRow(values, width, values);
  });
}

double MeasureFlip(const QualityMap& map, std::span<const PlanePair> planes, int width, int height,
                   ThreadPool& pool) {
  const auto view = [&](std::array<FullPlane, 3>& full) {
    CodeForDisplay(map, &full, pool);
    return RgbView{full[0].view(), full[1].view(), full[2].view()};
  };
  const auto& r = planes[0];
  const auto& g = planes[planes.size() >= 3 ? 1 : 0];
  const auto& b = planes[planes.size() >= 3 ? 2 : 0];
  std::array<FullPlane, 3> reference = {
      FullPlane(r.reference, r.reference_constant, width, height),
      FullPlane(g.reference, g.reference_constant, width, height),
      FullPlane(b.reference, b.reference_constant, width, height)};
  std::array<FullPlane, 3> test = {FullPlane(r.test, r.test_constant, width, height),
                                   FullPlane(g.test, g.test_constant, width, height),
                                   FullPlane(b.test, b.test_constant, width, height)};
  return MeanFlip(view(reference), view(test), pool);
}

std::vector<float> NormalZPlane(const PlanarView& x_plane, const PlanarView& y_plane,
                                ThreadPool& pool) {
  std::vector<float> z(static_cast<size_t>(x_plane.width) * x_plane.height);
  pool.ParallelFor(x_plane.height, [&](int y, int) {
    const float *nx = x_plane.Row(y), *ny = y_plane.Row(y);
    float* out = z.data() + static_cast<size_t>(y) * x_plane.width;
    for (int x = 0; x < x_plane.width; ++x) out[x] = CodedNormalZ(nx[x], ny[x]);
  });
  return z;
}

PsnrTable MakeTable(std::vector<double> mse) {
  PsnrTable table;
  double mse_sum = 0, psnr_sum = 0;
  for (const double level_mse : mse) {
    table.psnr_db.push_back(PsnrDb(level_mse));
    mse_sum += level_mse;
    psnr_sum += table.psnr_db.back();
  }
  const double levels = static_cast<double>(mse.size());
  table.mse = std::move(mse);
  table.overall_db = PsnrDb(mse_sum / levels);
  table.mip0_db = table.psnr_db.front();
  table.mean_mips_db = psnr_sum / levels;
  return table;
}

}  // namespace

void QualityMeter::AddLevel(int width, int height, std::span<const PlanePair> planes,
                            ThreadPool& pool) {
  const bool first = levels_.empty();
  auto& level = levels_.emplace_back(maps_.size());
  texels_.push_back(static_cast<double>(width) * height);
  if (first) scores_.resize(maps_.size());

  size_t at = 0;
  for (size_t m = 0; m < maps_.size(); ++m) {
    const QualityMap& map = maps_[m];
    const auto mine = planes.subspan(at, static_cast<size_t>(map.channels));
    at += mine.size();
    MapScores ignored;
    MapScores& scores = first ? scores_[m] : ignored;
    level[m].channels = map.channels;

    const auto add = [&](const PlanarView& reference, const PlanarView& test) {
      level[m].squared_error += SumSquaredError(reference, test, pool);
      if (first) {
        scores.ssim_sum += MeanSsim(reference, test, pool);
        ++scores.ssim_channels;
      }
    };
    for (const PlanePair& pair : mine) {
      if (IsConstant(pair)) {
        const double d =
            static_cast<double>(pair.reference_constant) - static_cast<double>(pair.test_constant);
        level[m].squared_error += d * d * texels_.back();
        continue;
      }
      const FullPlane reference(pair.reference, pair.reference_constant, width, height);
      const FullPlane test(pair.test, pair.test_constant, width, height);
      add(reference.view(), test.view());
    }
    if (map.kind == MapKind::kNormalXy) {
      level[m].channels = map.channels + 1;
      const FullPlane rx(mine[0].reference, mine[0].reference_constant, width, height);
      const FullPlane ry(mine[1].reference, mine[1].reference_constant, width, height);
      const FullPlane tx(mine[0].test, mine[0].test_constant, width, height);
      const FullPlane ty(mine[1].test, mine[1].test_constant, width, height);
      if (!IsConstant(mine[0]) || !IsConstant(mine[1])) {
        const auto rz = NormalZPlane(rx.view(), ry.view(), pool);
        const auto tz = NormalZPlane(tx.view(), ty.view(), pool);
        add(DensePlane(rz.data(), width, height), DensePlane(tz.data(), width, height));
      }
      if (first)
        scores.normal_angle_deg =
            MeanNormalAngleDeg(rx.view(), ry.view(), tx.view(), ty.view(), pool);
    }
    if (first && map.flip) scores.flip = MeasureFlip(map, mine, width, height, pool);
  }
}

QualityResult QualityMeter::Finish() const {
  QualityResult result;
  double ssim_sum = 0;
  int ssim_channels = 0;
  std::vector<double> all_error(levels_.size());
  double all_channels = 0;
  for (size_t m = 0; m < maps_.size(); ++m) {
    MapQuality quality;
    quality.name = maps_[m].name;
    std::vector<double> mse;
    for (size_t l = 0; l < levels_.size(); ++l) {
      const MapLevel& entry = levels_[l][m];
      mse.push_back(entry.squared_error / (texels_[l] * entry.channels));
      all_error[l] += entry.squared_error;
    }
    all_channels += levels_.front()[m].channels;
    quality.psnr = MakeTable(std::move(mse));
    const MapScores& scores = scores_[m];
    if (scores.ssim_channels > 0) quality.ssim = scores.ssim_sum / scores.ssim_channels;
    ssim_sum += scores.ssim_sum;
    ssim_channels += scores.ssim_channels;
    quality.flip = scores.flip;
    quality.normal_angle_deg = scores.normal_angle_deg;
    if (!result.flip) result.flip = scores.flip;
    if (!result.normal_angle_deg) result.normal_angle_deg = scores.normal_angle_deg;
    result.maps.push_back(std::move(quality));
  }
  for (size_t l = 0; l < all_error.size(); ++l) all_error[l] /= texels_[l] * all_channels;
  result.psnr = MakeTable(std::move(all_error));
  if (ssim_channels > 0) result.ssim = ssim_sum / ssim_channels;
  return result;
}

}  // namespace patina::metrics
