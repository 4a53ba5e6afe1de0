#include "daemon/base/file_calls.h"

#include <dirent.h>
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>

namespace patina::daemon {
namespace {

class PosixFileCalls : public FileCalls {
 public:
  int WriteSynced(const std::string& path, std::span<const uint8_t> bytes) override {
    return RealFileSystem().WriteSynced(path, bytes);
  }
  int Sync(const std::string& path) override { return RealFileSystem().Sync(path); }
  int MakeDirectory(const std::string& path) override {
    return RealFileSystem().MakeDirectory(path);
  }
  int Rename(const std::string& from, const std::string& to) override {
    return RealFileSystem().Rename(from, to);
  }
  int RenameNew(const std::string& from, const std::string& to) override {
    return RealFileSystem().RenameNew(from, to);
  }
  int MakeSymlink(const std::string& target, const std::string& path) override {
    return RealFileSystem().MakeSymlink(target, path);
  }
  int RemoveFile(const std::string& path) override { return RealFileSystem().RemoveFile(path); }

  int Open(const std::string& path, int flags, mode_t mode, int* fd) override {
    *fd = ::open(path.c_str(), flags | O_CLOEXEC, mode);
    return *fd >= 0 ? 0 : errno;
  }

  int Close(int fd) override { return ::close(fd) == 0 ? 0 : errno; }

  int Read(int fd, std::span<uint8_t> bytes, size_t* done) override {
    ssize_t n;
    do {
      n = ::read(fd, bytes.data(), bytes.size());
    } while (n < 0 && errno == EINTR);
    *done = n > 0 ? static_cast<size_t>(n) : 0;
    return n >= 0 ? 0 : errno;
  }

  int Write(int fd, std::span<const uint8_t> bytes) override {
    size_t done = 0;
    while (done < bytes.size()) {
      const ssize_t n = ::write(fd, bytes.data() + done, bytes.size() - done);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) return errno;
      done += static_cast<size_t>(n);
    }
    return 0;
  }

  int SyncFile(int fd) override { return ::fsync(fd) == 0 ? 0 : errno; }

  int Stat(const std::string& path, bool follow, struct stat* info) override {
    const int result = follow ? ::stat(path.c_str(), info) : ::lstat(path.c_str(), info);
    return result == 0 ? 0 : errno;
  }

  int List(const std::string& path, size_t max_entries,
           std::vector<DirectoryEntry>* entries) override {
    entries->clear();
    DIR* directory = ::opendir(path.c_str());
    if (directory == nullptr) return errno;
    int error = 0;
    for (;;) {
      errno = 0;
      const dirent* entry = ::readdir(directory);
      if (entry == nullptr) {
        error = errno;
        break;
      }
      const std::string_view name = entry->d_name;
      if (name == "." || name == "..") continue;
      if (entries->size() >= max_entries) {
        error = EOVERFLOW;
        break;
      }
      entries->push_back({std::string(name), entry->d_type});
    }
    ::closedir(directory);
    return error;
  }

  int RemoveDirectory(const std::string& path) override {
    return ::rmdir(path.c_str()) == 0 ? 0 : errno;
  }

  int RemoveTree(const std::string& path) override {
    std::error_code error;
    std::filesystem::remove_all(path, error);
    return error.value();
  }
};

}  // namespace

FileCalls& RealFileCalls() {
  static PosixFileCalls calls;
  return calls;
}

}  // namespace patina::daemon
