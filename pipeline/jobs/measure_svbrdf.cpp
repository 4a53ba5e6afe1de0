#include "pipeline/jobs/measure_svbrdf.h"

#include <algorithm>
#include <cmath>
#include <numbers>

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
  Meter(const svbrdf::VaryingSource& source, const SvbrdfDecoder& decoder, ThreadPool& pool)
      : source_(source), decoder_(decoder), pool_(pool) {}

  bool finite() const { return finite_; }

  Result<SvbrdfPlane> Plane(size_t pair) {
    const svbrdf::DirectionPair& entry = source_.pairs()[pair];
    SvbrdfPlane plane;
    plane.image = pair;
    plane.light_deg = Degrees(entry.light);
    plane.view_deg = Degrees(entry.view);
    const int width = source_.width(), height = source_.height();
    const int side = std::min({width, height, kPlaneSide, source_.plane_side()});
    const int x0 = (width - side) / 2, y0 = (height - side) / 2;
    std::vector<svbrdf::TexelPlace> places;
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) places.push_back({x0 + x, y0 + y});
    }
    PATINA_ASSIGN(const std::vector<float> given, source_.Values(pair, places, pool_));
    brdf::SphereImage wanted, decoded;
    for (brdf::SphereImage* to : {&wanted, &decoded}) {
      to->side = side;
      to->rgb.resize(3 * places.size());
      to->inside.assign(places.size(), 1);
    }
    const float exposure = entry.light.z * std::numbers::pi_v<float>;
    pool_.ParallelFor(side, [&](int y, int) {
      for (int x = 0; x < side; ++x) {
        const size_t at = 3 * (static_cast<size_t>(y) * side + x);
        Decode(entry, x0 + x, y0 + y, decoded.rgb.data() + at);
        for (int c = 0; c < 3; ++c) {
          decoded.rgb[at + c] *= exposure;
          wanted.rgb[at + c] = std::max(0.0f, given[at + c]) * exposure;
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

  // Adds |log(1 + f) - log(1 + f*)| of texels under a pair.
  Status AddTexels(size_t pair, Log1pError* sum) {
    Rng rng(kTexelSeed, pair);
    std::vector<svbrdf::TexelPlace> places;
    for (int i = 0; i < kTexelsOfEach; ++i) {
      const int x = static_cast<int>(rng.Below(static_cast<uint32_t>(source_.width())));
      const int y = static_cast<int>(rng.Below(static_cast<uint32_t>(source_.height())));
      places.push_back({x, y});
    }
    PATINA_ASSIGN(const std::vector<float> given, source_.Values(pair, places, pool_));
    for (size_t i = 0; i < places.size(); ++i) {
      float rgb[3];
      Decode(source_.pairs()[pair], places[i].x, places[i].y, rgb);
      for (size_t c = 0; c < 3; ++c) {
        finite_ = finite_ && std::isfinite(rgb[c]);
        const double wanted = std::max(0.0, static_cast<double>(given[3 * i + c]));
        const double d = std::log1p(static_cast<double>(rgb[c])) - std::log1p(wanted);
        sum->mae += std::abs(d);
        sum->mse += d * d;
      }
      ++sum->pairs;
    }
    return {};
  }

 private:
  void Decode(const svbrdf::DirectionPair& entry, int x, int y, float rgb[3]) const {
    const float wi[3] = {entry.light.x, entry.light.y, entry.light.z};
    const float wo[3] = {entry.view.x, entry.view.y, entry.view.z};
    decoder_.Evaluate(wi, wo, (x + 0.5) / source_.width(), (y + 0.5) / source_.height(), 0, rgb);
  }

  const svbrdf::VaryingSource& source_;
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

Result<SvbrdfMeasurement> MeasureSvbrdf(const std::string& directory,
                                        const svbrdf::VaryingSource& source, ThreadPool& pool,
                                        const CancelToken& cancel, ProgressSink& progress) {
  PATINA_ASSIGN(const SvbrdfDecoder decoder, LoadSvbrdfDecoder(directory));
  Meter meter(source, decoder, pool);
  SvbrdfMeasurement result;
  for (const size_t image : source.planes()) {
    if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
    PATINA_ASSIGN(SvbrdfPlane plane, meter.Plane(image));
    result.planes.push_back(std::move(plane));
  }
  const size_t images = std::min(kTexelImages, source.pairs().size());
  for (size_t i = 0; i < images; ++i) {
    if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
    PATINA_TRY(meter.AddTexels(i * source.pairs().size() / images, &result.log1p));
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
