#include "pipeline/jobs/measure_svbrdf.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <set>

#include "pipeline/base/rng.h"
#include "pipeline/color/color.h"
#include "pipeline/jobs/load_svbrdf_decoder.h"
#include "pipeline/material/trainer.h"

namespace patina {
namespace {

constexpr size_t kTexelImages = 64;
constexpr int kTexelsOfEach = 256;
constexpr uint64_t kTexelSeed = 20231;

double Degrees(const brdf::Direction& d) {
  return std::acos(std::clamp(static_cast<double>(d.z), -1.0, 1.0)) * 180 / std::numbers::pi;
}

// The images that are shown: see SvbrdfMeasurement::planes.
std::vector<size_t> PickPlanes(const svbrdf::ImageSet& set) {
  std::vector<size_t> order(set.images.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const auto height = [&](size_t i) {
    return std::min(set.images[i].light.z, set.images[i].view.z);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return height(a) > height(b); });
  std::vector<size_t> picked;
  for (const size_t at : {size_t{0}, order.size() / 2, order.size() - 1}) {
    if (std::find(picked.begin(), picked.end(), order[at]) == picked.end())
      picked.push_back(order[at]);
  }
  return picked;
}

RgbImage Picture(const brdf::SphereImage& image) {
  const int side = std::min(image.side, kSheetTile), margin = (image.side - side) / 2;
  RgbImage picture;
  picture.width = picture.height = side;
  std::vector<float> row(3 * static_cast<size_t>(side));
  picture.rgb.resize(row.size() * static_cast<size_t>(side));
  for (int y = 0; y < side; ++y) {
    const float* from =
        image.rgb.data() + 3 * (static_cast<size_t>(y + margin) * image.side + margin);
    for (size_t i = 0; i < row.size(); ++i) row[i] = std::clamp(from[i], 0.0f, 1.0f);
    LinearToSrgbRow(row.data(), row.size(), picture.rgb.data() + row.size() * y);
  }
  return picture;
}

class Meter {
 public:
  Meter(const svbrdf::ImageSet& set, const SvbrdfDecoder& decoder, ThreadPool& pool)
      : set_(set), decoder_(decoder), pool_(pool) {}

  bool finite() const { return finite_; }

  Result<SvbrdfPlane> Plane(size_t image) {
    PATINA_ASSIGN(const PlaneLevel source, svbrdf::ReadSetImage(set_, image));
    const svbrdf::SetImage& entry = set_.images[image];
    SvbrdfPlane plane;
    plane.image = image;
    plane.light_deg = Degrees(entry.light);
    plane.view_deg = Degrees(entry.view);
    const int side = std::min({set_.width, set_.height, kPlaneSide});
    const int x0 = (set_.width - side) / 2, y0 = (set_.height - side) / 2;
    brdf::SphereImage wanted, decoded;
    for (brdf::SphereImage* to : {&wanted, &decoded}) {
      to->side = side;
      to->rgb.resize(3 * static_cast<size_t>(side) * side);
      to->inside.assign(static_cast<size_t>(side) * side, 1);
    }
    const float exposure = entry.light.z * std::numbers::pi_v<float>;
    pool_.ParallelFor(side, [&](int y, int) {
      for (int x = 0; x < side; ++x) {
        const size_t at = 3 * (static_cast<size_t>(y) * side + x);
        Decode(entry, x0 + x, y0 + y, decoded.rgb.data() + at);
        for (int c = 0; c < 3; ++c) {
          decoded.rgb[at + c] *= exposure;
          wanted.rgb[at + c] = std::max(0.0f, source.Row(c, y0 + y)[x0 + x]) * exposure;
        }
      }
    });
    for (const float value : decoded.rgb) finite_ = finite_ && std::isfinite(value);
    plane.error = brdf::CompareSpheres(wanted, decoded, pool_);
    plane.mse = plane.error.rmse_linear * plane.error.rmse_linear;
    plane.source_picture = Picture(wanted);
    plane.decoded_picture = Picture(decoded);
    plane.difference_picture = DifferenceOf(plane.source_picture, plane.decoded_picture);
    return plane;
  }

