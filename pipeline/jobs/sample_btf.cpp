#include "pipeline/jobs/sample_btf.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>

#include "formats/base/file_io.h"
#include "pipeline/base/rng.h"
#include "pipeline/image/image_io.h"
#include "pipeline/svbrdf/image_set.h"

namespace patina {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kMostDegrees = 75;
constexpr double kRelief = 0.008;  // height of the waves, in sides of the texture

struct Vec {
  double x, y, z;
};
double Dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec Scaled(const Vec& a, double s) { return {a.x * s, a.y * s, a.z * s}; }
Vec Unit(const Vec& a) { return Scaled(a, 1 / std::sqrt(Dot(a, a))); }

struct Look {
  std::array<double, 3> diffuse, specular;  // albedo; reflectance at the normal
  double alpha;                             // of GGX
};
constexpr Look kPlastic = {{0.06, 0.11, 0.16}, {0.04, 0.04, 0.04}, 0.5};
constexpr Look kBrass = {{0.04, 0.03, 0.01}, {0.91, 0.72, 0.38}, 0.35};

// GGX with Smith's heights, correlated, and Schlick's Fresnel; Lambert below it.
std::array<double, 3> Reflect(const Look& look, double ni, double no, double nh, double ih) {
  const double a2 = look.alpha * look.alpha;
  const double t = nh * nh * (a2 - 1) + 1;
  const double d = a2 / (kPi * t * t);
  const double v =
      0.5 / (no * std::sqrt(ni * ni * (1 - a2) + a2) + ni * std::sqrt(no * no * (1 - a2) + a2));
  const double f5 = std::pow(1 - std::clamp(ih, 0.0, 1.0), 5);
  std::array<double, 3> f{};
  for (size_t c = 0; c < 3; ++c)
    f[c] = look.diffuse[c] / kPi + d * v * (look.specular[c] + (1 - look.specular[c]) * f5);
  return f;
}

double SmoothStep(double from, double to, double x) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

std::string ImageName(size_t light, size_t view) {
  char name[64];
  std::snprintf(name, sizeof name, "l%03zu_v%03zu.exr", light, view);
  return name;
}

}  // namespace

SampleBtf::SampleBtf(uint64_t seed) {
  Rng rng(seed, 77);
  const double turn = 2 * kPi;
  // A lattice of bumps, and smaller waves across it.
  waves_ = {{4, 0, 1, turn * static_cast<double>(rng.Uniform())},
            {0, 4, 1, turn * static_cast<double>(rng.Uniform())}};
  for (int i = 0; i < 5; ++i) {
    const int x = 1 + static_cast<int>(rng.Below(7)), y = static_cast<int>(rng.Below(15)) - 7;
    waves_.push_back({x, y, 0.25, turn * static_cast<double>(rng.Uniform())});
  }
}

void SampleBtf::Relief(double u, double v, double* height, double slope[2]) const {
  *height = slope[0] = slope[1] = 0;
  for (const Wave& wave : waves_) {
    const double at = 2 * kPi * (wave.x * u + wave.y * v) + wave.phase;
    *height += wave.amplitude * std::cos(at);
    const double change = -2 * kPi * wave.amplitude * std::sin(at);
    slope[0] += wave.x * change;
    slope[1] += wave.y * change;
  }
}

void SampleBtf::Evaluate(double u, double v, const brdf::Direction& wi, const brdf::Direction& wo,
                         float rgb[3]) const {
  double height, slope[2];
  Relief(u, v, &height, slope);
  const Vec normal = Unit({-kRelief * slope[0], -kRelief * slope[1], 1});
  const Vec in = {static_cast<double>(wi.x), static_cast<double>(wi.y), static_cast<double>(wi.z)};
  const Vec out = {static_cast<double>(wo.x), static_cast<double>(wo.y), static_cast<double>(wo.z)};
  rgb[0] = rgb[1] = rgb[2] = 0;
  if (!(in.z > 0) || !(out.z > 0)) return;
  const double ni = Dot(normal, in), no = std::max(Dot(normal, out), 1e-3);
  if (!(ni > 0)) return;
  const Vec half = Unit({in.x + out.x, in.y + out.y, in.z + out.z});
  const double nh = std::clamp(Dot(normal, half), 0.0, 1.0), ih = Dot(in, half);
  const double plastic = SmoothStep(0.2, 0.7, height);
  const auto a = Reflect(kPlastic, ni, no, nh, ih), b = Reflect(kBrass, ni, no, nh, ih);
  // Valleys see less of light that comes in flat: a smooth stand-in for their shadows.
  const double open = SmoothStep(-2.5, 1.5, height + 3 * (in.z - 0.3));
  // The surface's own cosine over that of the plane, which f is taken by.
  const double tilt = ni / std::max(in.z, 0.02) * open;
  for (size_t c = 0; c < 3; ++c)
    rgb[c] = static_cast<float>(tilt * (plastic * a[c] + (1 - plastic) * b[c]));
}

