#include "pipeline/jobs/measure_brdf.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <vector>

#include "formats/index_pack.h"
#include "formats/weights.h"
#include "pipeline/base/rng.h"
#include "pipeline/brdf/sample_pool.h"
#include "pipeline/color/color.h"
#include "pipeline/jobs/load_brdf_decoder.h"

namespace patina {
namespace {

using brdf::Direction;

constexpr double kPi = std::numbers::pi;
constexpr int kImageSide = 128;
constexpr int kDraftSide = 64;  // of simulated sources, enlarged for the sheet
constexpr int kLightColumns = 32;
constexpr int kLightRows = 16;
constexpr float kExposure = 2;
constexpr size_t kPairsOfEach = 8192;
constexpr uint64_t kPairSeed = 20231;
constexpr int kAlbedoThetas = 64;
constexpr int kAlbedoPhis = 128;
constexpr size_t kPairsPerTask = 1024;
constexpr double kMaxDisagreement = 1e-3;

struct Pairs {
  std::vector<Direction> wi, wo;
  void Add(const Direction& i, const Direction& o) {
    wi.push_back(i);
    wo.push_back(o);
  }
};

// What is decoded, for any worker of the pool; notes values that are not finite.
class Decoded {
 public:
  Decoded(const brdf::BatchEvaluator& evaluator, int threads) : evaluator_(evaluator) {
    for (int t = 0; t < threads; ++t)
      scratch_.push_back(std::make_unique<brdf::BatchEvaluator::Scratch>(evaluator));
  }

  void Evaluate(int worker, size_t count, const Direction* wi, const Direction* wo, float* rgb) {
    evaluator_.Evaluate(scratch_[static_cast<size_t>(worker)].get(), count, wi, wo, rgb);
    // A sum of zeros unless some value is not finite, and without a branch in the loop.
    float sum = 0;
    for (size_t i = 0; i < 3 * count; ++i) sum += 0.0f * rgb[i];
    if (sum != 0.0f || std::isnan(sum)) finite_.store(false, std::memory_order_relaxed);
  }

  brdf::EvaluatePairs Function() {
    return [this](int worker, size_t count, const Direction* wi, const Direction* wo, float* rgb) {
      Evaluate(worker, count, wi, wo, rgb);
    };
  }

  bool finite() const { return finite_.load(); }

