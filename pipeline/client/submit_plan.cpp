#include "pipeline/client/submit_plan.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "formats/brdf/brdf_source.h"
#include "pipeline/jobs/brdf_files.h"
#include "pipeline/jobs/job_sets.h"

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

PlannedSubmit Plan(Job job, const SubmitSettings& settings) {
  PlannedSubmit planned;
  planned.asset = job.asset;
  if (!job.maps.empty()) {
    for (JobMap& map : job.maps)
      map.file = Absolute((fs::path(job.maps_folder) / map.file).string());
  }
  job.file = Absolute(job.file);
  job.folder = Absolute(job.folder);
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

Job BrdfJob(const std::string& asset, const std::string& file) {
  Job job;
  job.kind = JobKind::kBrdf;
  job.asset = asset;
  job.file = file;
  return job;
}

bool IsJsonFile(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return extension == ".json";
}

}  // namespace

std::vector<PlannedSubmit> PlanSubmit(const std::string& input, const SubmitSettings& settings) {
  std::error_code ignored;
  if (fs::is_regular_file(input, ignored)) {
    const bool brdf = IsJsonFile(input) ? IsMeasurementList(input) : brdf::HasBrdfExtension(input);
    if (brdf) return {Plan(BrdfJob(BrdfAssetName(input), input), settings)};
    auto job = ReadJobFile(input);
    if (!job) return {Unplanned(AssetNameFromPath(input), job.error())};
    return {Plan(std::move(*job), settings)};
  }
  auto found = FindAssets(input, settings.out);
  if (!found) return {Unplanned(AssetNameFromPath(input), found.error())};
  std::vector<PlannedSubmit> plan;
  for (const FoundAsset& asset : found->assets) {
    if (!asset.problem.empty()) {
      plan.push_back(Unplanned(asset.asset, {asset.problem_code, asset.problem}));
    } else if (!asset.file.empty()) {
      plan.push_back(Plan(BrdfJob(asset.asset, asset.file), settings));
    } else {
      Job job;
      job.asset = asset.asset;
      job.folder = asset.folder;
      job.set = asset.set;
      plan.push_back(Plan(std::move(job), settings));
    }
  }
  return plan;
}

}  // namespace patina
