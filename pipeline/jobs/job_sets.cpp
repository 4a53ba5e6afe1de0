#include "pipeline/jobs/job_sets.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "formats/layered/layered_file.h"
#include "formats/layered/varying_stack.h"
#include "pipeline/image/map_name.h"
#include "pipeline/jobs/brdf_files.h"
#include "pipeline/jobs/scene_job.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

struct Folder {
  std::vector<std::string> subfolders;  // sorted, hidden ones left out
  bool has_images = false;
};

Result<Folder> ListFolder(const std::string& path) {
  Folder folder;
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    std::error_code ignored;
    if (entry->is_directory(ignored)) {
      if (name[0] != '.') folder.subfolders.push_back(entry->path().string());
    } else if (HasImageExtension(name)) {
      folder.has_images = true;
    }
  }
  if (error) return Fail(ErrorCode::kIo, "cannot list the folder " + path + ": " + error.message());
  std::sort(folder.subfolders.begin(), folder.subfolders.end());
  return folder;
}

// The sets of a folder that nobody has claimed.
struct UnclaimedMaps {
  std::vector<MapSet> sets;
  bool several = false;  // the folder holds more than one, claimed ones included
};

void AddSets(const std::string& folder, const UnclaimedMaps& maps, FoundAssets* found) {
  for (const MapSet& set : maps.sets) {
    FoundAsset asset;
    asset.asset = AssetNameFromPath(set.name);
    asset.folder = folder;
    if (maps.several) asset.set = set.name;
    found->assets.push_back(std::move(asset));
  }
}

void AddProblem(const std::string& folder, const Error& error, FoundAssets* found) {
  FoundAsset asset;
  asset.asset = AssetNameFromPath(folder);
  asset.folder = folder;
  asset.problem = error.message;
  asset.problem_code = error.code;
  found->assets.push_back(std::move(asset));
}

// Adds the BRDF files of a folder whose other assets are those from `first` on.
void AddBrdfs(const std::string& folder, const std::vector<std::string>& files, size_t first,
              FoundAssets* found) {
  std::map<std::string, int> uses;
  for (size_t i = first; i < found->assets.size(); ++i) ++uses[found->assets[i].asset];
  for (const std::string& file : files) ++uses[BrdfAssetName(file)];
  for (const std::string& file : files) {
    FoundAsset asset;
    asset.asset = BrdfAssetName(file);
    if (uses[asset.asset] > 1) {
      std::string name = fs::path(file).filename().string();
      std::replace(name.begin(), name.end(), '.', '_');
      asset.asset = AssetNameFromPath(name);
    }
    asset.folder = folder;
    asset.file = file;
    found->assets.push_back(std::move(asset));
  }
}

// Adds the image sets of a folder. A folder that has any holds nothing else: its images are theirs.
bool AddImageSets(const std::string& folder, FoundAssets* found) {
  const std::vector<std::string> lists = FindImageSets(folder);
  AddBrdfs(folder, lists, found->assets.size(), found);
  return !lists.empty();
}

// Texture sets that no scene has claimed.
void DropClaimed(const std::set<std::string>& claimed, std::vector<MapSet>* sets) {
  std::error_code ignored;
  std::erase_if(*sets, [&](const MapSet& set) {
    return std::any_of(set.maps.begin(), set.maps.end(), [&](const MapSource& map) {
      return claimed.count(fs::weakly_canonical(map.path, ignored).string()) != 0;
    });
  });
}

// What the layered materials among these files read belongs to them.
void ClaimStackMaps(const std::vector<std::string>& files, std::set<std::string>* claimed) {
  for (const std::string& file : files) {
    if (!layered::IsLayersFileName(file) || !layered::HasStackMaps(file)) continue;
    for (std::string& map : MapsOfStack(file)) claimed->insert(std::move(map));
  }
}

// Whether every image of a folder is claimed, so that there is nothing to look for sets in.
bool HasOnlyClaimedImages(const std::string& folder, const std::set<std::string>& claimed) {
  if (claimed.empty()) return false;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    if (HasImageExtension(entry->path().filename().string()) &&
        claimed.count(fs::weakly_canonical(entry->path(), ignored).string()) == 0)
      return false;
  }
  return !error;
}

// No sets where all images of the folder are claimed.
Result<UnclaimedMaps> FindUnclaimedMaps(const std::string& folder,
                                        const std::set<std::string>& claimed) {
  UnclaimedMaps maps;
  if (HasOnlyClaimedImages(folder, claimed)) return maps;
  PATINA_ASSIGN(maps.sets, FindMaps(folder));
  maps.several = maps.sets.size() > 1;
  DropClaimed(claimed, &maps.sets);
  return maps;
}

// Adds the materials of the scenes of a folder, and the files that belong to them.
void AddScenes(const std::string& folder, FoundAssets* found, std::set<std::string>* claimed) {
  for (const std::string& path : FindSceneFiles(folder)) {
    auto scene = ReadScene(path);
    if (!scene) {
      FoundAsset asset;
      asset.asset = AssetNameFromPath(path);
      asset.folder = folder;
      asset.problem = scene.error().message;
      asset.problem_code = scene.error().code;
      found->assets.push_back(std::move(asset));
      continue;
    }
    const std::vector<std::string> files = FilesOfScene(*scene);
    claimed->insert(files.begin(), files.end());
    for (const SceneMaterial& material : scene->materials) {
      FoundAsset asset;
      asset.asset = material.asset;
      asset.folder = folder;
      asset.scene = path;
      asset.scene_material = SceneMaterialKey(*scene, material);
      found->assets.push_back(std::move(asset));
    }
  }
}

