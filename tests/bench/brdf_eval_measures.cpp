#include "tests/bench/brdf_eval_measures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "pipeline/base/cpu_time.h"
#include "pipeline/base/rng.h"
#include "pipeline/brdf/sample_pool.h"
#include "pipeline/jobs/measure_brdf.h"

namespace patina::bench {
namespace {

using brdf::Direction;

constexpr size_t kPairsOfEach = 65536;
constexpr size_t kGhostPairs = 16384;
constexpr uint64_t kPairSeed = 20230;
constexpr size_t kPairsPerTask = 1024;
constexpr double kRadian = std::numbers::pi / 180;
constexpr double kGhostDegrees[] = {2, 4};
constexpr int kGhostSides = 8;

Direction FromAngles(double theta_degrees, double phi_degrees) {
  const double s = std::sin(theta_degrees * kRadian), phi = phi_degrees * kRadian;
  return {static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)),
          static_cast<float>(std::cos(theta_degrees * kRadian))};
}

// w turned by an angle towards one of kGhostSides sides.
Direction Turned(const Direction& w, double degrees, int side) {
  const double x = static_cast<double>(w.x), y = static_cast<double>(w.y),
               z = static_cast<double>(w.z);
  // A frame about w (Duff et al. 2017), z >= 0.
  const double a = -1 / (1 + z), b = x * y * a;
  const double t[3] = {1 + x * x * a, b, -x}, u[3] = {b, 1 + y * y * a, -y};
  const double turn = 2 * std::numbers::pi * side / kGhostSides;
  const double s = std::sin(degrees * kRadian), c = std::cos(degrees * kRadian);
  const double along = s * std::cos(turn), across = s * std::sin(turn);
  return {static_cast<float>(c * x + along * t[0] + across * u[0]),
          static_cast<float>(c * y + along * t[1] + across * u[1]),
          static_cast<float>(c * z + along * t[2] + across * u[2])};
}

template <class Body>  // body(begin, end, worker)
void ForPairs(size_t count, ThreadPool& pool, Body&& body) {
  const auto tasks = static_cast<int>((count + kPairsPerTask - 1) / kPairsPerTask);
  pool.ParallelFor(tasks, [&](int task, int worker) {
    const size_t begin = static_cast<size_t>(task) * kPairsPerTask;
    body(begin, std::min(count, begin + kPairsPerTask), worker);
  });
}

std::vector<float> EvaluateAll(const brdf::EvaluatePairs& function,
                               const std::vector<Direction>& wi, const std::vector<Direction>& wo,
                               ThreadPool& pool) {
  std::vector<float> rgb(3 * wi.size());
  ForPairs(wi.size(), pool, [&](size_t begin, size_t end, int worker) {
    function(worker, end - begin, wi.data() + begin, wo.data() + begin, rgb.data() + 3 * begin);
  });
  return rgb;
}

struct Log1pErrors {
  double mse = 0, mae = 0;
};

Log1pErrors CompareLog1p(const std::vector<float>& wanted, const std::vector<float>& got) {
  Log1pErrors errors;
  for (size_t i = 0; i < wanted.size(); ++i) {
    const double d =
        std::log1p(static_cast<double>(got[i])) - std::log1p(static_cast<double>(wanted[i]));
    errors.mse += d * d;
    errors.mae += std::abs(d);
  }
  const auto count = static_cast<double>(std::max<size_t>(wanted.size(), 1));
  errors.mse /= count;
  errors.mae /= count;
  return errors;
}

void AddDifference(const std::vector<float>& a, const std::vector<float>& b, double* difference,
                   double* sum) {
  for (size_t i = 0; i < a.size(); ++i) {
    *difference += std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
    *sum += (static_cast<double>(a[i]) + static_cast<double>(b[i])) / 2;
  }
}

std::vector<std::array<double, 3>> Albedos(const brdf::EvaluatePairs& function, ThreadPool& pool) {
  std::vector<std::array<double, 3>> albedos(kAlbedoDegrees.size());
  pool.ParallelFor(static_cast<int>(albedos.size()), [&](int i, int worker) {
    const auto of_worker = [&](int, size_t count, const Direction* wi, const Direction* wo,
                               float* rgb) { function(worker, count, wi, wo, rgb); };
    albedos[i] = DirectionalAlbedo(of_worker, kAlbedoDegrees[i]);
  });
  return albedos;
}

double MeanOf(const std::array<double, 3>& rgb) { return (rgb[0] + rgb[1] + rgb[2]) / 3; }

int AboveOne(const std::vector<std::array<double, 3>>& albedos) {
  int count = 0;
  for (const auto& albedo : albedos) {
    for (const double a : albedo) count += a > 1 ? 1 : 0;
  }
  return count;
}

