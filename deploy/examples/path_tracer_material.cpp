// A baked BRDF behind the interface that path tracers give their materials: evaluate, sample, pdf.
//
//   path_tracer_material CONTAINER
//
// prints the albedo (the light that leaves for white light from one direction) for some angles,
// once from the sampler's directions and once from cosine-weighted ones. Where the interface is
// right the two agree; the first needs far fewer samples.
#include <patina/patina_brdf_decoder.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>

namespace {

using Vector = std::array<float, 3>;  // in the frame of the surface, z along the normal
using Color = std::array<float, 3>;   // linear Rec.709

struct BsdfSample {
  Vector wo;
  Color weight;  // f cos / pdf
  float pdf;     // per solid angle of wo
};

// What a path tracer asks of a material.
class Material {
 public:
  virtual ~Material() = default;
  virtual Color Evaluate(const Vector& wi, const Vector& wo) const = 0;  // f, in 1/sr
  // u: three numbers in [0, 1). Nothing: the path ends here.
  virtual std::optional<BsdfSample> Sample(const Vector& wi, const Vector& u) const = 0;
  virtual float Pdf(const Vector& wi, const Vector& wo) const = 0;
};

class PatinaMaterial : public Material {
 public:
  explicit PatinaMaterial(patina::BrdfDecoder decoder) : decoder_(std::move(decoder)) {}

  Color Evaluate(const Vector& wi, const Vector& wo) const override {
    Color f{};
    decoder_.Evaluate(wi.data(), wo.data(), f.data());
    return f;
  }

  std::optional<BsdfSample> Sample(const Vector& wi, const Vector& u) const override {
    BsdfSample sample{};
    if (!decoder_.Sample(wi.data(), u.data(), sample.wo.data(), &sample.pdf)) return std::nullopt;
    sample.weight = Evaluate(wi, sample.wo);
    for (float& value : sample.weight) value *= sample.wo[2] / sample.pdf;
    return sample;
  }

  float Pdf(const Vector& wi, const Vector& wo) const override {
    return decoder_.Pdf(wi.data(), wo.data());
  }

 private:
  patina::BrdfDecoder decoder_;
};

// Of a sequence that covers the cube evenly (the generalised golden ratio).
Vector Point(uint32_t i) {
  Vector u{};
  constexpr double kSteps[3] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
  for (size_t d = 0; d < 3; ++d) {
    const double x = 0.5 + kSteps[d] * i;
    u[d] = std::fmin(static_cast<float>(x - std::floor(x)), 0.99999994f);
  }
  return u;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: path_tracer_material CONTAINER\n");
    return 2;
  }
  patina::BrdfDecoder decoder;
  std::string problem;
  if (patina::BrdfDecoder::Load(argv[1], &decoder, &problem) !=
      patina::BrdfDecoder::LoadStatus::kOk) {
    std::fprintf(stderr, "path_tracer_material: error: %s\n", problem.c_str());
    return 3;
  }
  const PatinaMaterial material(std::move(decoder));
  std::printf("degrees sampled cosine_weighted pdf_ratio\n");
  constexpr uint32_t kSamples = 20000;
  for (const float degrees : {5.0f, 30.0f, 60.0f}) {
    const float theta = degrees * 3.14159265f / 180;
    const Vector wi{std::sin(theta), 0, std::cos(theta)};
    double sampled = 0, weighted = 0, worst = 1;
    for (uint32_t i = 0; i < kSamples; ++i) {
      const Vector u = Point(i);
      if (const auto sample = material.Sample(wi, u)) {
        sampled += static_cast<double>(sample->weight[1]) / kSamples;
        const double ratio = static_cast<double>(material.Pdf(wi, sample->wo) / sample->pdf);
        worst = std::fmax(worst, std::fmax(ratio, 1 / ratio));
      }
      const float radius = std::sqrt(u[0]), phi = 6.2831853f * u[1];
      const Vector wo{radius * std::cos(phi), radius * std::sin(phi), std::sqrt(1 - u[0])};
      // f cos / (cos / pi)
      weighted += 3.14159265358979 * static_cast<double>(material.Evaluate(wi, wo)[1]) / kSamples;
    }
    std::printf("%g %.6f %.6f %.6f\n", static_cast<double>(degrees), sampled, weighted, worst);
  }
  return 0;
}
