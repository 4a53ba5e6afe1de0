#include "pipeline/jobs/as_reflectance.h"

#include "formats/layered/layered_file.h"

namespace patina {

void BakeAsReflectance(Job* job) {
  if (job->kind != JobKind::kMaterial) return;
  job->kind = JobKind::kSvbrdf;
  // A scene is read by these, which the kind does not have.
  job->effects = {};
  job->working_space = WorkingSpace::kLinearRec709;
}

bool ReadsColorMaps(const Job& job) {
  if (job.kind != JobKind::kSvbrdf) return job.kind == JobKind::kMaterial;
  return job.file.empty() || layered::IsLayersFileName(job.file);
}

}  // namespace patina
