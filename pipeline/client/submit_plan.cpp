#include "pipeline/client/submit_plan.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "pipeline/jobs/as_reflectance.h"
#include "pipeline/jobs/drop_jobs.h"
#include "pipeline/jobs/job_plan.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::string Absolute(const std::string& path) {
  if (path.empty()) return path;
  std::error_code error;
  const fs::path absolute = fs::absolute(path, error);
  return error ? path : absolute.lexically_normal().string();
}

// An asset is one and the same, whether the drop folder or somebody else asks for it. Who writes a
// job file, which alone has `out`, says there what it is.
void FollowDropFolder(const SubmitSettings& settings, Job* job) {
  bool as_svbrdf = settings.as == "svbrdf";
  for (const SubmitDropFolder& folder : settings.drop_folders) {
    if (!job->out.empty()) break;
    const auto name = NameInDropFolder(folder.path, *job);
    if (!name) continue;
    job->asset = *name;
    if (settings.as.empty()) as_svbrdf = folder.as_svbrdf;
  }
  if (as_svbrdf) BakeAsReflectance(job);
}

PlannedSubmit Plan(Job job, const SubmitSettings& settings) {
  PlannedSubmit planned;
  planned.asset = job.asset;
  if (!job.maps.empty()) {
    for (JobMap& map : job.maps)
      map.file = Absolute((fs::path(job.maps_folder) / map.file).string());
  }
  auto space = ParseWorkingSpace(settings.working_space);
  if (space && job.kind == JobKind::kMaterial) job.working_space = *space;
  if (ReadsColorMaps(job)) {
    if (!settings.color_space.empty()) job.color_space = settings.color_space;
    if (!settings.ocio.empty()) job.ocio = settings.ocio;
  }
  job.ocio = Absolute(job.ocio);
  job.file = Absolute(job.file);
  job.folder = Absolute(job.folder);
  job.scene = Absolute(job.scene);
  job.out = Absolute(settings.out.empty() ? job.out : settings.out);
  Json described = Json::parse(JobToJson(job), nullptr, false);
  if (job.out.empty()) described.erase("out");
  Json body = {{"job", std::move(described)}};
  if (settings.priority != 0) body["priority"] = settings.priority;
  if (settings.force) body["force"] = true;
  planned.body = body.dump(-1, ' ', false, Json::error_handler_t::replace);
  return planned;
}

PlannedSubmit Unplanned(const std::string& asset, const Error& error) {
  PlannedSubmit planned;
  planned.asset = asset;
  planned.error = error;
  return planned;
}

}  // namespace

std::vector<PlannedSubmit> PlanSubmit(const std::string& input, const SubmitSettings& settings) {
  std::vector<PlannedSubmit> plan;
  for (PlannedJob& planned : PlanJobs(input, settings.out).jobs) {
    if (planned.job) FollowDropFolder(settings, &*planned.job);
    plan.push_back(planned.job ? Plan(std::move(*planned.job), settings)
                               : Unplanned(planned.asset, planned.job.error()));
  }
  return plan;
}

}  // namespace patina
