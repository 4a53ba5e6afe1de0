#include "pipeline/jobs/sample_brdf.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "formats/base/check.h"
#include "formats/base/file_io.h"
#include "formats/base/names.h"

namespace patina {
namespace {

using brdf::Direction;

constexpr double kPi = std::numbers::pi;
constexpr int kSparseSamples = 448;
constexpr double kBrushedAlphaX = 0.2;
constexpr double kBrushedAlphaY = 0.02;

struct Rgb {
  double r, g, b;
};

struct Vector {
  double x, y, z;
};

Vector ToVector(const Direction& w) {
  return {static_cast<double>(w.x), static_cast<double>(w.y), static_cast<double>(w.z)};
}

double Dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// The half vector, and the cosine of the angle between it and either direction: of its length, so
// that it is the same for both, however their lengths are rounded.
struct Half {
  Half(const Vector& a, const Vector& b) {
    const Vector s{a.x + b.x, a.y + b.y, a.z + b.z};
    const double length = std::sqrt(Dot(s, s));
    h = {s.x / length, s.y / length, s.z / length};
    cosine = std::min(length / 2, 1.0);
  }
  Vector h;
  double cosine;
};

double Power5(double x) { return x * x * x * x * x; }

// Smith's Lambda of GGX (Heitz 2014, Eq. 72).
double Lambda(const Vector& w, double alpha_x, double alpha_y) {
  const double x = alpha_x * w.x;
  const double y = alpha_y * w.y;
  return 0.5 * (std::sqrt(1 + (x * x + y * y) / (w.z * w.z)) - 1);
}

// The GGX lobe without Fresnel's term: D G2 / (4 cos cos), height-correlated.
double GgxLobe(const Vector& wi, const Vector& wo, const Vector& h, double alpha_x,
               double alpha_y) {
  const double x = h.x / alpha_x;
  const double y = h.y / alpha_y;
  const double sum = x * x + y * y + h.z * h.z;
  const double density = 1 / (kPi * alpha_x * alpha_y * sum * sum);
  const double shadow = 1 / (1 + Lambda(wi, alpha_x, alpha_y) + Lambda(wo, alpha_x, alpha_y));
  return density * shadow / (4 * wi.z * wo.z);
}

Rgb Conductor(const Vector& wi, const Vector& wo, const Rgb& f0, double alpha_x, double alpha_y) {
  const Half half(wi, wo);
  const double lobe = GgxLobe(wi, wo, half.h, alpha_x, alpha_y);
  const double edge = Power5(1 - half.cosine);
  const auto schlick = [&](double f) { return lobe * (f + (1 - f) * edge); };
  return {schlick(f0.r), schlick(f0.g), schlick(f0.b)};
}

Rgb Plastic(const Vector& wi, const Vector& wo) {
  const Half half(wi, wo);
  const double f0 = 0.04;
  const double fresnel = f0 + (1 - f0) * Power5(1 - half.cosine);
  const double coat = GgxLobe(wi, wo, half.h, 0.15, 0.15) * fresnel;
  // Ashikhmin and Shirley's diffuse term (2000, Eq. 5): what the coat lets through, reciprocal.
  const double diffuse =
      28 / (23 * kPi) * (1 - f0) * (1 - Power5(1 - wi.z / 2)) * (1 - Power5(1 - wo.z / 2));
  return {coat + 0.45 * diffuse, coat + 0.06 * diffuse, coat + 0.04 * diffuse};
}

double Bump(double x, double centre, double width) {
  const double t = (x - centre) / width;
  return std::exp(-t * t);
}

// Reciprocal, as every term keeps its value when wi and wo are exchanged.
Rgb Rings(const Vector& wi, const Vector& wo) {
  const double diffuse = 0.12 / kPi;
  // A side of the plane of incidence: the sine of the azimuth difference changes its sign with the
  // exchange, and so does the difference of the heights.
  const double side = 0.5 + 0.5 * std::tanh(50 * (wi.x * wo.y - wi.y * wo.x) * (wi.z - wo.z));
  const double theta_i = std::atan2(std::sqrt(wi.x * wi.x + wi.y * wi.y), wi.z);
  const double theta_o = std::atan2(std::sqrt(wo.x * wo.x + wo.y * wo.y), wo.z);
  const double ring = Bump(theta_i, 0.6, 0.08) + Bump(theta_o, 0.6, 0.08) +
                      0.7 * (Bump(theta_i, 1.05, 0.06) + Bump(theta_o, 1.05, 0.06));
  const double retro = 0.5 * std::exp((std::min(Dot(wi, wo), 1.0) - 1) / 0.01);
  // Interference of a film of index 1.4 and 450 nm on a gloss lobe: the path difference is 2 n d
  // cos(theta_t).
  const Half half(wi, wo);
  const double cos_t = std::sqrt(1 - (1 - half.cosine * half.cosine) / (1.4 * 1.4));
  const double lobe = GgxLobe(wi, wo, half.h, 0.2, 0.2);
  const auto film = [&](double wavelength_nm) {
    const double phase = 2 * kPi * 2 * 1.4 * 450 * cos_t / wavelength_nm;
    return lobe * 0.25 * (1 - std::cos(phase));
  };
  const double rings = 0.25 * side * ring;
  return {diffuse + 0.5 * rings + retro + film(610), diffuse + rings + retro + film(550),
          1.5 * diffuse + 0.8 * rings + 0.6 * retro + film(460)};
}

// SplitMix64: the same numbers on every machine.
class Noise {
 public:
  explicit Noise(uint64_t seed) : state_(seed) {}
  double Unit() {
    uint64_t z = state_ += 0x9E3779B97F4A7C15ull;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
  }
  // Of mean 0 and variance 1: the sum of four uniform numbers, within +-3.5 and near enough to a
  // Gaussian.
  double Normal() { return (Unit() + Unit() + Unit() + Unit() - 2) * std::numbers::sqrt3; }

