// The header-only BRDF decoder against a slow evaluation in double precision, written from
// FORMATS.md, that shares only the lattice (tested against healpix_cxx) with anything else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"
#include "formats/decoder/patina_brdf_decoder.h"
#include "tests/formats/sample_brdf.h"

namespace patina {
namespace {

using test::BrdfSampleOptions;
using test::Random;
using test::StageBrdfSample;
using test::TemporaryDirectory;
using LoadStatus = BrdfDecoder::LoadStatus;

std::string Publish(const TemporaryDirectory& out, uint64_t seed,
                    const BrdfSampleOptions& options = {}) {
  auto staging = StageBrdfSample(out.path(), "asset", seed, options);
  if (!staging) return staging.error().message;
  const auto published = staging->Publish();
  return published ? published->directory : published.error().message;
}

class SlowDecoder {
 public:
  explicit SlowDecoder(const std::string& directory)
      : pack_(*ReadIndexPack(directory + "/grid.hpx")),
        features_(*ExpandCorners(pack_, *CodebookOf(pack_, directory))),
        network_(*ReadWeights(directory + "/decoder.weights")) {}

  // f, and a bound of what rounding in single precision may change.
  void Evaluate(const float wi_single[3], const float wo_single[3], double f[3],
                double bound[3]) const {
    double wi[3], wo[3];
    std::copy_n(wi_single, 3, wi);
    std::copy_n(wo_single, 3, wo);
    std::fill_n(f, 3, 0.0);
    std::fill_n(bound, 3, 0.0);
    if (!(wi[2] > 0) || !(wo[2] > 0)) return;
    if (pack_.canonical_order && wo[2] > wi[2]) std::swap(wi, wo);
    double angles[3];
    AngleInputs(wi, wo, angles);
    double half[2], length = 0;
    for (int d = 0; d < 3; ++d) length += (wi[d] + wo[d]) * (wi[d] + wo[d]);
    for (int d = 0; d < 2; ++d) {
      const double h = (wi[d] + wo[d]) / std::sqrt(length);
      half[d] = std::copysign(std::log(1 + 200 * std::abs(h)) / std::log(201.0), h);
    }
    if (pack_.isotropic) healpix::FoldIsotropic(wi, wo);
    std::vector<double> x = Feature(0, wi);
    const std::vector<double> second = Feature(1, wo);
    x.insert(x.end(), second.begin(), second.end());
    if (pack_.angle_inputs) x.insert(x.end(), angles, angles + 3);
    if (pack_.half_vector_inputs) x.insert(x.end(), half, half + 2);
    // A direction of single precision places a point in its pixel to about 1e-6 Nside; l has a
    // slope of 70 at the normal, where theta_h is known to 1e-7; q hangs on a difference that
    // cancels, and is checked away from there.
    std::vector<double> error(x.size(), 4e-6 * pack_.nside + 1e-4);
    const size_t layers = network_.tensors.size() / 2;
    for (size_t l = 0; l < layers; ++l) {
      const WeightTensor& weight = network_.tensors[2 * l];
      const WeightTensor& bias = network_.tensors[2 * l + 1];
      std::vector<double> y, y_error;
      for (size_t o = 0; o < weight.shape[0]; ++o) {
        double sum = HalfToFloat(bias.elements[o]);
        double sum_error = 0;
        for (size_t i = 0; i < x.size(); ++i) {
          const double w = HalfToFloat(weight.elements[o * x.size() + i]);
          sum += w * x[i];
          sum_error += std::abs(w) * (error[i] + std::abs(x[i]) * 4e-6);
        }
        y.push_back(l + 1 < layers ? std::max(sum, 0.0) : sum);
        y_error.push_back(sum_error);
      }
      x = y;
      error = y_error;
    }
    for (int c = 0; c < 3; ++c) {
      f[c] = std::max(0.0, std::exp(std::min(x[c], 12.0)) - 1);
      bound[c] = (f[c] + 1) * std::expm1(error[c]) + 1e-6;
    }
  }