 private:
  const brdf::BatchEvaluator& evaluator_;
  std::vector<std::unique_ptr<brdf::BatchEvaluator::Scratch>> scratch_;
  std::atomic<bool> finite_{true};
};

// The table, with noise below zero cut off as the model cuts it off.
brdf::EvaluatePairs TableFunction(const brdf::Table& table) {
  return [&table](int, size_t count, const Direction* wi, const Direction* wo, float* rgb) {
    for (size_t i = 0; i < count; ++i) {
      table.Evaluate(wi[i], wo[i], rgb + 3 * i);
      for (size_t c = 0; c < 3; ++c) rgb[3 * i + c] = std::max(rgb[3 * i + c], 0.0f);
    }
  };
}

// The same of a simulated table, which takes a while: tells how far it is, and stops when told.
brdf::EvaluatePairs DraftFunction(const brdf::SimulatedTable& table, const CancelToken& cancel,
                                  std::function<void(size_t)> on_pairs) {
  return [&table, &cancel, on_pairs](int worker, size_t count, const Direction* wi,
                                     const Direction* wo, float* rgb) {
    for (size_t i = 0; i < count; ++i) {
      if (cancel.cancelled()) {
        std::fill(rgb, rgb + 3 * count, 0.0f);
        return;
      }
      table.EvaluateDraft(wi[i], wo[i], rgb + 3 * i);
    }
    if (worker == 0) on_pairs(count);
  };
}

std::vector<float> EvaluateAll(Decoded* decoded, const std::vector<Direction>& wi,
                               const std::vector<Direction>& wo, ThreadPool& pool) {
  std::vector<float> rgb(3 * wi.size());
  const auto tasks = static_cast<int>((wi.size() + kPairsPerTask - 1) / kPairsPerTask);
  pool.ParallelFor(tasks, [&](int task, int worker) {
    const size_t begin = static_cast<size_t>(task) * kPairsPerTask;
    const size_t count = std::min(kPairsPerTask, wi.size() - begin);
    decoded->Evaluate(worker, count, wi.data() + begin, wo.data() + begin, rgb.data() + 3 * begin);
  });
  return rgb;
}

// The same with what a renderer uses.
std::vector<float> DecodeAll(const BrdfDecoder& decoder, const std::vector<Direction>& wi,
                             const std::vector<Direction>& wo, ThreadPool& pool) {
  std::vector<float> rgb(3 * wi.size());
  const auto tasks = static_cast<int>((wi.size() + kPairsPerTask - 1) / kPairsPerTask);
  pool.ParallelFor(tasks, [&](int task, int) {
    const size_t begin = static_cast<size_t>(task) * kPairsPerTask;
    const size_t end = std::min(wi.size(), begin + kPairsPerTask);
    for (size_t i = begin; i < end; ++i) {
      const float in[3] = {wi[i].x, wi[i].y, wi[i].z}, out[3] = {wo[i].x, wo[i].y, wo[i].z};
      decoder.Evaluate(in, out, rgb.data() + 3 * i);
    }
  });
  return rgb;
}

// Compares f of `count` pairs with that of the source.
Log1pError CompareValues(const float* source, const float* decoded, size_t count) {
  Log1pError error;
  error.pairs = count;
  if (count == 0) return error;
  for (size_t i = 0; i < 3 * count; ++i) {
    const double wanted = std::log1p(std::max(0.0, static_cast<double>(source[i])));
    const double difference = std::log1p(static_cast<double>(decoded[i])) - wanted;
    error.mae += std::abs(difference);
    error.mse += difference * difference;
  }
  error.mae /= static_cast<double>(3 * count);
  error.mse /= static_cast<double>(3 * count);
  return error;
}

Log1pError Together(const Log1pError& a, const Log1pError& b) {
  Log1pError both;
  both.pairs = a.pairs + b.pairs;
  if (both.pairs == 0) return both;
  const double share = static_cast<double>(a.pairs) / static_cast<double>(both.pairs);
  both.mae = share * a.mae + (1 - share) * b.mae;
  both.mse = share * a.mse + (1 - share) * b.mse;
  return both;
}

double ReciprocityError(const std::vector<float>& forth, const std::vector<float>& back) {
  double difference = 0;
  double sum = 0;
  for (size_t i = 0; i < forth.size(); ++i) {
    const auto a = static_cast<double>(forth[i]);
    const auto b = static_cast<double>(back[i]);
    difference += std::abs(a - b);
    sum += (a + b) / 2;
  }
  return sum > 0 ? difference / sum : 0;
}

RgbImage ForAPerson(const brdf::SphereImage& image) {
  RgbImage picture;
  picture.width = picture.height = image.side;
  picture.rgb.resize(image.rgb.size());
  std::vector<float> linear(image.rgb.size());
  for (size_t i = 0; i < linear.size(); ++i) linear[i] = std::clamp(image.rgb[i], 0.0f, 1.0f);
  LinearToSrgbRow(linear.data(), linear.size(), picture.rgb.data());
  return picture;
}

brdf::SphereImage Enlarged(const brdf::SphereImage& image, int factor) {
  brdf::SphereImage large;
  large.side = image.side * factor;
  for (int y = 0; y < large.side; ++y) {
    for (int x = 0; x < large.side; ++x) {
      const size_t from = static_cast<size_t>(y / factor) * image.side + x / factor;
      large.inside.push_back(image.inside[from]);
      for (size_t c = 0; c < 3; ++c) large.rgb.push_back(image.rgb[3 * from + c]);
    }
  }
  return large;
}

class Meter {
 public:
  Meter(const brdf::Source& source, const BrdfDecoder& decoder, Decoded* decoded, ThreadPool& pool,
        const CancelToken& cancel, ProgressSink& progress)
      : source_(source),
        decoder_(decoder),
        decoded_(*decoded),
        pool_(pool),
        cancel_(cancel),
        progress_(progress) {}

  // Mean difference of the decoder's and the kernels' log(1 + f) at the pairs of MeasurePairs.
  double disagreement() const { return disagreement_; }

