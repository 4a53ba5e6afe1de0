#include "daemon/api/upload_plan.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "pipeline/image/map_groups.h"
#include "pipeline/jobs/brdf_files.h"
#include "pipeline/jobs/scene_job.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDepth = 32;

// A job with its short name, and where that is taken the way to it from the upload.
struct PlannedUpload {
  Job job;
  std::string place;
};

class UploadPlanner {
 public:
  explicit UploadPlanner(const std::string& folder) : root_(fs::path(folder).parent_path()) {
    ListFolders(folder, 0);
  }

  std::vector<Job> Run() {
    // All scenes first: one may own textures of any folder. Layers with maps own those.
    for (const std::string& folder : folders_) {
      AddScenes(folder);
      for (const std::string& stack : FindMappedStacks(folder)) {
        for (std::string& map : MapsOfStack(stack)) claimed_.insert(std::move(map));
      }
    }
    for (const std::string& folder : folders_) {
      const std::vector<std::string> lists = FindImageSets(folder);
      for (const std::string& list : lists) Add(JobOfBrdfFile(BrdfAssetName(list), list), list);
      if (!lists.empty()) continue;  // its images are no maps
      AddSets(folder);
      AddBrdfs(folder);
    }
    return NamedApart();
  }

 private:
  // In order of their names.
  void ListFolders(const fs::path& folder, int depth) {
    folders_.push_back(folder.string());
    if (depth >= kMaxDepth) return;
    std::vector<fs::path> below;
    std::error_code error;
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
      std::error_code ignored;
      const bool plain = it->is_directory(ignored) && !it->is_symlink(ignored);
      if (plain && it->path().filename().native().front() != '.') below.push_back(it->path());
    }
    std::sort(below.begin(), below.end());
    for (const fs::path& path : below) ListFolders(path, depth + 1);
  }

  void Add(Job job, const std::string& place, const std::string& suffix = "") {
    std::string joined = fs::path(place).lexically_relative(root_).generic_string() + suffix;
    std::replace(joined.begin(), joined.end(), '/', '_');
    std::replace(joined.begin(), joined.end(), '.', '_');
    planned_.push_back({std::move(job), AssetNameFromPath(joined)});
  }

  void AddScenes(const std::string& folder) {
    for (const std::string& path : FindSceneFiles(folder)) {
      Job job;
      job.scene = path;
      const auto scene = ReadScene(path);
      if (!scene) {  // its run says why
        job.asset = AssetNameFromPath(fs::path(path).filename().string());
        job.scene_material = "#0";
        Add(std::move(job), path);
        continue;
      }
      for (std::string& file : FilesOfScene(*scene)) claimed_.insert(std::move(file));
      for (const SceneMaterial& material : scene->materials) {
        job.asset = material.asset;
        job.scene_material = SceneMaterialKey(*scene, material);
        Add(job, folder, "_" + material.asset);
      }
    }
  }

  void AddSets(const std::string& folder) {
    const auto all = FindSetNames(folder), free = FindSetNames(folder, claimed_);
    if (!all || !free) return;              // no images
    for (const std::string& set : *free) {  // its name begins with the folder's
      Job job;
      job.folder = folder;
      job.asset = AssetNameFromPath(set);
      if (all->size() > 1) job.set = set;
      Add(std::move(job), fs::path(folder).parent_path() / set);
    }
  }

  void AddBrdfs(const std::string& folder) {
    const auto files = FindBrdfFiles(folder);
    if (!files) return;
    for (const std::string& file : *files) {
      Add(JobOfBrdfFile(BrdfAssetName(file), file), file);
    }
  }

  // Two assets of one name would take turns at being published.
  std::vector<Job> NamedApart() {
    std::map<std::string, int> uses;
    for (const PlannedUpload& planned : planned_) ++uses[planned.job.asset];
    std::set<std::string> taken;
    std::vector<Job> jobs;
    for (PlannedUpload& planned : planned_) {
      std::string name = uses[planned.job.asset] > 1 ? planned.place : planned.job.asset;
      for (int number = 2; !taken.insert(name).second; ++number)
        name = planned.place.substr(0, 90) + "_" + std::to_string(number);
      planned.job.asset = name;
      jobs.push_back(std::move(planned.job));
    }
    return jobs;
  }

  fs::path root_;
  std::vector<std::string> folders_;
  std::set<std::string> claimed_;
  std::vector<PlannedUpload> planned_;
};

}  // namespace

std::vector<Job> PlanUpload(const std::string& folder) { return UploadPlanner(folder).Run(); }

}  // namespace patina::daemon