  static void AngleInputs(const double wi[3], const double wo[3], double out[3]) {
    double h[3];
    double sum = 0;
    double difference = 0;
    for (int d = 0; d < 3; ++d) {
      h[d] = wi[d] + wo[d];
      sum += h[d] * h[d];
      difference += (wi[d] - wo[d]) * (wi[d] - wo[d]);
    }
    for (double& value : h) value /= std::sqrt(sum);
    const double theta_h = std::acos(std::min(h[2], 1.0));
    const double theta_d = std::atan2(std::sqrt(difference), std::sqrt(sum));
    const double phi_h = std::hypot(h[0], h[1]) < 1e-7 ? 0 : std::atan2(h[1], h[0]);
    // wi turned by -phi_h about z, then by -theta_h about y.
    const double x = std::cos(phi_h) * wi[0] + std::sin(phi_h) * wi[1];
    const double dy = std::cos(phi_h) * wi[1] - std::sin(phi_h) * wi[0];
    const double dx = std::cos(theta_h) * x - std::sin(theta_h) * wi[2];
    const double square = dx * dx + dy * dy;
    out[0] = 2 * std::log(1 + 200 * theta_h) / 5.75 - 1;
    out[1] = 4 * theta_d / M_PI - 1;
    out[2] = square < 1e-12 ? 0 : 2 * dx * dy / square;
  }

 private:
  std::vector<double> Feature(size_t hemisphere, const double direction[3]) const {
    const auto lookup = healpix::LookUp(pack_.nside, direction, pack_.interpolation);
    const auto k = static_cast<size_t>(pack_.primitive_size);
    const auto corners = static_cast<size_t>(healpix::CornerCount(pack_.nside));
    std::vector<double> feature(k, 0.0);
    for (int c = 0; c < 4; ++c) {
      const float* from =
          features_.data() + (hemisphere * corners + static_cast<size_t>(lookup.index[c])) * k;
      for (size_t i = 0; i < k; ++i) feature[i] += lookup.weight[c] * static_cast<double>(from[i]);
    }
    return feature;
  }