  void MeasurePairs(BrdfMeasurement* result) {
    Pairs pairs;
    std::vector<float> wanted;
    size_t first_kind = 0;
    if (source_.table == nullptr) {
      for (const brdf::Sample& sample : source_.samples) {
        pairs.Add(sample.wi, sample.wo);
        wanted.insert(wanted.end(), sample.rgb, sample.rgb + 3);
      }
      first_kind = pairs.wi.size();
    } else {
      Draw(brdf::Draw::kHalfAngles, &pairs, &wanted);
      first_kind = pairs.wi.size();
      Draw(brdf::Draw::kDirections, &pairs, &wanted);
    }
    const std::vector<float> forth = DecodeAll(decoder_, pairs.wi, pairs.wo, pool_);
    const std::vector<float> back = DecodeAll(decoder_, pairs.wo, pairs.wi, pool_);
    const std::vector<float> kernels = EvaluateAll(&decoded_, pairs.wi, pairs.wo, pool_);
    disagreement_ = CompareValues(forth.data(), kernels.data(), pairs.wi.size()).mae;
    result->half_angles = CompareValues(wanted.data(), forth.data(), first_kind);
    result->directions = CompareValues(wanted.data() + 3 * first_kind,
                                       forth.data() + 3 * first_kind, pairs.wi.size() - first_kind);
    result->all = Together(result->half_angles, result->directions);
    result->reciprocity = ReciprocityError(forth, back);
  }

  void MeasureAlbedo(BrdfMeasurement* result) {
    pool_.ParallelFor(static_cast<int>(kAlbedoDegrees.size()), [&](int i, int worker) {
      const auto evaluate = [&](int, size_t count, const Direction* wi, const Direction* wo,
                                float* rgb) { decoded_.Evaluate(worker, count, wi, wo, rgb); };
      const auto at = static_cast<size_t>(i);
      result->albedo[at] = DirectionalAlbedo(evaluate, kAlbedoDegrees[at]);
    });
  }

  void MeasureImages(BrdfMeasurement* result) {
    const brdf::Environment lights = brdf::StudioEnvironment(kLightColumns, kLightRows);
    const auto render = [&](const brdf::EvaluatePairs& evaluate, int side) {
      return brdf::RenderSphere(evaluate, lights, side, kExposure, pool_);
    };
    result->decoded_picture = ForAPerson(render(decoded_.Function(), kSheetTile));
    if (source_.table == nullptr) return;
    if (source_.simulated) return MeasureDraft(lights, result);
    const brdf::EvaluatePairs table = TableFunction(*source_.table);
    result->source_picture = ForAPerson(render(table, kSheetTile));
    result->difference_picture = DifferenceOf(result->source_picture, result->decoded_picture);
    result->image = brdf::CompareSpheres(render(table, kImageSide),
                                         render(decoded_.Function(), kImageSide), pool_);
  }

 private:
  void MeasureDraft(const brdf::Environment& lights, BrdfMeasurement* result) {
    // Of the pairs above both horizons about a half is that many on average.
    const double expected =
        0.33 * kDraftSide * kDraftSide * static_cast<double>(lights.lights.size());
    double done = 0;
    const auto on_pairs = [&](size_t count) {
      done += static_cast<double>(count) * pool_.threads();
      ProgressEvent event;
      event.stage = "verify";
      event.fraction = 0.2 + 0.8 * std::min(1.0, done / expected);
      event.message = "simulating the picture";
      progress_.OnProgress(event);
    };
    const brdf::SphereImage source = brdf::RenderSphere(
        DraftFunction(*source_.simulated, cancel_, on_pairs), lights, kDraftSide, kExposure, pool_);
    const brdf::SphereImage decoded =
        brdf::RenderSphere(decoded_.Function(), lights, kDraftSide, kExposure, pool_);
    result->source_picture = ForAPerson(Enlarged(source, kSheetTile / kDraftSide));
    result->difference_picture = DifferenceOf(
        result->source_picture, ForAPerson(Enlarged(decoded, kSheetTile / kDraftSide)));
    result->image = brdf::CompareSpheres(source, decoded, pool_);
  }

  void Draw(brdf::Draw draw, Pairs* pairs, std::vector<float>* wanted) const {
    Rng rng(kPairSeed, draw == brdf::Draw::kHalfAngles ? 0 : 1);
    for (size_t n = 0; n < kPairsOfEach; ++n) {
      Direction wi, wo;
      float rgb[3];
      brdf::DrawPair(draw, &rng, &wi, &wo);
      if (!source_.table->Evaluate(wi, wo, rgb)) continue;
      pairs->Add(wi, wo);
      wanted->insert(wanted->end(), rgb, rgb + 3);
    }
  }

