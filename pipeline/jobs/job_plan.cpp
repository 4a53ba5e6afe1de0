#include "pipeline/jobs/job_plan.h"

#include <filesystem>
#include <utility>

#include "formats/brdf/brdf_source.h"
#include "formats/layered/layered_file.h"
#include "pipeline/image/map_name.h"
#include "pipeline/jobs/brdf_files.h"
#include "pipeline/jobs/job_sets.h"
#include "pipeline/jobs/scene_job.h"
#include "pipeline/svbrdf/image_set.h"

namespace patina {
namespace {

PlannedJob PlanBrdf(const std::string& asset, const std::string& file) {
  Job job = JobOfBrdfFile(asset, file);
  const bool alone = job.kind == JobKind::kBrdf;
  return {asset, std::move(job), alone};
}

// A file is a BRDF by its extension; a .json by its content, as job files end so, too.
bool IsBrdf(const std::string& path) {
  if (layered::IsLayersFileName(path) || svbrdf::IsImageSetFileName(path)) return true;
  return LowerExtension(path) == ".json" ? IsMeasurementList(path) : brdf::HasBrdfExtension(path);
}

PlannedJob Plan(const FoundAsset& found) {
  if (!found.problem.empty()) return {found.asset, Fail(found.problem_code, found.problem)};
  if (!found.file.empty()) return PlanBrdf(found.asset, found.file);
  if (!found.scene.empty()) {
    Job job;
    job.asset = found.asset;
    job.scene = found.scene;
    job.scene_material = found.scene_material;
    return {found.asset, std::move(job)};
  }
  Job job;
  job.asset = found.asset;
  job.folder = found.folder;
  job.set = found.set;
  return {found.asset, std::move(job)};
}

}  // namespace

JobPlan PlanJobs(const std::string& input, const std::string& except) {
  JobPlan plan;
  std::error_code ignored;
  if (std::filesystem::is_regular_file(input, ignored)) {
    if (IsSceneFileName(input)) {
      auto jobs = JobsOfScene(input);
      if (!jobs) plan.jobs.push_back({AssetNameFromPath(input), Fail(jobs.error())});
      if (!jobs) return plan;
      for (Job& job : *jobs) {
        const std::string asset = job.asset;
        plan.jobs.push_back({asset, std::move(job)});
      }
      return plan;
    }
    if (IsBrdf(input)) {
      plan.jobs.push_back(PlanBrdf(BrdfAssetName(input), input));
      return plan;
    }
    auto job = ReadJobFile(input);
    const std::string asset = job ? job->asset : AssetNameFromPath(input);
    plan.jobs.push_back({asset, std::move(job)});
    return plan;
  }
  auto found = FindAssets(input, except);
  if (!found) {
    plan.jobs.push_back({AssetNameFromPath(input), Fail(found.error())});
    return plan;
  }
  for (const FoundAsset& asset : found->assets) plan.jobs.push_back(Plan(asset));
  plan.skipped = std::move(found->skipped);
  return plan;
}

}  // namespace patina