  IndexPack pack_;
  std::vector<float> features_;
  WeightBuffer network_;
};

struct Pair {
  float wi[3];
  float wo[3];
};

void SetDirection(float d[3], double theta, double phi) {
  d[0] = static_cast<float>(std::sin(theta) * std::cos(phi));
  d[1] = static_cast<float>(std::sin(theta) * std::sin(phi));
  d[2] = static_cast<float>(std::cos(theta));
}

std::vector<Pair> TestPairs(Random& random, int count) {
  std::vector<Pair> pairs;
  for (int i = 0; i < count; ++i) {
    Pair pair;
    double theta[2], phi[2];
    for (int s = 0; s < 2; ++s) {
      theta[s] = std::acos(random.Unit());
      phi[s] = 2 * M_PI * random.Unit();
      if (i % 8 == 1) theta[s] = 0.01 * random.Unit();                   // near the pole
      if (i % 8 == 2) theta[s] = M_PI / 2 * (1 - 1e-3 * random.Unit());  // grazing
      if (i % 8 == 3) phi[s] = M_PI / 4 * random.Below(8);
    }
    if (i % 8 == 4) theta[0] = 0;
    SetDirection(pair.wi, theta[0], phi[0]);
    SetDirection(pair.wo, theta[1], phi[1]);
    pairs.push_back(pair);
  }
  return pairs;
}

TEST(BrdfDecoder, AgreesWithAnEvaluationInDoublePrecision) {
  Random random(1);
  for (int variant = 0; variant < 24; ++variant) {
    const TemporaryDirectory out;
    BrdfSampleOptions options;
    options.pack.nside = std::vector<int>{1, 4, 6, 9, 32, 64}[static_cast<size_t>(variant % 6)];
    options.pack.primitive_size = 1 + random.Below(16);
    options.pack.interpolation = static_cast<Interpolation>(variant % 3);
    options.pack.isotropic = variant % 2 == 0;
    options.pack.canonical_order = variant / 2 % 2 == 0;
    options.pack.angle_inputs = variant % 5 != 0;
    options.pack.half_vector_inputs = options.pack.angle_inputs && variant % 5 != 1;
    options.pack.stored = variant % 4 == 0 ? 1.0 : 0.6;
    options.hidden.assign(static_cast<size_t>(variant % 4), 8 + variant);
    options.shared_codebook = variant % 7 == 3;
    const std::string directory = Publish(out, 100 + static_cast<uint64_t>(variant), options);
    BrdfDecoder decoder;
    std::string problem;
    ASSERT_EQ(BrdfDecoder::Load(out / "asset", &decoder, &problem), LoadStatus::kOk) << problem;
    EXPECT_EQ(decoder.nside(), options.pack.nside);
    const SlowDecoder slow(directory);
    int compared = 0;
    int positive = 0;
    for (const Pair& pair : TestPairs(random, 2000)) {
      // The inputs jump where two directions coincide in azimuth (q), and the weights of the other
      // two rules at the edges of pixels.
      double wi[3], wo[3], angles[3];
      std::copy_n(pair.wi, 3, wi);
      std::copy_n(pair.wo, 3, wo);
      double distance = 0;
      for (int d = 0; d < 3; ++d) distance += (wi[d] - wo[d]) * (wi[d] - wo[d]);
      if (distance < 1e-3) continue;
      // Where theta_h is small, h and with it q are known to fewer digits.
      SlowDecoder::AngleInputs(wi, wo, angles);
      if (angles[0] < -0.6 && options.pack.angle_inputs) continue;
      if (options.pack.canonical_order && std::abs(wi[2] - wo[2]) < 1e-6) continue;
      if (options.pack.interpolation != Interpolation::kBilinear) {
        double a[3], b[3];
        std::copy_n(wi, 3, a);
        std::copy_n(wo, 3, b);
        if (options.pack.isotropic) {
          if (options.pack.canonical_order && b[2] > a[2]) std::swap(a, b);
          healpix::FoldIsotropic(a, b);
        }
        bool at_edge = false;
        for (const double* direction : {a, b}) {
          const auto point = healpix::LocatePixel(options.pack.nside, direction);
          at_edge |= std::min({point.u, point.v, 1 - point.u, 1 - point.v}) < 1e-3;
        }
        if (at_edge) continue;
      }
      float rgb[3];
      double f[3], bound[3];
      decoder.Evaluate(pair.wi, pair.wo, rgb);
      slow.Evaluate(pair.wi, pair.wo, f, bound);
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(static_cast<double>(rgb[c]), f[c], bound[c]) << "variant " << variant;
        positive += rgb[c] > 0 ? 1 : 0;
      }
      ++compared;
    }
    EXPECT_GT(compared, options.pack.isotropic ? 500 : 800) << variant;
    EXPECT_GT(positive, 0) << variant;
  }
}

TEST(BrdfDecoder, IsReciprocalToTheBitInCanonicalOrder) {
  Random random(2);
  for (const bool isotropic : {false, true}) {
    const TemporaryDirectory out;
    BrdfSampleOptions options;
    options.pack.canonical_order = true;
    options.pack.isotropic = isotropic;
    options.pack.nside = 8;
    Publish(out, 5, options);
    BrdfDecoder decoder;
    std::string problem;
    ASSERT_EQ(BrdfDecoder::Load(out / "asset", &decoder, &problem), LoadStatus::kOk) << problem;
    for (const Pair& pair : TestPairs(random, 20000)) {
      if (pair.wi[2] == pair.wo[2]) continue;  // no order
      float forward[3], backward[3];
      decoder.Evaluate(pair.wi, pair.wo, forward);
      decoder.Evaluate(pair.wo, pair.wi, backward);
      for (int c = 0; c < 3; ++c) ASSERT_EQ(forward[c], backward[c]);
    }
  }
}

TEST(BrdfDecoder, IsotropicOnesDoNotFeelRotations) {
  Random random(3);
  const TemporaryDirectory out;
  BrdfSampleOptions options;
  options.pack.isotropic = true;
  options.pack.nside = 8;
  Publish(out, 6, options);
  BrdfDecoder decoder;
  std::string problem;
  ASSERT_EQ(BrdfDecoder::Load(out / "asset", &decoder, &problem), LoadStatus::kOk) << problem;
  for (int i = 0; i < 5000; ++i) {
    const double theta_i = i % 4 == 0 ? 0 : 0.1 + 1.4 * random.Unit();
    const double theta_o = 0.1 + 1.4 * random.Unit();
    const double phi = M_PI * (0.05 + 0.9 * random.Unit());
    const double turn = 2 * M_PI * random.Unit();
    float wi[3], wo[3], a[3], b[3];
    SetDirection(wi, theta_i, turn);
    SetDirection(wo, theta_o, turn + phi);
    decoder.Evaluate(wi, wo, a);
    SetDirection(wi, theta_i, 0);
    SetDirection(wo, theta_o, phi);
    decoder.Evaluate(wi, wo, b);
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(a[c], b[c], 2e-3f * (1 + b[c]));
  }
}

TEST(BrdfDecoder, IsFiniteAndNotNegativeForAnyInput) {
  Random random(4);
  const float inf = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float values[] = {0,     -0.0f,      1,      -1,    1e-38f, -1e-38f, 1e-20f,
                          1e-7f, 0.6666667f, 1e-45f, 1e20f, inf,    -inf,    nan};
  const TemporaryDirectory out;
  Publish(out, 7);
  BrdfDecoder decoder;
  std::string problem;
  ASSERT_EQ(BrdfDecoder::Load(out / "asset", &decoder, &problem), LoadStatus::kOk) << problem;
  for (int i = 0; i < 200000; ++i) {
    float wi[3], wo[3], rgb[3];
    for (int d = 0; d < 3; ++d) {
      wi[d] = values[random.Below(14)];
      wo[d] = values[random.Below(14)];
    }
    decoder.Evaluate(wi, wo, rgb);
    for (const float value : rgb) ASSERT_TRUE(value >= 0 && value <= 162754.0f) << value;
    if (!(wi[2] > 0) || !(wo[2] > 0)) {
      ASSERT_EQ(rgb[0] + rgb[1] + rgb[2], 0);
    }
  }
  for (const double degrees : {89.0, 89.9, 89.99, 89.9999}) {
    float wi[3], wo[3], rgb[3];
    SetDirection(wi, degrees * M_PI / 180, 0.3);
    SetDirection(wo, degrees * M_PI / 180, 0.3 + M_PI);
    decoder.Evaluate(wi, wo, rgb);
    for (const float value : rgb) EXPECT_TRUE(std::isfinite(value));
  }
}

TEST(BrdfDecoder, ClampsTheExponent) {
  const TemporaryDirectory out;
  const std::string directory = Publish(out, 8);
  WeightBuffer network = *ReadWeights(directory + "/decoder.weights");
  for (WeightTensor& tensor : network.tensors) {
    if (tensor.name == "layer2.bias") tensor.elements = {0x7BFF, 0x4A00, 0xFBFF};
    if (tensor.name == "layer2.weight")
      std::fill(tensor.elements.begin(), tensor.elements.end(), 0);
  }
  ASSERT_OK(WriteWeights(directory + "/decoder.weights", network));
  BrdfDecoder decoder;
  std::string problem;
  ASSERT_EQ(BrdfDecoder::Load(directory, &decoder, &problem), LoadStatus::kOk) << problem;
  const float up[3] = {0, 0, 1};
  float rgb[3];
  decoder.Evaluate(up, up, rgb);
  EXPECT_NEAR(static_cast<double>(rgb[0]), std::expm1(12.0), 0.02);
  EXPECT_EQ(rgb[0], rgb[1]);
  EXPECT_EQ(rgb[2], 0);
}

TEST(BrdfDecoder, SaysWhatIsWrong) {
  BrdfDecoder decoder;
  std::string problem;
  const TemporaryDirectory out;
  EXPECT_EQ(BrdfDecoder::Load(out / "absent", &decoder, &problem), LoadStatus::kNotFound);
  BrdfSampleOptions options;
  options.zstd_level = 3;
  std::string directory = Publish(out, 9, options);
  EXPECT_EQ(BrdfDecoder::Load(directory, &decoder, &problem), LoadStatus::kUnsupported);
  EXPECT_NE(problem.find("zstd -d"), std::string::npos);

  options.zstd_level = 0;
  options.shared_codebook = true;
  directory = Publish(out, 9, options);
  ASSERT_EQ(BrdfDecoder::Load(directory, &decoder, &problem), LoadStatus::kOk) << problem;
  std::filesystem::remove(out / "shared.hpc");
  EXPECT_EQ(BrdfDecoder::Load(directory, &decoder, &problem), LoadStatus::kNotFound);
  EXPECT_NE(problem.find("shared.hpc"), std::string::npos);
}

// Each file of a container cut to every length and with single bytes changed, sums put right.
TEST(BrdfDecoder, SurvivesDamagedFiles) {
  const TemporaryDirectory out;
  BrdfSampleOptions options;
  options.pack.nside = 2;
  options.pack.entries = 10;
  options.hidden = {4};
  const std::string directory = Publish(out, 10, options);
  for (const char* name : {"grid.hpx", "decoder.weights", "sampler.bin", "manifest.json"}) {
    const std::string path = directory + "/" + name;
    const std::vector<uint8_t> good = *ReadFile(path, 1 << 20);
    BrdfDecoder decoder;
    std::string problem;
    const auto load = [&](const std::vector<uint8_t>& bytes) {
      std::filesystem::remove(path);  // file systems sync a file that is written over
      std::ofstream(path, std::ios::binary)
          .write(reinterpret_cast<const char*>(bytes.data()),
                 static_cast<std::streamsize>(bytes.size()));
      return BrdfDecoder::Load(directory, &decoder, &problem);
    };
    const bool is_text = std::strcmp(name, "manifest.json") == 0;
    for (size_t size = 0; size + (is_text ? 1 : 0) < good.size(); size += is_text ? 7 : 1)
      ASSERT_NE(load(test::Prefix(good, size)), LoadStatus::kOk) << name << " " << size;
    std::vector<uint8_t> longer = good;
    longer.push_back('x');
    ASSERT_NE(load(longer), LoadStatus::kOk) << name;
    Random random(11);
    const bool is_sampler = std::strcmp(name, "sampler.bin") == 0;
    const size_t crc_at = is_sampler ? 12 : 24;
    for (int i = 0; i < 1500; ++i) {
      std::vector<uint8_t> bytes = good;
      // Mostly in the header.
      const size_t at = static_cast<size_t>(random.Below(
          static_cast<int>(i % 3 == 0 ? bytes.size() : std::min<size_t>(192, bytes.size()))));
      bytes[at] = static_cast<uint8_t>(random.Next());
      if (!is_text) {
        StoreLittle32(&bytes[crc_at], 0);
        StoreLittle32(&bytes[crc_at], Crc32(bytes));
      }
      if (load(bytes) != LoadStatus::kOk) continue;
      float wi[3], wo[3], rgb[3], pdf;
      SetDirection(wi, 1.0, 2.0);
      SetDirection(wo, 0.5, 0.1);
      decoder.Evaluate(wi, wo, rgb);
      for (const float value : rgb) ASSERT_TRUE(value >= 0 && std::isfinite(value));
      const float u[3] = {0.1f, 0.2f, 0.3f};
      if (decoder.Sample(wi, u, wo, &pdf)) {
        ASSERT_TRUE(std::isfinite(pdf) && pdf > 0);
      }
    }
    ASSERT_EQ(load(good), LoadStatus::kOk) << problem;
  }
}

TEST(BrdfContainer, OpensAndVerifies) {
  const TemporaryDirectory out;
  BrdfSampleOptions options;
  options.shared_codebook = true;
  const std::string directory = Publish(out, 12, options);
  const auto container = OpenContainer(out / "asset");
  ASSERT_OK(container);
  EXPECT_EQ(container->manifest.kind, "brdf");
  EXPECT_EQ(container->manifest.brdf->grid, "grid.hpx");
  ASSERT_OK(VerifyPayloads(*container));
  ASSERT_OK(WriteFileDurably(out / "shared.hpc", std::string_view("other")));
  EXPECT_EQ(VerifyPayloads(*container).error().code, ErrorCode::kCorruptData);
  std::filesystem::remove(out / "shared.hpc");
  EXPECT_EQ(VerifyPayloads(*container).error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace patina
