#include "daemon/api/upload_plan.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "pipeline/image/map_groups.h"
#include "pipeline/jobs/brdf_files.h"
#include "pipeline/jobs/scene_job.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDepth = 32;

// Folders of an upload in order of their names, the upload itself first.
void ListFolders(const fs::path& folder, int depth, std::vector<std::string>* folders) {
  folders->push_back(folder.string());
  if (depth >= kMaxDepth) return;
  std::vector<fs::path> below;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    const bool plain = it->is_directory(ignored) && !it->is_symlink(ignored);
    if (plain && it->path().filename().native().front() != '.') below.push_back(it->path());
  }
  std::sort(below.begin(), below.end());
  for (const fs::path& path : below) ListFolders(path, depth + 1, folders);
}

void PlanScenes(const std::string& folder, std::set<std::string>* claimed, std::vector<Job>* jobs) {
  for (const std::string& path : FindSceneFiles(folder)) {
    Job job;
    job.scene = path;
    const auto scene = ReadScene(path);
    if (!scene) {  // its run says why
      job.asset = AssetNameFromPath(fs::path(path).stem().string());
      job.scene_material = "#0";
      jobs->push_back(std::move(job));
      continue;
    }
    for (std::string& file : FilesOfScene(*scene)) claimed->insert(std::move(file));
    for (const SceneMaterial& material : scene->materials) {
      job.asset = material.asset;
      job.scene_material = SceneMaterialKey(*scene, material);
      jobs->push_back(job);
    }
  }
}

void PlanSets(const std::string& folder, const std::set<std::string>& claimed,
              std::vector<Job>* jobs) {
  const auto grouped = GroupMaps(folder);
  if (!grouped) return;  // no images
  std::error_code ignored;
  std::vector<std::string> sets;
  for (const MapGroup& group : grouped->groups) {
    const bool owned = std::any_of(group.own.begin(), group.own.end(), [&](const auto* candidate) {
      return claimed.count(fs::weakly_canonical(candidate->path, ignored).string()) != 0;
    });
    if (!owned) sets.push_back(group.set_name);
  }
  const std::string name = fs::path(folder).filename().string();
  const bool alone = grouped->groups.size() == 1;
  for (const std::string& set : sets) {
    Job job;
    job.folder = folder;
    if (!alone) job.set = set;
    const bool prefixed = set.rfind(name + "_", 0) == 0 || set == name;
    job.asset = AssetNameFromPath(alone ? name : prefixed ? set : name + "_" + set);
    jobs->push_back(std::move(job));
  }
}

}  // namespace

std::vector<Job> PlanUpload(const std::string& folder) {
  std::vector<std::string> folders;
  ListFolders(folder, 0, &folders);
  std::vector<Job> jobs;
  std::set<std::string> claimed;
  for (const std::string& place : folders) PlanScenes(place, &claimed, &jobs);
  for (const std::string& place : folders) {
    PlanSets(place, claimed, &jobs);
    const auto files = FindBrdfFiles(place);
    if (!files) continue;
    for (const std::string& file : *files) {
      Job job;
      job.kind = JobKind::kBrdf;
      job.asset = BrdfAssetName(file);
      job.file = file;
      jobs.push_back(std::move(job));
    }
  }
  return jobs;
}

}  // namespace patina::daemon