  // Adds |log(1 + f) - log(1 + f*)| of texels of an image.
  Status AddTexels(size_t image, Log1pError* sum) {
    PATINA_ASSIGN(const PlaneLevel source, svbrdf::ReadSetImage(set_, image));
    Rng rng(kTexelSeed, image);
    for (int i = 0; i < kTexelsOfEach; ++i) {
      const int x = static_cast<int>(rng.Below(static_cast<uint32_t>(set_.width)));
      const int y = static_cast<int>(rng.Below(static_cast<uint32_t>(set_.height)));
      float rgb[3];
      Decode(set_.images[image], x, y, rgb);
      for (int c = 0; c < 3; ++c) {
        finite_ = finite_ && std::isfinite(rgb[c]);
        const double wanted = std::max(0.0, static_cast<double>(source.Row(c, y)[x]));
        const double d = std::log1p(static_cast<double>(rgb[c])) - std::log1p(wanted);
        sum->mae += std::abs(d);
        sum->mse += d * d;
      }
      ++sum->pairs;
    }
    return {};
  }

 private:
  void Decode(const svbrdf::SetImage& entry, int x, int y, float rgb[3]) const {
    const float wi[3] = {entry.light.x, entry.light.y, entry.light.z};
    const float wo[3] = {entry.view.x, entry.view.y, entry.view.z};
    decoder_.Evaluate(wi, wo, (x + 0.5) / set_.width, (y + 0.5) / set_.height, 0, rgb);
  }

  const svbrdf::ImageSet& set_;
  const SvbrdfDecoder& decoder_;
  ThreadPool& pool_;
  bool finite_ = true;
};

// The mean over the planes.
void Summarize(SvbrdfMeasurement* result) {
  const auto share = 1 / static_cast<double>(result->planes.size());
  brdf::ImageError& mean = result->error;
  mean.ssim = 0;
  for (const SvbrdfPlane& plane : result->planes) {
    mean.mae_linear += share * plane.error.mae_linear;
    mean.rmse_linear += share * plane.error.rmse_linear;
    mean.mae_srgb += share * plane.error.mae_srgb;
    mean.rmse_srgb += share * plane.error.rmse_srgb;
    mean.ssim += share * plane.error.ssim;
    result->mse += share * plane.mse;
  }
  const double values = 3 * static_cast<double>(result->log1p.pairs);
  result->log1p.mae /= values;
  result->log1p.mse /= values;
}

}  // namespace

Result<SvbrdfMeasurement> MeasureSvbrdf(const std::string& directory, const svbrdf::ImageSet& set,
                                        ThreadPool& pool, const CancelToken& cancel,
                                        ProgressSink& progress) {
  PATINA_ASSIGN(const SvbrdfDecoder decoder, LoadSvbrdfDecoder(directory));
  Meter meter(set, decoder, pool);
  SvbrdfMeasurement result;
  for (const size_t image : PickPlanes(set)) {
    if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
    PATINA_ASSIGN(SvbrdfPlane plane, meter.Plane(image));
    result.planes.push_back(std::move(plane));
  }
  const size_t images = std::min(kTexelImages, set.images.size());
  for (size_t i = 0; i < images; ++i) {
    if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
    PATINA_TRY(meter.AddTexels(i * set.images.size() / images, &result.log1p));
    ProgressEvent event;
    event.stage = "verify";
    event.fraction = static_cast<double>(i + 1) / static_cast<double>(images);
    progress.OnProgress(event);
  }
  if (!meter.finite())
    return Fail(ErrorCode::kInternal, directory + ": decodes to a value that is not finite");
  Summarize(&result);
  return result;
}

SvbrdfSummary SummarizeSvbrdf(const SvbrdfMeasurement& measurement, const ManifestBrdf& brdf,
                              uint64_t bytes) {
  SvbrdfSummary summary;
  summary.image_mae = measurement.error.mae_srgb;
  summary.image_rmse = measurement.error.rmse_srgb;
  summary.image_ssim = measurement.error.ssim;
  summary.psnr_db = PsnrOfMse(measurement.mse);
  summary.log1p_mae = measurement.log1p.mae;
  summary.ratio = CompressionRatio(brdf, bytes);
  return summary;
}

}  // namespace patina
