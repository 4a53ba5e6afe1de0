#include "pipeline/jobs/svbrdf_job.h"

#include "pipeline/jobs/brdf_job.h"

namespace patina {

svbrdf::SvbrdfShape SvbrdfModelOfJob(const Job& job, int width, int height, AddressMode address) {
  svbrdf::SvbrdfShape shape = svbrdf::DefaultSvbrdfShape(width, height, address);
  if (job.recipe == Recipe::kPaper) shape.model = brdf::PaperShape({.isotropic = false});
  OverrideModel(job.model, &shape.model);
  if (job.model.textures) shape.texture.textures = *job.model.textures;
  return shape;
}

svbrdf::SvbrdfOptions SvbrdfTrainingOfJob(const Job& job, uint64_t measurements) {
  constexpr uint64_t kFew = uint64_t{1} << 20;
  svbrdf::SvbrdfOptions options;
  options.seed = job.seed;
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