void TakeImage(const brdf::SphereImage& wanted, const brdf::SphereImage& got, ThreadPool& pool,
               Values* values) {
  const brdf::ImageError error = brdf::CompareSpheres(wanted, got, pool);
  double inside = 0;
  for (const uint8_t pixel : wanted.inside) inside += pixel;
  const double share = inside / static_cast<double>(wanted.inside.size());
  const double masked[4] = {error.mae_linear, error.rmse_linear, error.mae_srgb, error.rmse_srgb};
  for (int i = 0; i < 4; ++i) {
    const bool squares = i % 2 == 1;
    (*values)[kMae + i] = masked[i];
    (*values)[kMaeFrame + i] = masked[i] * (squares ? std::sqrt(share) : share);
  }
  (*values)[kSsim] = error.ssim;
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace

brdf::EvaluatePairs FunctionOf(std::shared_ptr<const brdf::Table> table) {
  return [table = std::move(table)](int, size_t count, const Direction* wi, const Direction* wo,
                                    float* rgb) {
    for (size_t i = 0; i < count; ++i) {
      table->Evaluate(wi[i], wo[i], rgb + 3 * i);
      for (size_t c = 0; c < 3; ++c) rgb[3 * i + c] = std::max(rgb[3 * i + c], 0.0f);
    }
  };
}

void Truth::Pairs::Add(const Direction& i, const Direction& o, const float rgb[3]) {
  wi.push_back(i);
  wo.push_back(o);
  for (int c = 0; c < 3; ++c) wanted.push_back(std::max(rgb[c], 0.0f));
}

Truth::Truth(std::shared_ptr<const brdf::Table> table,
             std::span<const brdf::Environment> environments, int side, ThreadPool& pool)
    : function_(FunctionOf(table)),
      table_(std::move(table)),
      environments_(environments.begin(), environments.end()),
      side_(side),
      images_(brdf::RenderSpheres(function_, environments_, side, kExposure, pool)),
      albedo_(Albedos(function_, pool)) {
  DrawPairs(pool);
  FindNeighbourhoods(pool);
}

Truth::Pairs Truth::ValidPairs(const std::vector<Direction>& wi, const std::vector<Direction>& wo,
                               ThreadPool& pool) const {
  std::vector<float> rgb(3 * wi.size());
  std::vector<uint8_t> valid(wi.size());
  ForPairs(wi.size(), pool, [&](size_t begin, size_t end, int) {
    for (size_t i = begin; i < end; ++i)
      valid[i] = table_->Evaluate(wi[i], wo[i], rgb.data() + 3 * i) ? 1 : 0;
  });
  Pairs pairs;
  for (size_t i = 0; i < wi.size(); ++i) {
    if (valid[i] != 0) pairs.Add(wi[i], wo[i], rgb.data() + 3 * i);
  }
  return pairs;
}

void Truth::DrawPairs(ThreadPool& pool) {
  std::vector<Direction> wi, wo;
  const auto take = [&] {
    Pairs pairs = ValidPairs(wi, wo, pool);
    wi.clear();
    wo.clear();
    return pairs;
  };
  for (const brdf::Draw draw : {brdf::Draw::kHalfAngles, brdf::Draw::kDirections}) {
    wi.resize(kPairsOfEach);
    wo.resize(kPairsOfEach);
    Rng rng(kPairSeed, draw == brdf::Draw::kHalfAngles ? 0 : 1);
    for (size_t n = 0; n < kPairsOfEach; ++n) brdf::DrawPair(draw, &rng, &wi[n], &wo[n]);
    (draw == brdf::Draw::kHalfAngles ? table_pairs_ : direction_pairs_) = take();
  }
  for (int theta = 0; theta <= 80; ++theta) {
    wi.push_back(FromAngles(theta, 0));
    wo.push_back(FromAngles(theta, 180));
  }
  peaks_ = take();
  constexpr double kGrazing[] = {80, 85, 88, 89, 89.5, 89.9};
  constexpr double kOthers[] = {0, 20, 40, 60, 70, 80, 85, 88, 89, 89.5, 89.9};
  for (const double one : kGrazing) {
    for (const double other : kOthers) {
      for (int phi = 0; phi < 360; phi += 10) {
        const Direction a = FromAngles(one, 0), b = FromAngles(other, phi);
        wi.push_back(a), wo.push_back(b);
        wi.push_back(b), wo.push_back(a);
      }
    }
  }
  grazing_ = take();
}

void Truth::FindNeighbourhoods(ThreadPool& pool) {
  ghost_pairs_ = std::min(kGhostPairs, direction_pairs_.size());
  neighbourhood_.resize(3 * ghost_pairs_);
  ForPairs(ghost_pairs_, pool, [&](size_t begin, size_t end, int) {
    for (size_t i = begin; i < end; ++i) {
      float* largest = neighbourhood_.data() + 3 * i;
      const auto take = [&](const Direction& wi, const Direction& wo) {
        float rgb[3];
        if (!table_->Evaluate(wi, wo, rgb)) return;
        for (int c = 0; c < 3; ++c) largest[c] = std::max(largest[c], rgb[c] * wi.z);
      };
      const Direction &wi = direction_pairs_.wi[i], &wo = direction_pairs_.wo[i];
      take(wi, wo);
      for (const double degrees : kGhostDegrees) {
        for (int s = 0; s < kGhostSides; ++s) {
          take(wi, Turned(wo, degrees, s));
          take(Turned(wi, degrees, s), wo);
        }
      }
    }
  });
}

std::vector<Values> Truth::Measure(const brdf::EvaluatePairs& model, ThreadPool& pool) const {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  Values values;
  values.fill(kNan);
  values[kMinimum] = std::numeric_limits<double>::infinity();
  values[kFinite] = 1;
  const auto evaluate = [&](const std::vector<Direction>& wi, const std::vector<Direction>& wo) {
    std::vector<float> rgb = EvaluateAll(model, wi, wo, pool);
    for (const float value : rgb) {
      if (!std::isfinite(value)) values[kFinite] = 0;
      values[kMinimum] = std::min(values[kMinimum], static_cast<double>(value));
    }
    return rgb;
  };

  double difference = 0, sum = 0;
  for (const Pairs* pairs : {&table_pairs_, &direction_pairs_}) {
    const std::vector<float> forth = evaluate(pairs->wi, pairs->wo);
    const Log1pErrors errors = CompareLog1p(pairs->wanted, forth);
    AddDifference(forth, evaluate(pairs->wo, pairs->wi), &difference, &sum);
    if (pairs == &table_pairs_) {
      values[kLog1pMseTable] = errors.mse;
      continue;
    }
    values[kLog1pMseDirections] = errors.mse;
    values[kLog1pMaeDirections] = errors.mae;
    values[kGhostMax] = values[kGhostMean] = 0;
    for (size_t i = 0; i < 3 * ghost_pairs_; ++i) {
      const double excess = static_cast<double>(forth[i] * pairs->wi[i / 3].z) -
                            static_cast<double>(neighbourhood_[i]);
      values[kGhostMax] = std::max(values[kGhostMax], excess);
      values[kGhostMean] +=
          std::max(excess, 0.0) / static_cast<double>(3 * std::max<size_t>(ghost_pairs_, 1));
    }
  }
  values[kReciprocity] = sum > 0 ? difference / sum : 0;

  const std::vector<float> peaks = evaluate(peaks_.wi, peaks_.wo);
  double relative = 0, count = 0;
  for (size_t i = 0; i < peaks.size(); ++i) {
    if (!(peaks_.wanted[i] > 0)) continue;
    relative += std::abs(static_cast<double>(peaks[i]) / static_cast<double>(peaks_.wanted[i]) - 1);
    ++count;
  }
  if (count > 0) values[kPeak] = relative / count;

  const std::vector<float> grazing = evaluate(grazing_.wi, grazing_.wo);
  float largest = 0, largest_wanted = 0;
  for (size_t i = 0; i < grazing.size(); ++i) {
    largest = std::max(largest, grazing[i]);
    largest_wanted = std::max(largest_wanted, grazing_.wanted[i]);
  }
  if (largest_wanted > 0)
    values[kGrazingRatio] = static_cast<double>(largest) / static_cast<double>(largest_wanted);

  const auto albedos = Albedos(model, pool);
  values[kAlbedoError] = 0;
  for (size_t a = 0; a < albedos.size(); ++a) {
    values[kAlbedo0 + a] = MeanOf(albedos[a]);
    values[kTrueAlbedo0 + a] = MeanOf(albedo_[a]);
    for (int c = 0; c < 3; ++c) {
      values[kAlbedoError] +=
          std::abs(albedos[a][c] - albedo_[a][c]) / static_cast<double>(3 * albedos.size());
    }
  }
  values[kAlbedoAboveOne] = AboveOne(albedos);
  values[kTrueAlbedoAboveOne] = AboveOne(albedo_);

  const auto images = brdf::RenderSpheres(model, environments_, side_, kExposure, pool);
  std::vector<Values> all(images.size(), values);
  for (size_t e = 0; e < images.size(); ++e) TakeImage(images_[e], images[e], pool, &all[e]);
  return all;
}

Speed MeasureSpeed(const brdf::EvaluatePairs& function, const brdf::EvaluatePairs& other) {
  constexpr int kRounds = 7;
  constexpr size_t kBatch = 4096;
  constexpr double kSeconds = 0.008;
  std::vector<Direction> wi(kBatch), wo(kBatch);
  Rng rng(3);
  for (size_t n = 0; n < kBatch; ++n) brdf::DrawPair(brdf::Draw::kDirections, &rng, &wi[n], &wo[n]);
  std::vector<float> rgb(3 * kBatch);
  const auto nanoseconds = [&](const brdf::EvaluatePairs& f) {
    const double start = ThreadCpuSeconds();
    double now = start;
    int calls = 0;
    for (; now - start < kSeconds; now = ThreadCpuSeconds(), ++calls)
      f(0, kBatch, wi.data(), wo.data(), rgb.data());
    return 1e9 * (now - start) / calls / kBatch;
  };
  std::vector<double> times, ratios;
  for (int round = 0; round < kRounds; ++round) {
    const double theirs = nanoseconds(other);
    times.push_back(nanoseconds(function));
    ratios.push_back(times.back() / theirs);
  }
  return {Median(times), Median(ratios)};
}

}  // namespace patina::bench
