#include "pipeline/jobs/scene_job.h"

#include <algorithm>
#include <filesystem>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/scene/scene_json.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

std::string NamesOf(const Scene& scene) {
  constexpr size_t kMost = 20;
  std::string names;
  for (size_t i = 0; i < scene.materials.size(); ++i) {
    if (i == kMost) return names + ", ... (" + std::to_string(scene.materials.size()) + " in all)";
    names += (i == 0 ? "" : ", ") + SceneMaterialKey(scene, scene.materials[i]);
  }
  return names;
}

}  // namespace

std::string SceneMaterialKey(const Scene& scene, const SceneMaterial& material) {
  const std::string& name = material.look.material;
  const auto same =
      std::count_if(scene.materials.begin(), scene.materials.end(),
                    [&](const SceneMaterial& other) { return other.look.material == name; });
  const bool plain = same == 1 && !name.empty() && name.size() <= 128 && name[0] != '#';
  return plain ? name : "#" + std::to_string(material.look.index);
}

Result<SceneChoice> SceneOfJob(const Job& job) {
  SceneChoice choice;
  PATINA_ASSIGN(choice.scene, ReadScene(job.scene));
  const auto& materials = choice.scene.materials;
  while (choice.index < materials.size() &&
         SceneMaterialKey(choice.scene, materials[choice.index]) != job.scene_material &&
         "#" + std::to_string(choice.index) != job.scene_material) {
    ++choice.index;
  }
  if (choice.index == materials.size()) {
    return Fail(ErrorCode::kNotFound, job.scene + ": there is no material " +
                                          QuoteForMessage(job.scene_material) + "; it has " +
                                          NamesOf(choice.scene));
  }
  if (choice.material().problem) return Fail(*choice.material().problem);
  return choice;
}

std::vector<std::string> FindSceneFiles(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    const std::string name = entry->path().filename().string();
    if (name[0] != '.' && IsSceneFileName(name) && entry->is_regular_file(ignored))
      files.push_back(entry->path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<std::string> FilesOfScene(const Scene& scene) {
  std::vector<std::string> files;
  std::error_code ignored;
  for (const SceneImage& image : scene.images) {
    if (!image.path.empty() && !image.embedded)
      files.push_back(fs::weakly_canonical(image.path, ignored).string());
  }
  return files;
}

Result<std::vector<Job>> JobsOfScene(const std::string& path) {
  PATINA_ASSIGN(const Scene scene, ReadScene(path));
  std::vector<Job> jobs;
  for (const SceneMaterial& material : scene.materials) {
    Job job;
    job.asset = material.asset;
    job.scene = path;
    job.scene_material = SceneMaterialKey(scene, material);
    jobs.push_back(std::move(job));
  }
  return jobs;
}

}  // namespace patina
