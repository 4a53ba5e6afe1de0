#include "daemon/api/container_files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/container.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxFiles = 1000;

struct Extension {
  const char* end;
  const char* content_type;
};
constexpr Extension kExtensions[] = {
    {".json", "application/json"}, {".html", "text/html; charset=utf-8"}, {".png", "image/png"},
    {".dds", "image/vnd-ms.dds"},  {".csv", "text/csv; charset=utf-8"},
};

}  // namespace

Result<OpenedFile> OpenBelow(const std::string& folder, const std::string& name) {
  PATINA_TRY(CheckRelativePath(name, "file name"));
  // One part after another, none of them a link: without ".." that never leaves the folder. openat2
  // would do it in one call, where containers and old kernels do not refuse it.
  UniqueFd folder_fd(open(folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  if (!folder_fd) return FailErrno(errno, "cannot open", folder);
  OpenedFile file;
  for (size_t begin = 0; !file.fd;) {
    const size_t slash = name.find('/', begin);
    const bool last = slash == std::string::npos;
    const std::string part = name.substr(begin, last ? slash : slash - begin);
    const int flags = last ? O_RDONLY | O_NONBLOCK : O_PATH | O_DIRECTORY;
    UniqueFd opened(openat(folder_fd.get(), part.c_str(), flags | O_NOFOLLOW | O_CLOEXEC));
    if (!opened) {
      const int error = errno;
      if (error == ELOOP || error == ENOTDIR)
        return Fail(ErrorCode::kNotFound, "there is no file " + QuoteForMessage(name));
      return FailErrno(error, "cannot open", name);
    }
    (last ? file.fd : folder_fd) = std::move(opened);
    begin = slash + 1;
  }
  struct stat info {};
  if (fstat(file.fd.get(), &info) != 0) return FailErrno(errno, "cannot look at", name);
  if (!S_ISREG(info.st_mode))
    return Fail(ErrorCode::kNotFound, QuoteForMessage(name) + " is no file");
  file.bytes = static_cast<uint64_t>(info.st_size);
  file.mtime_ns = info.st_mtim.tv_sec * 1000000000 + info.st_mtim.tv_nsec;
  return file;
}

Result<std::vector<ContainerFile>> FilesBelow(const std::string& folder) {
  std::vector<ContainerFile> files;
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, error), end;
  for (; !error && entry != end && files.size() < kMaxFiles; entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_symlink(ignored) || !entry->is_regular_file(ignored)) continue;
    const uintmax_t bytes = entry->file_size(ignored);
    if (ignored) continue;
    files.push_back({entry->path().lexically_relative(folder).generic_string(), bytes});
  }
  if (error) {
    return Fail(
        error == std::errc::no_such_file_or_directory ? ErrorCode::kNotFound : ErrorCode::kIo,
        "cannot list the container: " + error.message());
  }
  std::sort(files.begin(), files.end(),
            [](const ContainerFile& a, const ContainerFile& b) { return a.name < b.name; });
  return files;
}

Result<std::vector<AssetRevision>> RevisionsOf(const std::string& asset_folder) {
  std::vector<AssetRevision> revisions;
  std::error_code error;
  for (fs::directory_iterator entry(asset_folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    std::error_code ignored;
    // Neither `current`, nor what is still being made, nor `rejected`.
    const bool numbered = name.size() > 1 && name[0] == 'r' &&
                          name.find_first_not_of("0123456789", 1) == std::string::npos;
    if (!numbered || entry->is_symlink(ignored) || !entry->is_directory(ignored)) continue;
    struct stat info {};
    if (lstat((entry->path() / kManifestName).c_str(), &info) != 0 || !S_ISREG(info.st_mode))
      continue;
    revisions.push_back({name, entry->path().string(),
                         info.st_mtim.tv_sec * int64_t{1000} + info.st_mtim.tv_nsec / 1000000});
  }
  if (error) {
    return Fail(
        error == std::errc::no_such_file_or_directory ? ErrorCode::kNotFound : ErrorCode::kIo,
        "cannot list the revisions: " + error.message());
  }
  // Numbers have four digits, or more and then none in front.
  std::sort(revisions.begin(), revisions.end(), [](const AssetRevision& a, const AssetRevision& b) {
    return a.name.size() != b.name.size() ? a.name.size() > b.name.size() : a.name > b.name;
  });
  if (revisions.size() > kMaxFiles) revisions.resize(kMaxFiles);
  return revisions;
}

const char* ContentTypeOf(const std::string& name) {
  for (const Extension& extension : kExtensions) {
    const std::string_view end = extension.end;
    if (name.size() > end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0)
      return extension.content_type;
  }
  return "application/octet-stream";
}

}  // namespace patina::daemon
