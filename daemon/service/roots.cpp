#include "daemon/service/roots.h"

#include <filesystem>

#include "formats/base/names.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;

// The path with all links resolved as far as it exists; empty if that cannot be told.
std::string Resolved(const std::string& path) {
  std::error_code error;
  std::string resolved = fs::weakly_canonical(path, error).string();
  if (error) return "";
  while (resolved.size() > 1 && resolved.back() == '/') resolved.pop_back();
  return resolved;
}

bool IsBelow(const std::string& path, const std::string& folder) {
  if (folder.empty() || path.empty()) return false;
  if (folder == "/" || path == folder) return true;
  return path.size() > folder.size() && path.compare(0, folder.size(), folder) == 0 &&
         path[folder.size()] == '/';
}

std::string Listed(const std::vector<std::string>& folders) {
  std::string list;
  for (const std::string& folder : folders) list += (list.empty() ? "" : ", ") + folder;
  return list.empty() ? "none" : list;
}

Status Confine(const std::string& pointer, const std::vector<std::string>& folders,
               const char* option, std::string* path) {
  const auto refuse = [&](const std::string& why) {
    return Fail(ErrorCode::kInvalidArgument, pointer + ": " + QuoteForMessage(*path) + " " + why);
  };
  if (path->empty() || path->front() != '/') return refuse("is not an absolute path");
  if (!IsUtf8(*path)) return refuse("is not UTF-8, which a job file must be; rename it");
  const std::string resolved = Resolved(*path);
  if (!LiesWithin(*path, folders)) {
    return refuse("lies outside the folders that jobs may use here (" + Listed(folders) +
                  "); move it there, or add its folder to \"" + option + "\" of the configuration");
  }
  *path = resolved;
  return {};
}

}  // namespace

bool LiesWithin(const std::string& path, const std::vector<std::string>& folders) {
  const std::string resolved = Resolved(path);
  for (const std::string& folder : folders) {
    if (IsBelow(resolved, Resolved(folder))) return true;
  }
  return false;
}

Status ConfineJob(const Roots& roots, Job* job) {
  PATINA_TRY(Confine("/out", roots.output, "output_roots", &job->out));
  if (!job->file.empty()) PATINA_TRY(Confine("/file", roots.input, "input_roots", &job->file));
  if (!job->folder.empty())
    PATINA_TRY(Confine("/folder", roots.input, "input_roots", &job->folder));
  if (!job->scene.empty()) PATINA_TRY(Confine("/scene", roots.input, "input_roots", &job->scene));
  for (size_t i = 0; i < job->maps.size(); ++i) {
    std::string& file = job->maps[i].file;
    if (!file.empty() && file.front() != '/' && !job->folder.empty())
      file = job->folder + "/" + file;
    PATINA_TRY(Confine("/maps/" + std::to_string(i) + "/file", roots.input, "input_roots", &file));
  }
  if (!job->ocio.empty()) PATINA_TRY(Confine("/ocio", roots.input, "input_roots", &job->ocio));
  job->maps_folder = job->folder;
  return {};
}

std::vector<std::string> InputsOf(const Job& job, const Roots& roots) {
  std::vector<std::string> inputs;
  if (!job.file.empty()) inputs.push_back(job.file);
  for (const JobMap& map : job.maps) inputs.push_back(map.file);
  // Its tables lie beside it or below.
  if (!job.ocio.empty()) inputs.push_back(fs::path(job.ocio).parent_path().string());
  // A scene, a set of images and layers with maps read nothing from outside of their folders.
  if (!job.scene.empty()) inputs.push_back(FolderOfFile(job.scene));
  if (job.kind == JobKind::kSvbrdf && !job.file.empty()) inputs.push_back(FolderOfFile(job.file));
  if (job.folder.empty()) return inputs;
  inputs.push_back(job.folder);
  constexpr int kMostLinks = 1000;
  std::error_code error;
  for (fs::directory_iterator entry(job.folder, error), end;
       !error && entry != end && inputs.size() < kMostLinks; entry.increment(error)) {
    std::error_code ignored;
    if (!entry->is_symlink(ignored)) continue;
    const std::string target = Resolved(entry->path().string());
    if (LiesWithin(target, roots.input)) inputs.push_back(target);
  }
  return inputs;
}

}  // namespace patina::daemon
