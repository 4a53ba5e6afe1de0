#include "pipeline/jobs/drop_jobs.h"

#include <filesystem>
#include <iterator>
#include <set>
#include <utility>

#include "formats/base/sha256.h"
#include "formats/layered/layered_file.h"
#include "formats/layered/varying_stack.h"
#include "pipeline/image/map_groups.h"
#include "pipeline/jobs/brdf_files.h"
#include "pipeline/jobs/scene_job.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxNameLength = 80;  // leaves room for a set's name and a hash

std::string WithoutExtension(const std::string& path) {
  if (layered::IsLayersFileName(path))
    return path.substr(0, path.size() - layered::kLayersSuffix.size());
  const size_t slash = path.rfind('/');
  const size_t begin = slash == std::string::npos ? 0 : slash + 1;
  const size_t dot = path.rfind('.');
  return dot == std::string::npos || dot <= begin ? path : path.substr(0, dot);
}

std::string ParentOf(const std::string& path) { return fs::path(path).parent_path().string(); }

// The jobs of one folder.
class FolderJobs {
 public:
  FolderJobs(const std::string& root, const std::string& path, const std::string& name)
      : root_(root), path_(path), name_(name) {}

  std::vector<Job> Run() {
    AddImageSets();
    if (!jobs_.empty()) return std::move(jobs_);  // its images are no maps
    Claim();
    AddScenes();
    AddStacks();
    if (!jobs_.empty() || !claimed_.empty()) {
      const auto unclaimed = FindSetNames(path_, claimed_);
      if (unclaimed) AddSets(*unclaimed);  // images that are no sets are the scene's
      return std::move(jobs_);
    }
    const auto sets = FindSetNames(path_);
    if (sets && sets->size() > 1) {
      AddSets(*sets);
    } else {
      Job job;
      job.asset = name_;
      job.folder = path_;
      jobs_.push_back(std::move(job));
    }
    return std::move(jobs_);
  }

 private:
  void AddImageSets() {
    const std::vector<std::string> lists = FindImageSets(path_);
    for (const std::string& list : lists) {
      jobs_.push_back(JobOfBrdfFile(
          lists.size() == 1 ? name_ : AssetNameFromPath(name_ + "_" + BrdfAssetName(list)), list));
    }
  }

  // What layers here, and scenes and lists of images here and in folders above call theirs.
  void Claim() {
    std::vector<std::string> files;
    const auto add = [&files](std::vector<std::string> more) {
      std::move(more.begin(), more.end(), std::back_inserter(files));
    };
    for (const std::string& stack : FindMappedStacks(path_)) add(MapsOfStack(stack));
    for (std::string above = path_;; above = ParentOf(above)) {
      for (const std::string& path : FindSceneFiles(above)) {
        const auto scene = ReadScene(path);
        if (scene) add(FilesOfScene(*scene));
      }
      for (const std::string& list : FindImageSets(above)) add(ImagesOfSet(list));
      if (above == root_ || above.size() <= root_.size()) break;
    }
    for (std::string& file : files) {
      if (ParentOf(file) == path_) claimed_.insert(std::move(file));
    }
  }

  // Of a scene that cannot be read a job whose run will say why.
  void AddScenes() {
    for (const std::string& path : FindSceneFiles(path_)) {
      const auto scene = ReadScene(path);
      Job job;
      job.scene = path;
      if (!scene) {
        job.asset = AssetNameFromPath(name_ + "_scene");
        job.scene_material = "#0";
        jobs_.push_back(std::move(job));
        continue;
      }
      for (const SceneMaterial& material : scene->materials) {
        job.asset = AssetNameFromPath(name_ + "_" + material.asset);
        job.scene_material = SceneMaterialKey(*scene, material);
        jobs_.push_back(job);
      }
    }
  }

  // Layered materials with maps are named as other files are: after the way to them.
  void AddStacks() {
    for (const std::string& stack : FindMappedStacks(path_)) {
      const std::string name = BrdfAssetName(stack);
      jobs_.push_back(
          JobOfBrdfFile(path_ == root_ ? name : AssetNameFromPath(name_ + "_" + name), stack));
    }
  }

  void AddSets(const std::vector<std::string>& sets) {
    const std::string folder = fs::path(path_).filename().string();
    for (const std::string& set : sets) {
      const bool prefixed = set.rfind(folder + "_", 0) == 0;
      Job job;
      job.asset = AssetNameFromPath(name_ + (prefixed ? set.substr(folder.size()) : "_" + set));
      job.folder = path_;
      job.set = set;
      jobs_.push_back(std::move(job));
    }
  }

  const std::string& root_;
  const std::string& path_;
  const std::string& name_;
  std::set<std::string> claimed_;  // of the files in the folder
  std::vector<Job> jobs_;
};

// Whether two jobs bake the same; paths of both without links. The only set of a folder need not be
// named.
bool BakeTheSame(const Job& a, const Job& b) {
  const bool same_set = a.set == b.set || a.set.empty() || b.set.empty();
  return a.file == b.file && a.folder == b.folder && same_set && a.scene == b.scene &&
         a.scene_material == b.scene_material;
}

}  // namespace

std::string AssetNameBelow(const std::string& root_name, const std::string& relative,
                           bool is_file) {
  std::string path = relative.empty() ? root_name : relative;
  if (is_file) path = WithoutExtension(path);
  bool odd = path.empty() || path.size() > kMaxNameLength;
  std::string name;
  for (const char c : path) {
    const bool legal = IsAssetName(std::string_view(&c, 1)) || c == '-' || c == '.';
    odd = odd || !(legal || c == '/' || c == ' ');
    name += legal ? c : '_';
  }
  if (name.size() > kMaxNameLength) name.resize(kMaxNameLength);
  if (name.empty() || name[0] == '.' || name[0] == '-') {
    name = "_" + name;
    odd = true;
  }
  return odd ? name + "-" + Sha256Hex(std::string_view(path)).substr(0, 8) : name;
}

std::vector<Job> DropJobs(const std::string& root, const std::string& path, const std::string& name,
                          bool is_file) {
  if (is_file) return {JobOfBrdfFile(name, path)};
  return FolderJobs(root, path, name).Run();
}

std::optional<std::string> NameInDropFolder(const std::string& root, const Job& job) {
  if (!job.maps.empty()) return std::nullopt;
  Job real = job;
  for (std::string* path : {&real.file, &real.folder, &real.scene}) {
    if (path->empty()) continue;
    std::error_code error;
    *path = (fs::weakly_canonical(*path, error) / "").parent_path().string();
    if (error) return std::nullopt;
  }
  const bool is_file = real.kind == JobKind::kBrdf;
  const std::string path = is_file                ? real.file
                           : !real.folder.empty() ? real.folder
                                                  : ParentOf(real.file + real.scene);
  const std::string inside = root == "/" ? root : root + "/";
  if (path != root && path.compare(0, inside.size(), inside) != 0) return std::nullopt;
  const std::string relative = path == root ? "" : path.substr(inside.size());
  const std::string name = AssetNameBelow(fs::path(root).filename().string(), relative, is_file);
  for (const Job& dropped : DropJobs(root, path, name, is_file)) {
    if (BakeTheSame(dropped, real)) return dropped.asset;
  }
  return std::nullopt;
}

}  // namespace patina
