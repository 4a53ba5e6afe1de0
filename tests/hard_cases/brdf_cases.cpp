#include "tests/hard_cases/brdf_cases.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "formats/half.h"
#include "tests/pipeline/brdf/brdf_samples.h"

namespace patina::test {
namespace {

using brdf::Direction;

void Fill(float value, float* rgb) { rgb[0] = rgb[1] = rgb[2] = value; }

// The same for the same bits of the directions, and evenly spread.
uint32_t HashOf(const Direction& wi, const Direction& wo) {
  const float values[6] = {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
  uint32_t hash = 2166136261u;
  for (const float value : values) {
    uint32_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    hash = (hash ^ bits) * 16777619u;
    hash ^= hash >> 15;
  }
  return hash;
}

}  // namespace

brdf::Source OrdinaryBrdf() {
  return brdf::SourceOf([](const Direction& wi, const Direction& wo, float* rgb) {
    return brdf::Plastic(0.2f, wi, wo, rgb);
  });
}

std::vector<BrdfCase> BrdfCases() {
  using brdf::SourceOf;
  std::vector<BrdfCase> cases;
  cases.push_back({"a near delta lobe",
                   "GGX of roughness 1e-4: 3e7 in the peak, nothing a degree beside it",
                   SourceOf([](const Direction& wi, const Direction& wo, float* rgb) {
                     return brdf::Plastic(1e-4f, wi, wo, rgb);
                   })});
  cases.push_back({"grazing", "grows like 1 / (cos cos), to 3e7 at 89.99 degrees",
                   SourceOf([](const Direction& wi, const Direction& wo, float* rgb) {
                     Fill(0.1f / std::max(1e-9f, wi.z * wo.z), rgb);
                     return true;
                   })});
  cases.push_back({"a step at the azimuth's wrap",
                   "plus pi and minus pi are one direction, with different values beside it",
                   SourceOf(
                       [](const Direction& wi, const Direction& wo, float* rgb) {
                         Fill(std::atan2(wi.y + wo.y, wi.x + wo.x) > 0 ? 1.0f : 0.1f, rgb);
                         return true;
                       },
                       false)});
  cases.push_back({"light at the pole alone",
                   "everything but a cone of 3 degrees around the normal is black",
                   SourceOf([](const Direction& wi, const Direction& wo, float* rgb) {
                     Fill(wi.z > 0.9986f || wo.z > 0.9986f ? 5.0f : 0.0f, rgb);
                     return true;
                   })});
  cases.push_back({"99.9 % invalid",
                   "one direction in a thousand has data: most corners never see a sample",
                   SourceOf([](const Direction& wi, const Direction& wo, float* rgb) {
                     return HashOf(wi, wo) % 1000 == 0 && brdf::Plastic(0.3f, wi, wo, rgb);
                   })});
  cases.push_back({"white, of albedo 1", "any overshoot makes more light than comes in",
                   SourceOf([](const Direction&, const Direction&, float* rgb) {
                     Fill(0.31830989f, rgb);
                     return true;
                   })});
  cases.push_back({"black", "every gradient of a decoded value is cut off or zero",
                   SourceOf([](const Direction&, const Direction&, float* rgb) {
                     Fill(0, rgb);
                     return true;
                   })});
  cases.push_back({"the largest half", "65504 everywhere: near the cap of the output's exponent",
                   SourceOf([](const Direction&, const Direction&, float* rgb) {
                     Fill(kMaxHalf, rgb);
                     return true;
                   })});
  cases.push_back({"the largest float",
                   "beyond what an output can give, and its square beyond a float",
                   SourceOf([](const Direction&, const Direction&, float* rgb) {
                     Fill(3e38f, rgb);
                     return true;
                   })});
  cases.push_back({"denormals", "smaller than what adds to one",
                   SourceOf([](const Direction&, const Direction&, float* rgb) {
                     Fill(1e-40f, rgb);
                     return true;
                   })});
  cases.push_back({"noise of both signs",
                   "measured values below zero are cut off, and their gradient is not",
                   SourceOf([](const Direction& wi, const Direction& wo, float* rgb) {
                     Fill(static_cast<float>(HashOf(wi, wo) % 2001) * 1e-3f - 1, rgb);
                     return true;
                   })});
  brdf::Source one;
  one.format = "test";
  one.cells = 1;
  one.samples = {{{0.6f, 0, 0.8f}, {-0.6f, 0, 0.8f}, {2, 1, 0.5f}, 1}};
  cases.push_back({"a list of one sample", "all other directions are free", one});
  return cases;
}

brdf::ModelShape SmallBrdf() {
  brdf::ModelShape shape;
  shape.grid.nside = 4;
  shape.index_bits = 6;
  shape.hidden = 16;
  shape.hidden_layers = 2;
  return shape;
}

brdf::TrainOptions QuickBrdfTraining() {
  brdf::TrainOptions options;
  options.pool = 6000;
  options.batch = 256;
  options.free_steps = 200;
  options.codebook_steps = 120;
  return options;
}

brdf::TrainedBrdf MustTrainBrdf(const brdf::Source& source, const brdf::TrainOptions& options,
                                int threads) {
  ThreadPool pool(threads);
  brdf::ModelShape shape = SmallBrdf();
  shape.grid.isotropic = source.isotropic;
  shape.grid.half_vector_inputs = !source.isotropic;
  auto trained = brdf::TrainBrdf(source, shape, options, pool, NoProgress());
  EXPECT_TRUE(trained) << (trained ? "" : trained.error().message);
  return trained ? std::move(*trained) : brdf::TrainedBrdf{};
}

bool SameBrdf(const brdf::TrainedBrdf& a, const brdf::TrainedBrdf& b) {
  if (a.network.tensors.size() != b.network.tensors.size()) return false;
  for (size_t i = 0; i < a.network.tensors.size(); ++i) {
    if (a.network.tensors[i].elements != b.network.tensors[i].elements) return false;
  }
  return a.pack.codebook == b.pack.codebook && a.pack.indices == b.pack.indices &&
         a.pack.stored[0] == b.pack.stored[0] && a.pack.stored[1] == b.pack.stored[1] &&
         a.rollbacks == b.rollbacks;
}

void ExpectFinite(const brdf::TrainedBrdf& model) {
  ASSERT_FALSE(model.network.tensors.empty());
  for (const WeightTensor& tensor : model.network.tensors) {
    for (const uint16_t half : tensor.elements) ASSERT_TRUE(HalfIsFinite(half)) << tensor.name;
  }
  for (const uint16_t half : model.pack.codebook) ASSERT_TRUE(HalfIsFinite(half));
  EXPECT_TRUE(std::isfinite(model.free_loss));
  EXPECT_TRUE(std::isfinite(model.final_loss));
  EXPECT_TRUE(std::isfinite(model.used_codes));
}

}  // namespace patina::test
