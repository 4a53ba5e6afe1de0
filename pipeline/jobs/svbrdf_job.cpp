#include "pipeline/jobs/svbrdf_job.h"

#include "pipeline/jobs/brdf_job.h"

namespace patina {

svbrdf::SvbrdfShape SvbrdfModelOfJob(const Job& job, int width, int height, AddressMode address,
                                     bool isotropic) {
  svbrdf::SvbrdfShape shape = svbrdf::DefaultSvbrdfShape(width, height, address, isotropic);
  if (job.recipe == Recipe::kPaper) shape.model = brdf::PaperShape({.isotropic = isotropic});
  OverrideModel(job.model, &shape.model);
  if (job.model.textures) shape.texture.textures = *job.model.textures;
  return shape;
}

svbrdf::TextureForm TextureFormOfJob(const Job& job) {
  return job.model.texture_format == "fp16" ? svbrdf::TextureForm::kHalves
                                            : svbrdf::TextureForm::kBlocks;
}

svbrdf::ModelledOptions SvbrdfSamplingOfJob(const Job& job, bool exact,
                                            const layered::Outlook& outlook) {
  // Noise of single values is averaged by texels and directions nearby: fewer paths of more pairs
  // than for one BRDF.
  layered::Effort learned, measured;
  size_t samples = size_t{1} << 19;
  learned.accuracy = {0.05, 8, 16, 256};
  measured.accuracy = {0.02, 32, 64, 1024};
  if (job.quality == Quality::kPreview) {
    samples = size_t{1} << 17;
    learned.accuracy = {0.08, 8, 8, 64};
    measured.accuracy = {0.04, 16, 32, 256};
  } else if (job.quality == Quality::kReference) {
    samples = size_t{1} << 21;
    learned.accuracy = {0.03, 8, 32, 512};
  }
  svbrdf::ModelledOptions options;
  options.learned = layered::ScaledFor(outlook, learned).accuracy;
  options.measured = layered::ScaledFor(outlook, measured).accuracy;
  // Exact values cost little more than to learn from them.
  options.samples = exact ? 8 * samples : samples;
  options.seed = job.seed;
  return options;
}

svbrdf::SvbrdfOptions SvbrdfTrainingOfJob(const Job& job, uint64_t measurements) {
  constexpr uint64_t kFew = uint64_t{1} << 20;
  svbrdf::SvbrdfOptions options;
  options.seed = job.seed;
  options.form = TextureFormOfJob(job);
  if (measurements < kFew) options.batch /= 4;
  const auto scale = [&options](int numerator, int denominator) {
    for (int* steps : {&options.free_steps, &options.block_steps, &options.final_steps})
      *steps = *steps * numerator / denominator;
  };
  if (job.quality == Quality::kPreview) scale(1, 4);
  if (job.quality == Quality::kReference) scale(3, 1);
  return options;
}

}  // namespace patina
