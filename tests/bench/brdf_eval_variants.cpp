#include <chrono>
#include <memory>
#include <utility>

#include "formats/base/names.h"
#include "pipeline/base/progress.h"
#include "pipeline/brdf/batch_evaluator.h"
#include "pipeline/brdf/train_brdf.h"
#include "tests/bench/brdf_eval_systems.h"

namespace patina::bench {
namespace {

using brdf::ModelShape;
using brdf::TrainOptions;

struct Variant {
  const char* name;
  void (*apply)(ModelShape* shape, TrainOptions* options);
};

// The paper's model, at another Nside.
void Plain(int nside, ModelShape* shape, TrainOptions* options) {
  *shape = brdf::PaperShape({shape->grid.isotropic, false});
  shape->grid.nside = nside;
  const uint64_t seed = options->seed;
  *options = brdf::PaperTraining();
  options->seed = seed;
}

const Variant kVariants[] = {
    {"default", [](ModelShape*, TrainOptions*) {}},
    {"reference",
     [](ModelShape*, TrainOptions* options) {
       options->free_steps *= 3, options->codebook_steps *= 3;
     }},
    {"8-bit", [](ModelShape* shape, TrainOptions*) { shape->index_bits = 8; }},
    {"k8", [](ModelShape* shape, TrainOptions*) { shape->primitive_size = 8; }},
    // More codes than an isotropic grid of Nside 16 has corners: features as good as continuous.
    {"continuous",
     [](ModelShape* shape, TrainOptions* options) { shape->index_bits = 12, options->pull = 0; }},
    {"no-pull", [](ModelShape*, TrainOptions* options) { options->pull = 0; }},
    {"no-decay", [](ModelShape*, TrainOptions* options) { options->decay = 0; }},
    {"nside8", [](ModelShape* shape, TrainOptions*) { shape->grid.nside = 8; }},
    {"nside32", [](ModelShape* shape, TrainOptions*) { shape->grid.nside = 32; }},
    {"nside64", [](ModelShape* shape, TrainOptions*) { shape->grid.nside = 64; }},
    {"16x2",
     [](ModelShape* shape, TrainOptions*) { shape->hidden = 16, shape->hidden_layers = 2; }},
    {"32x2", [](ModelShape* shape, TrainOptions*) { shape->hidden_layers = 2; }},
    {"64x3",
     [](ModelShape* shape, TrainOptions*) { shape->hidden = 64, shape->hidden_layers = 3; }},
    {"inverse-distance",
     [](ModelShape* shape, TrainOptions*) {
       shape->grid.interpolation = healpix::Interpolation::kInverseDistance;
     }},
    {"uniform",
     [](ModelShape* shape, TrainOptions*) {
       shape->grid.interpolation = healpix::Interpolation::kUniform;
     }},
    {"no-order", [](ModelShape* shape, TrainOptions*) { shape->grid.canonical_order = false; }},
    {"no-scalars",
     [](ModelShape* shape, TrainOptions*) {
       shape->grid.angle_inputs = shape->grid.half_vector_inputs = false;
     }},
    {"no-half-vector",
     [](ModelShape* shape, TrainOptions*) { shape->grid.half_vector_inputs = false; }},
    {"plain", [](ModelShape* shape, TrainOptions* options) { Plain(64, shape, options); }},
    {"plain-nside16", [](ModelShape* shape, TrainOptions* options) { Plain(16, shape, options); }},
    {"plain-no-pull",
     [](ModelShape* shape, TrainOptions* options) {
       Plain(64, shape, options);
       options->pull = 0;
     }},
    {"plain-softmax",
     [](ModelShape* shape, TrainOptions* options) {
       Plain(64, shape, options);
       options->index_training = brdf::IndexTraining::kSoftmax;
     }},
};

// An evaluator with scratch for each worker.
struct Decoded {
  Decoded(brdf::BatchEvaluator evaluator_, int threads) : evaluator(std::move(evaluator_)) {
    for (int t = 0; t < threads; ++t) scratch.emplace_back(evaluator);
  }
  brdf::BatchEvaluator evaluator;
  std::vector<brdf::BatchEvaluator::Scratch> scratch;
};

}  // namespace

std::vector<std::string> VariantNames() {
  std::vector<std::string> names;
  for (const Variant& variant : kVariants) names.emplace_back(variant.name);
  return names;
}

Result<FittedSystem> FitVariant(const std::string& name, const Material& material, uint64_t seed,
                                ThreadPool& pool) {
  ModelShape shape = brdf::DefaultShape(brdf::KindOf(material.source));
  TrainOptions options = brdf::DefaultTraining(brdf::KindOf(material.source));
  options.seed = seed;
  for (const Variant& variant : kVariants) {
    if (name == variant.name) variant.apply(&shape, &options);
  }
  const auto start = std::chrono::steady_clock::now();
  PATINA_ASSIGN(const brdf::TrainedBrdf trained,
                brdf::TrainBrdf(material.source, shape, options, pool, NoProgress()));
  FittedSystem fitted;
  fitted.train_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  PATINA_ASSIGN(const auto pack, EncodeIndexPack(trained.pack));
  PATINA_ASSIGN(const auto weights, EncodeWeights(trained.network));
  fitted.bytes = static_cast<double>(pack.size() + weights.size());
  PATINA_ASSIGN(const auto features,
                ExpandCorners(trained.pack, {trained.pack.primitive_size, trained.pack.codebook}));
  PATINA_ASSIGN(auto evaluator,
                brdf::BatchEvaluator::Create(trained.pack, features, trained.network));
  const auto decoded = std::make_shared<Decoded>(std::move(evaluator), pool.threads());
  fitted.evaluate = [decoded](int worker, size_t count, const brdf::Direction* wi,
                              const brdf::Direction* wo, float* rgb) {
    decoded->evaluator.Evaluate(&decoded->scratch[worker], count, wi, wo, rgb);
  };
  return fitted;
}

}  // namespace patina::bench
