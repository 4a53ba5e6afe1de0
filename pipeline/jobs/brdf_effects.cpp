#include "pipeline/jobs/brdf_effects.h"

#include <cstdio>

#include "pipeline/brdf/anisotropy.h"
#include "pipeline/brdf/sampler_fit.h"
#include "pipeline/jobs/brdf_job.h"

namespace patina {
namespace {

constexpr uint64_t kBytesOfHalf = 2;
constexpr uint64_t kTrainPasses = 3;  // forward, and backward to inputs and weights

uint64_t Weights(const brdf::ModelShape& shape) {
  const auto hidden = static_cast<uint64_t>(shape.hidden);
  const auto inputs = static_cast<uint64_t>(2 * shape.primitive_size + shape.grid.extra_inputs());
  return inputs * hidden + static_cast<uint64_t>(shape.hidden_layers - 1) * hidden * hidden +
         hidden * brdf::kOutputs;
}

// Without headers and biases.
uint64_t Bytes(const brdf::ModelShape& shape) {
  const brdf::SamplerShape sampler = brdf::DefaultSamplerShape(shape.grid.isotropic);
  const uint64_t codes =
      (uint64_t{1} << shape.index_bits) * static_cast<uint64_t>(shape.primitive_size);
  const uint64_t indices =
      2 * static_cast<uint64_t>(shape.grid.corners()) * static_cast<uint64_t>(shape.index_bits) / 8;
  const auto cells = static_cast<uint64_t>(sampler.theta_i_bins) *
                     static_cast<uint64_t>(sampler.theta_h_cells) *
                     static_cast<uint64_t>(sampler.phi_cells);
  return kBytesOfHalf * (Weights(shape) + codes) + indices + cells;
}

uint64_t Samples(const Job& job, const brdf::SourceKind& kind) {
  const brdf::TrainOptions options = TrainingOfJob(job, kind);
  return static_cast<uint64_t>(options.free_steps + options.codebook_steps) *
         static_cast<uint64_t>(options.batch);
}

uint64_t Difference(uint64_t a, uint64_t b) { return a > b ? a - b : 0; }

ManifestSavings SavedWithoutAzimuth(const Job& job, const brdf::SourceKind& kind,
                                    const brdf::ModelShape& shape) {
  brdf::SourceKind turned = kind;
  turned.isotropic = false;
  const brdf::ModelShape full = ModelOfJob(job, turned);
  const uint64_t full_samples = Samples(job, turned), samples = Samples(job, kind);
  ManifestSavings saved;
  saved.bytes = Difference(Bytes(full), Bytes(shape));
  saved.decode_multiply_adds = Difference(Weights(full), Weights(shape));
  saved.train_samples = Difference(full_samples, samples);
  saved.train_multiply_adds =
      kTrainPasses * Difference(full_samples * Weights(full), samples * Weights(shape));
  return saved;
}

std::string AzimuthReason(const BrdfSource& source) {
  if (!source.anisotropy) return "the source has none";
  char text[160];
  std::snprintf(
      text, sizeof text,
      "turning both directions about the normal changes log(1 + f) by %.2g %% on average; "
      "up to %g %% counts as isotropic",
      100 * *source.anisotropy, 100 * brdf::kIsotropicWithin);
  return text;
}

}  // namespace

std::vector<ManifestEffect> DescribeBrdfEffects(const Job& job, const BrdfSource& source,
                                                const brdf::ModelShape& shape) {
  std::vector<ManifestEffect> effects;
  if (shape.grid.isotropic) {
    effects.push_back({"azimuth", "left_out", AzimuthReason(source),
                       SavedWithoutAzimuth(job, brdf::KindOf(source.data), shape)});
  } else {
    effects.push_back({"azimuth", "learned", "", std::nullopt});
  }
  if (shape.grid.canonical_order) {
    effects.push_back(
        {"f(wo, wi)", "derived", "it is f(wi, wo): the directions are put in order", std::nullopt});
  } else {
    effects.push_back({"f(wo, wi)", "learned", "", std::nullopt});
  }
  return effects;
}

}  // namespace patina