std::string Names(const std::vector<MapSet>& sets) {
  std::string names;
  for (const MapSet& set : sets) names += (names.empty() ? "" : ", ") + set.name;
  return names;
}

// A file's name for the manifest, without where it lies on this machine.
std::string PortableName(const std::string& file) {
  const fs::path path = fs::path(file).lexically_normal();
  return path.is_absolute() || *path.begin() == ".." ? path.filename().string()
                                                     : path.generic_string();
}

bool SameFolder(const std::string& a, const std::string& b) {
  std::error_code ignored;
  return !b.empty() && fs::equivalent(a, b, ignored);
}

}  // namespace

Result<MapSet> MapsOfJob(const Job& job) {
  if (!job.maps.empty()) {
    std::vector<MapRequest> requests;
    for (const JobMap& map : job.maps) {
      MapRequest request;
      request.role = map.role;
      request.file = map.file;
      request.channels = map.channels;
      request.color_space = map.color_space;
      // The parser has let no other names through.
      request.convention = ParseNormalConvention(map.convention).value_or(NormalConvention::kAuto);
      request.invert = map.invert;
      requests.push_back(std::move(request));
    }
    PATINA_ASSIGN(MapSet set, ResolveMaps(requests, job.maps_folder, job.asset));
    for (MapSource& map : set.maps) map.file = PortableName(map.file);
    for (MapNote& note : set.notes) note.file = PortableName(note.file);
    return set;
  }
  PATINA_ASSIGN(std::vector<MapSet> sets, FindMaps(job.folder));
  if (job.set.empty()) {
    if (sets.size() == 1) return std::move(sets[0]);
    return Fail(ErrorCode::kInvalidArgument,
                "the folder " + job.folder + " holds several materials: " + Names(sets) +
                    "; name one in the job's \"set\", or bake the folder with `patina bake`");
  }
  for (MapSet& set : sets) {
    if (set.name == job.set) return std::move(set);
  }
  return Fail(ErrorCode::kNotFound, "the folder " + job.folder + " holds no material named \"" +
                                        job.set + "\"; it holds " + Names(sets));
}

Result<FoundAssets> FindAssets(const std::string& folder, const std::string& except) {
  std::error_code error;
  const fs::file_status status = fs::status(folder, error);
  if (!fs::exists(status))
    return Fail(ErrorCode::kNotFound, "there is no folder or file " + folder + "; check the path");
  if (!fs::is_directory(status)) {
    return Fail(ErrorCode::kInvalidArgument,
                folder + " is neither a folder nor a job file (*.json) nor a BRDF file");
  }
  FoundAssets found;
  if (AddImageSets(folder, &found)) return found;
  PATINA_ASSIGN(const std::vector<std::string> brdfs, FindBrdfFiles(folder));
  std::set<std::string> claimed;
  AddScenes(folder, &found, &claimed);
  ClaimStackMaps(brdfs, &claimed);
  const bool has_owners = !found.assets.empty() || !claimed.empty();
  auto maps = FindUnclaimedMaps(folder, claimed);
  if (maps && !maps->sets.empty()) {
    AddSets(folder, *maps, &found);
    AddBrdfs(folder, brdfs, 0, &found);
    return found;
  }
  // Beside a scene or layers with maps, images that are no sets are theirs.
  if (!has_owners && maps.error().code != ErrorCode::kNotFound) {
    if (brdfs.empty()) return Fail(maps.error());
    AddProblem(folder, maps.error(), &found);
    AddBrdfs(folder, brdfs, 0, &found);
    return found;
  }

  AddBrdfs(folder, brdfs, 0, &found);
  PATINA_ASSIGN(const Folder content, ListFolder(folder));
  for (const std::string& subfolder : content.subfolders) {
    if (SameFolder(subfolder, except) || AddImageSets(subfolder, &found)) continue;
    const size_t first = found.assets.size();
    auto inner_brdfs = FindBrdfFiles(subfolder);
    const std::vector<std::string> files = inner_brdfs ? *inner_brdfs : std::vector<std::string>();
    AddScenes(subfolder, &found, &claimed);
    const size_t claims = claimed.size();
    ClaimStackMaps(files, &claimed);
    const bool inner_owners = found.assets.size() > first || claimed.size() > claims;
    auto inner = FindUnclaimedMaps(subfolder, claimed);
    if (inner) {
      AddSets(subfolder, *inner, &found);
    } else if (!inner_owners) {
      auto listed = ListFolder(subfolder);
      const bool no_images = listed && !listed->has_images;
      if (no_images && files.empty()) {
        found.skipped.push_back(subfolder);
        continue;
      }
      // Beside BRDF files, images that are no maps are pictures of them.
      if (!no_images && (files.empty() || inner.error().code != ErrorCode::kNotFound))
        AddProblem(subfolder, inner.error(), &found);
    }
    AddBrdfs(subfolder, files, first, &found);
  }
  if (found.assets.empty() && !maps) return Fail(maps.error());
  return found;
}

}  // namespace patina
