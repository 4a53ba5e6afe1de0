#include "pipeline/validate/container_files.h"

#include <algorithm>
#include <filesystem>

#include "formats/base/file_io.h"

namespace patina::validate {
namespace fs = std::filesystem;

Result<std::vector<uint8_t>> ReadFileAs(const std::string& path, const std::string& shown,
                                        uint64_t max_bytes) {
  std::error_code error;
  // A link could lead out of the container.
  if (fs::is_symlink(path, error))
    return Fail(ErrorCode::kInvalidArgument, shown + " is not a regular file");
  auto bytes = ReadFile(path, max_bytes);
  if (bytes) return bytes;
  Error failure = std::move(bytes).error();
  for (size_t at; (at = failure.message.find(path)) != std::string::npos && path != shown;) {
    failure.message.replace(at, path.size(), shown);
    if (shown.find(path) != std::string::npos) break;
  }
  return Fail(std::move(failure));
}

Result<std::vector<ContainerEntry>> DirectoryFiles::List() const {
  std::vector<ContainerEntry> entries;
  std::error_code error;
  for (fs::directory_iterator entry(directory_, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    entries.push_back({entry->path().filename().string(),
                       entry->symlink_status(ignored).type() == fs::file_type::regular});
  }
  if (error) return FailErrno(error.value(), "cannot list", "the container's folder");
  std::sort(entries.begin(), entries.end(),
            [](const ContainerEntry& a, const ContainerEntry& b) { return a.name < b.name; });
  return entries;
}

Result<std::vector<uint8_t>> DirectoryFiles::Read(const std::string& name,
                                                  uint64_t max_bytes) const {
  return ReadFileAs(directory_ + "/" + name, name, max_bytes);
}

Result<std::vector<uint8_t>> DirectoryFiles::ReadShared(const std::string& name,
                                                        uint64_t max_bytes) const {
  auto found = Read(name, max_bytes);
  if (found || found.error().code != ErrorCode::kNotFound) return found;
  return ReadFileAs(directory_ + "/../../" + name, name, max_bytes);
}

}  // namespace patina::validate