std::vector<brdf::Direction> SampleDirections(int count) {
  const double golden = kPi * (3 - std::sqrt(5.0)), lowest = std::cos(kMostDegrees * kPi / 180);
  std::vector<brdf::Direction> directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (1 - lowest) * (i + 0.5) / count;
    const double s = std::sqrt(1 - z * z), phi = golden * i;
    directions.push_back({static_cast<float>(s * std::cos(phi)),
                          static_cast<float>(s * std::sin(phi)), static_cast<float>(z)});
  }
  return directions;
}

Result<std::vector<std::string>> WriteSampleBtf(const std::string& folder,
                                                const SampleBtfOptions& options, ThreadPool& pool,
                                                const CancelToken& cancel, ProgressSink& progress) {
  PATINA_TRY(MakeDirectories(folder));
  const int each = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(options.images))));
  const std::vector<brdf::Direction> directions = SampleDirections(each);
  const SampleBtf btf(options.seed);
  const auto side = static_cast<size_t>(options.size);
  const size_t count = directions.size() * directions.size();
  std::mutex mutex;
  std::optional<Error> error;
  std::atomic<size_t> done{0};
  pool.ParallelFor(static_cast<int>(count), [&](int task, int worker) {
    if (cancel.cancelled()) return;
    const size_t light = static_cast<size_t>(task) / directions.size(),
                 view = static_cast<size_t>(task) % directions.size();
    std::vector<float> rgb(3 * side * side);
    for (size_t y = 0; y < side; ++y) {
      for (size_t x = 0; x < side; ++x) {
        btf.Evaluate((static_cast<double>(x) + 0.5) / options.size,
                     (static_cast<double>(y) + 0.5) / options.size, directions[light],
                     directions[view], rgb.data() + 3 * (y * side + x));
      }
    }
    const Status written = WriteImage(folder + "/" + ImageName(light, view), WriteFormat::kExrHalf,
                                      options.size, options.size, 3, rgb.data());
    if (!written) {
      const std::lock_guard lock(mutex);
      if (!error) error = written.error();
    }
    const size_t finished = done.fetch_add(1) + 1;
    if (worker != 0) return;  // one thread speaks
    ProgressEvent event;
    event.stage = "sample";
    event.fraction = static_cast<double>(finished) / static_cast<double>(count);
    progress.OnProgress(event);
  });
  if (error) return Fail(std::move(*error));
  if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
  nlohmann::ordered_json json;
  json["version"] = 1;
  json["width"] = json["height"] = options.size;
  json["address"] = "wrap";
  json["values"] = "brdf";
  const std::string list = folder + "/bumps" + std::string(svbrdf::kImageSetSuffix);
  std::vector<std::string> paths = {list};
  for (size_t i = 0; i < count; ++i) {
    const size_t light = i / directions.size(), view = i % directions.size();
    const auto xyz = [&](const brdf::Direction& d) { return nlohmann::json{d.x, d.y, d.z}; };
    json["images"].push_back({{"file", ImageName(light, view)},
                              {"light", xyz(directions[light])},
                              {"view", xyz(directions[view])}});
    paths.push_back(folder + "/" + ImageName(light, view));
  }
  const std::string text = json.dump(1) + "\n";
  PATINA_TRY(WriteFileDurably(list, std::string_view(text)));
  return paths;
}

}  // namespace patina
