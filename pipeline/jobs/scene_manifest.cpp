#include "pipeline/jobs/scene_manifest.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/base/sha256.h"
#include "formats/container.h"
#include "formats/manifest_json.h"
#include "formats/scene/scene_json.h"
#include "pipeline/jobs/scene_job.h"

namespace patina {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

// Held while the published containers are looked at and the file is replaced.
class FolderLock {
 public:
  static Result<FolderLock> Take(const std::string& path) {
    const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
    if (fd < 0) return FailErrno(errno, "cannot open", path);
    FolderLock lock(fd);
    while (flock(fd, LOCK_EX) != 0) {
      if (errno != EINTR) return FailErrno(errno, "cannot lock", path);
    }
    return lock;
  }
  FolderLock(FolderLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FolderLock& operator=(FolderLock&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~FolderLock() {
    if (fd_ >= 0) close(fd_);
  }

 private:
  explicit FolderLock(int fd) : fd_(fd) {}
  int fd_;
};

Json MaterialJson(const SceneMaterial& material, const std::string& out,
                  const std::map<std::string, std::string>& problems) {
  Json json;
  json["asset"] = material.asset;
  json["pointer"] = material.pointer;
  const auto problem = problems.find(material.asset);
  if (problem != problems.end()) {
    json["problem"] = problem->second;
  } else if (material.problem) {
    json["problem"] = material.problem->message;
  }
  const auto container = OpenContainer(out + "/" + material.asset + "/" + kCurrentName);
  // Another asset of this name is not of this scene.
  if (!container || !container->manifest.scene ||
      container->manifest.scene->file != material.look.file) {
    json["scene"] = SceneLookToJson(material.look);
    return json;
  }
  const Manifest& manifest = container->manifest;
  json["revision"] = fs::path(container->directory).filename().string();
  json["container"] = material.asset + "/" + json["revision"].get<std::string>();
  json["kind"] = manifest.kind;
  json["fingerprint"] = manifest.fingerprint;
  json["scene"] = SceneLookToJson(*manifest.scene);
  json["constants"] = ConstantsToJson(manifest.channels);
  json["effects"] = EffectsToJson(manifest.effects);
  return json;
}

}  // namespace

Result<std::string> WriteSceneManifest(const std::string& scene_path, const std::string& out,
                                       const std::map<std::string, std::string>& problems) {
  PATINA_ASSIGN(const Scene scene, ReadScene(scene_path));
  PATINA_ASSIGN(const FileDigest digest, Sha256OfFile(scene_path));
  PATINA_TRY(MakeDirectories(out));
  const std::string path = out + "/" + scene.name + ".scene.json";
  PATINA_ASSIGN(const FolderLock lock, FolderLock::Take(out + "/." + scene.name + ".scene.lock"));
  Json json;
  json["format"] = "patina-scene";
  json["format_version"] = 1;
  json["name"] = scene.name;
  json["file"] = fs::path(scene_path).filename().string();
  json["sha256"] = digest.sha256;
  json["materials"] = Json::array();
  for (const SceneMaterial& material : scene.materials)
    json["materials"].push_back(MaterialJson(material, out, problems));
  const std::string text = json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  PATINA_TRY(WriteFileDurably(path, std::string_view(text)));
  return path;
}

}  // namespace patina