 private:
  uint64_t state_;
};

// Half of the pairs have directions of even density over the solid angle, half lie about the
// highlight; all below 85 degrees, as an instrument's would. Roberts' R4 sequence: fractions of
// multiples of powers of 1/g, g^5 = g + 1.
std::vector<std::pair<Direction, Direction>> SparseDirections() {
  constexpr double kSteps[4] = {0.85667488385450287, 0.73389185662773640, 0.62870672103860474,
                                0.53859725722360877};
  const auto direction = [](double z, double phi) {
    const double s = std::sqrt(1 - z * z);
    return Vector{s * std::cos(phi), s * std::sin(phi), z};
  };
  const auto rounded = [](const Vector& v) {
    return Direction{static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
  };
  const double min_z = std::cos(85 * kPi / 180);
  std::vector<std::pair<Direction, Direction>> pairs;
  for (int n = 1; pairs.size() < kSparseSamples; ++n) {
    double u[4];
    for (int i = 0; i < 4; ++i) {
      u[i] = 0.5 + n * kSteps[i];
      u[i] -= std::floor(u[i]);
    }
    const Vector wi = direction(min_z + (1 - min_z) * u[0], 2 * kPi * u[1]);
    Vector wo = direction(min_z + (1 - min_z) * u[2], 2 * kPi * u[3]);
    if (pairs.size() % 2 == 1) {
      const double theta_h = u[2] * u[2] * 0.6;
      const Vector h = direction(std::cos(theta_h), 2 * kPi * u[3]);
      const double d = 2 * Dot(wi, h);
      wo = {d * h.x - wi.x, d * h.y - wi.y, d * h.z - wi.z};
      if (wo.z < min_z) continue;
    }
    pairs.emplace_back(rounded(wi), rounded(wo));
  }
  return pairs;
}

}  // namespace

void EvaluateAnalytic(AnalyticBrdf material, const Direction& wi, const Direction& wo,
                      float rgb[3]) {
  rgb[0] = rgb[1] = rgb[2] = 0;
  if (!(wi.z > 0 && wo.z > 0)) return;
  const Vector i = ToVector(wi);
  const Vector o = ToVector(wo);
  Rgb f{0, 0, 0};
  switch (material) {
    case AnalyticBrdf::kPlastic:
      f = Plastic(i, o);
      break;
    case AnalyticBrdf::kMetal:
      f = Conductor(i, o, {1.0, 0.77, 0.34}, 0.25, 0.25);
      break;
    case AnalyticBrdf::kMirror:
      f = Conductor(i, o, {0.95, 0.93, 0.88}, 0.00175, 0.00175);
      break;
    case AnalyticBrdf::kBrushed:
      f = Conductor(i, o, {0.91, 0.92, 0.92}, kBrushedAlphaX, kBrushedAlphaY);
      break;
    case AnalyticBrdf::kRings:
      f = Rings(i, o);
      break;
  }
  rgb[0] = static_cast<float>(f.r);
  rgb[1] = static_cast<float>(f.g);
  rgb[2] = static_cast<float>(f.b);
}

brdf::BrdfFunction MeasuredBrdf(AnalyticBrdf material, const MeasurementNoise& noise) {
  return [material, noise, random = Noise(noise.seed)](const Direction& wi, const Direction& wo,
                                                       float rgb[3]) mutable {
    EvaluateAnalytic(material, wi, wo, rgb);
    const bool failed = random.Unit() < noise.invalid_share;
    for (int c = 0; c < 3; ++c) {
      const double factor = 1 + noise.relative * random.Normal();
      const double offset = noise.absolute * random.Normal();
      const double value = static_cast<double>(rgb[c]) * factor + offset;
      rgb[c] = failed ? -1 : static_cast<float>(std::max(value, 0.0));
    }
  };
}

const std::vector<std::string>& SampleBrdfNames() {
  static const std::vector<std::string> names = {
      "plastic.binary",     "metal.binary", "mirror.binary", "rings.binary",
      "rings_noisy.binary", "brushed.bsdf", "brushed.bin",   "sparse.csv"};
  return names;
}

std::vector<uint8_t> EncodeSampleBrdf(const std::string& name, const MeasurementNoise& noise) {
  const auto clean = [](AnalyticBrdf material) { return MeasuredBrdf(material, {}); };
  if (name == "plastic.binary") return brdf::EncodeMerl(clean(AnalyticBrdf::kPlastic));
  if (name == "metal.binary") return brdf::EncodeMerl(clean(AnalyticBrdf::kMetal));
  if (name == "mirror.binary") return brdf::EncodeMerl(clean(AnalyticBrdf::kMirror));
  if (name == "rings.binary") return brdf::EncodeMerl(clean(AnalyticBrdf::kRings));
  if (name == "rings_noisy.binary")
    return brdf::EncodeMerl(MeasuredBrdf(AnalyticBrdf::kRings, noise));
  if (name == "brushed.bin") return brdf::EncodeUtia(clean(AnalyticBrdf::kBrushed));
  if (name == "brushed.bsdf") {
    brdf::RglLayout layout;
    layout.isotropic = false;
    layout.alpha_x = kBrushedAlphaX;
    layout.alpha_y = kBrushedAlphaY;
    layout.theta_count = 12;
    layout.phi_count = 9;
    layout.reduction = 4;
    layout.warp_side = 192;
    layout.colour_side = 64;
    return brdf::EncodeRgl(clean(AnalyticBrdf::kBrushed), layout, "Brushed metal");
  }
  PATINA_CHECK(name == "sparse.csv");
  const auto pairs = SparseDirections();
  const std::string csv = brdf::EncodeSparseCsv(clean(AnalyticBrdf::kPlastic), pairs, true);
  return {csv.begin(), csv.end()};
}

Status WriteSampleBrdfs(const std::string& folder, const SampleBrdfOptions& options) {
  const MeasurementNoise& noise = options.noise;
  const auto within = [](double value, double max) { return value >= 0 && value <= max; };
  if (!within(noise.relative, 1e3) || !within(noise.absolute, 1e3) ||
      !within(noise.invalid_share, 1)) {
    return Fail(ErrorCode::kInvalidArgument,
                "measurement noise of " + std::to_string(noise.relative) + " relative and " +
                    std::to_string(noise.absolute) + " absolute with a share of " +
                    std::to_string(noise.invalid_share) +
                    " invalid: give 0 to 1000, and a share of 0 to 1");
  }
  for (const std::string& name : options.files) {
    const auto& names = SampleBrdfNames();
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      std::string known;
      for (const std::string& known_name : names) known += (known.empty() ? "" : ", ") + known_name;
      return Fail(ErrorCode::kInvalidArgument,
                  "no sample file is called " + QuoteForMessage(name) + "; there are " + known);
    }
  }
  PATINA_TRY(MakeDirectories(folder));
  for (const std::string& name : SampleBrdfNames()) {
    const auto& wanted = options.files;
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), name) == wanted.end()) continue;
    const std::vector<uint8_t> bytes = EncodeSampleBrdf(name, noise);
    PATINA_TRY(WriteFileDurably(folder + "/" + name, std::span<const uint8_t>(bytes)));
  }
  return {};
}

}  // namespace patina