  const brdf::Source& source_;
  const BrdfDecoder& decoder_;
  Decoded& decoded_;
  ThreadPool& pool_;
  const CancelToken& cancel_;
  ProgressSink& progress_;
  double disagreement_ = 0;
};

}  // namespace

std::array<double, 3> DirectionalAlbedo(const brdf::EvaluatePairs& evaluate, double theta_i_deg) {
  const double theta_i = theta_i_deg * kPi / 180;
  const double x = std::sin(theta_i);
  const double z = std::cos(theta_i);
  const Direction in = {static_cast<float>(x), 0, static_cast<float>(z)};
  const std::vector<Direction> wi(kAlbedoPhis, in);
  std::vector<Direction> wo(kAlbedoPhis);
  std::vector<double> weight(kAlbedoPhis);
  std::vector<float> rgb(3 * static_cast<size_t>(kAlbedoPhis));
  std::array<double, 3> albedo{};
  for (int t = 0; t < kAlbedoThetas; ++t) {
    const double u = (t + 0.5) / kAlbedoThetas;
    const double theta_h = u * u * kPi / 2;
    const double sine = std::sin(theta_h);
    const double cosine = std::cos(theta_h);
    // d(theta_h) d(phi_h) of a cell times the sine: its solid angle.
    const double solid_angle = kPi * u / kAlbedoThetas * 2 * kPi / kAlbedoPhis * sine;
    size_t count = 0;
    for (int p = 0; p < kAlbedoPhis; ++p) {
      const double phi = 2 * kPi * (p + 0.5) / kAlbedoPhis;
      const double hx = sine * std::cos(phi);
      const double hy = sine * std::sin(phi);
      const double along = x * hx + z * cosine;
      const double oz = 2 * along * cosine - z;
      if (!(along > 0 && oz > 0)) continue;
      wo[count] = {static_cast<float>(2 * along * hx - x), static_cast<float>(2 * along * hy),
                   static_cast<float>(oz)};
      weight[count++] = 4 * along * solid_angle * oz;
    }
    if (count == 0) continue;
    evaluate(0, count, wi.data(), wo.data(), rgb.data());
    for (size_t i = 0; i < count; ++i) {
      for (size_t c = 0; c < 3; ++c) albedo[c] += weight[i] * static_cast<double>(rgb[3 * i + c]);
    }
  }
  return albedo;
}

Result<brdf::BatchEvaluator> OpenBrdfContainer(const std::string& directory,
                                               const ManifestBrdf& model) {
  PATINA_ASSIGN(const IndexPack pack, ReadIndexPack(directory + "/" + model.grid));
  PATINA_ASSIGN(const Codebook codebook, CodebookOf(pack, directory));
  PATINA_ASSIGN(const std::vector<float> features, ExpandCorners(pack, codebook));
  PATINA_ASSIGN(const WeightBuffer network, ReadWeights(directory + "/" + model.network));
  return brdf::BatchEvaluator::Create(pack, features, network);
}

Result<BrdfMeasurement> MeasureBrdf(const std::string& directory, const ManifestBrdf& model,
                                    const brdf::Source& source, ThreadPool& pool,
                                    const CancelToken& cancel, ProgressSink& progress) {
  PATINA_ASSIGN(const brdf::BatchEvaluator evaluator, OpenBrdfContainer(directory, model));
  Decoded decoded(evaluator, pool.threads());
  PATINA_ASSIGN(const BrdfDecoder decoder, LoadBrdfDecoder(directory));
  Meter meter(source, decoder, &decoded, pool, cancel, progress);
  BrdfMeasurement result;
  const std::pair<double, void (Meter::*)(BrdfMeasurement*)> steps[] = {
      {0.1, &Meter::MeasurePairs}, {0.2, &Meter::MeasureAlbedo}, {1.0, &Meter::MeasureImages}};
  for (const auto& [fraction, step] : steps) {
    if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
    (meter.*step)(&result);
    if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
    if (!decoded.finite())
      return Fail(ErrorCode::kInternal, directory + ": decodes to a value that is not finite");
    // Images are rendered with the kernels, so both must see the same material. They differ by
    // roundings of angles only.
    if (!(meter.disagreement() < kMaxDisagreement)) {
      return Fail(ErrorCode::kInternal, directory + ": the decoder and the kernels differ by " +
                                            std::to_string(meter.disagreement()) +
                                            " in log(1 + f); please report this file");
    }
    ProgressEvent event;
    event.stage = "verify";
    event.fraction = fraction;
    progress.OnProgress(event);
  }
  return result;
}

BrdfSummary SummarizeBrdf(const BrdfMeasurement& measurement) {
  BrdfSummary summary;
  if (measurement.image) {
    summary.image_mae = measurement.image->mae_srgb;
    summary.image_rmse = measurement.image->rmse_srgb;
    summary.image_ssim = measurement.image->ssim;
  }
  summary.log1p_mae = measurement.all.mae;
  summary.reciprocity = measurement.reciprocity;
  summary.albedo = measurement.albedo;
  return summary;
}

}  // namespace patina
