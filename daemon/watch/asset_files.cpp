#include "daemon/watch/asset_files.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>

#include "formats/base/file_io.h"
#include "formats/brdf/brdf_source.h"
#include "formats/scene/scene.h"
#include "pipeline/image/map_name.h"
#include "pipeline/svbrdf/image_set.h"

namespace patina::daemon {
namespace {

constexpr int64_t kNsPerSecond = 1000000000;

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

bool BeginsWith(std::string_view text, std::string_view begin) {
  return text.substr(0, begin.size()) == begin;
}

void Fill(const struct stat& info, Entry* entry) {
  entry->kind = S_ISREG(info.st_mode)   ? Entry::Kind::kFile
                : S_ISDIR(info.st_mode) ? Entry::Kind::kFolder
                                        : Entry::Kind::kOther;
  entry->device = info.st_dev;
  entry->inode = info.st_ino;
  entry->size = static_cast<uint64_t>(std::max<off_t>(0, info.st_size));
  entry->mtime_ns = info.st_mtim.tv_sec * kNsPerSecond + info.st_mtim.tv_nsec;
  entry->ctime_ns = info.st_ctim.tv_sec * kNsPerSecond + info.st_ctim.tv_nsec;
}

// 0 or an errno value.
int LookAtInner(int folder_fd, const std::string& name, Entry* entry) {
  struct stat info {};
  if (fstatat(folder_fd, name.c_str(), &info, AT_SYMLINK_NOFOLLOW) != 0) return errno;
  entry->name = name;
  entry->is_link = S_ISLNK(info.st_mode);
  if (entry->is_link && fstatat(folder_fd, name.c_str(), &info, 0) != 0) {
    entry->kind = Entry::Kind::kOther;
    return 0;
  }
  Fill(info, entry);
  return 0;
}

}  // namespace

FileRole RoleOfFile(std::string_view name) {
  constexpr std::string_view kSilent[] = {".DS_Store", "Thumbs.db", "desktop.ini", "Desktop.ini",
                                          ".directory"};
  for (const std::string_view silent : kSilent) {
    if (name == silent) return FileRole::kNone;
  }
  if (EndsWith(name, ".failed.json") || BeginsWith(name, "._") || BeginsWith(name, ".nfs") ||
      BeginsWith(name, ".fuse_hidden"))
    return FileRole::kNone;
  if (IsHiddenName(name)) return FileRole::kOther;
  const std::string text(name);
  // A scene or a list of images is baked with the images beside it.
  if (HasImageExtension(text) || NamesFilesBelow(text)) return FileRole::kImage;
  return brdf::HasBrdfExtension(text) ? FileRole::kBrdf : FileRole::kOther;
}

bool NamesFilesBelow(const std::string& name) {
  return IsSceneFileName(name) || svbrdf::IsImageSetFileName(name);
}

bool IsHiddenName(std::string_view name) { return !name.empty() && name[0] == '.'; }

Result<std::vector<Entry>> ListEntries(const std::string& folder) {
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC | O_NOFOLLOW);
  if (fd < 0) return FailErrno(errno, "cannot list the folder", folder);
  DIR* directory = fdopendir(fd);
  if (directory == nullptr) {
    const int error = errno;
    close(fd);
    return FailErrno(error, "cannot list the folder", folder);
  }
  std::vector<Entry> entries;
  int error = 0;
  for (;;) {
    errno = 0;
    const dirent* item = readdir(directory);
    if (item == nullptr) {
      error = errno;
      break;
    }
    const std::string name = item->d_name;
    if (name == "." || name == "..") continue;
    Entry entry;
    if (LookAtInner(fd, name, &entry) == 0) entries.push_back(std::move(entry));
  }
  closedir(directory);
  if (error != 0) return FailErrno(error, "cannot list the folder", folder);
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return a.name < b.name; });
  return entries;
}

Result<Entry> LookAt(const std::string& folder, const std::string& name) {
  Entry entry;
  const std::string path = folder + "/" + name;
  const int error = LookAtInner(AT_FDCWD, path, &entry);
  if (error != 0) return FailErrno(error, "cannot look at", path);
  entry.name = name;
  return entry;
}

void AppendIdentity(const Entry& entry, std::string* text) {
  // A name cannot hold a NUL, so no two lists of files give one text.
  *text += entry.name;
  *text += '\0';
  *text += std::to_string(entry.size) + " " + std::to_string(entry.mtime_ns) + " " +
           std::to_string(entry.ctime_ns) + "\n";
}

WriterState WriterOf(const std::string& path) {
  // A read lease is granted only while nobody has the file open for writing. A writer who comes
  // while it is held waits until it is given back, some microseconds later; the signal that tells
  // its holder so must be one that is ignored, as SIGIO, the default, ends the process.
  const int fd = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOFOLLOW);
  if (fd < 0) return WriterState::kUnknown;
  WriterState state = WriterState::kUnknown;
  if (fcntl(fd, F_SETSIG, SIGURG) == 0) {
    if (fcntl(fd, F_SETLEASE, F_RDLCK) == 0) {
      fcntl(fd, F_SETLEASE, F_UNLCK);
      state = WriterState::kNone;
    } else if (errno == EAGAIN) {
      state = WriterState::kOpen;
    }
  }
  close(fd);
  return state;
}

}  // namespace patina::daemon
