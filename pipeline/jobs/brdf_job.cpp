#include "pipeline/jobs/brdf_job.h"

namespace patina {
namespace {

template <class T>
void Override(const std::optional<T>& given, T* value) {
  if (given) *value = *given;
}

constexpr Interpolation kInterpolations[] = {
    Interpolation::kBilinear, Interpolation::kInverseDistance, Interpolation::kUniform};

}  // namespace

const char* InterpolationName(Interpolation interpolation) {
  switch (interpolation) {
    case Interpolation::kInverseDistance:
      return "inverse_distance";
    case Interpolation::kUniform:
      return "uniform";
    case Interpolation::kBilinear:
      break;
  }
  return "bilinear";
}

void OverrideModel(const JobModel& model, brdf::ModelShape* shape) {
  Override(model.nside, &shape->grid.nside);
  Override(model.primitive_size, &shape->primitive_size);
  Override(model.index_bits, &shape->index_bits);
  Override(model.hidden, &shape->hidden);
  Override(model.hidden_layers, &shape->hidden_layers);
  Override(model.angle_inputs, &shape->grid.angle_inputs);
  Override(model.canonical_order, &shape->grid.canonical_order);
  if (!shape->grid.angle_inputs) shape->grid.half_vector_inputs = false;
  for (const Interpolation interpolation : kInterpolations) {
    if (model.interpolation == InterpolationName(interpolation))
      shape->grid.interpolation = interpolation;
  }
}

brdf::ModelShape ModelOfJob(const Job& job, const brdf::SourceKind& kind) {
  brdf::ModelShape shape =
      job.recipe == Recipe::kPaper ? brdf::PaperShape(kind) : brdf::DefaultShape(kind);
  OverrideModel(job.model, &shape);
  return shape;
}

layered::Effort EffortOfJob(const Job& job) {
  layered::Effort effort;
  effort.seed = job.seed;
  effort.accuracy = {0.02, 16, 32, 1024};
  if (job.quality == Quality::kPreview) {
    effort.accuracy = {0.04, 16, 16, 256};
    effort.draft_paths = 8;
  } else if (job.quality == Quality::kReference) {
    effort.accuracy = {0.01, 32, 64, 4096};
    effort.draft_paths = 128;
  }
  return effort;
}

brdf::TrainOptions TrainingOfJob(const Job& job, const brdf::SourceKind& kind) {
  brdf::TrainOptions options =
      job.recipe == Recipe::kPaper ? brdf::PaperTraining() : brdf::DefaultTraining(kind);
  options.seed = job.seed;
  if (job.model.index_training == "softmax") {
    options.index_training = brdf::IndexTraining::kSoftmax;
  } else if (job.model.index_training == "clusters_then_softmax") {
    options.index_training = brdf::IndexTraining::kClustersThenSoftmax;
  }
  switch (job.quality) {
    case Quality::kPreview:
      options.free_steps /= 2;
      options.codebook_steps /= 4;
      if (kind.simulated) options.pool = size_t{1} << 15;
      break;
    case Quality::kStandard:
      // Few pairs with little noise each would be learned by heart, many with much be biased.
      if (kind.simulated) options.pool = size_t{1} << 17;
      break;
    case Quality::kReference:
      if (kind.simulated) options.pool = size_t{1} << 19;
      options.free_steps *= 3;
      options.codebook_steps *= 3;
      break;
  }
  return options;
}

}  // namespace patina
