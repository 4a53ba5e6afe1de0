#include "formats/base/file_io.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

namespace patina {
namespace {

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  int Close() {
    const int fd = fd_;
    fd_ = -1;
    return ::close(fd) == 0 ? 0 : errno;
  }

 private:
  int fd_;
};

class PosixFileSystem : public FileSystem {
 public:
  int WriteSynced(const std::string& path, std::span<const uint8_t> bytes) override {
    Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
    if (file.get() < 0) return errno;
    size_t done = 0;
    while (done < bytes.size()) {
      const ssize_t n = ::write(file.get(), bytes.data() + done, bytes.size() - done);
      if (n < 0) {
        if (errno == EINTR) continue;
        return errno;
      }
      done += static_cast<size_t>(n);
    }
    if (::fsync(file.get()) != 0) return errno;
    return file.Close();
  }

  int Sync(const std::string& path) override {
    Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (file.get() < 0) return errno;
    // Some network file systems cannot sync a directory and say so with EINVAL; they have nothing
    // to sync then.
    if (::fsync(file.get()) != 0 && errno != EINVAL) return errno;
    return 0;
  }

  int MakeDirectory(const std::string& path) override {
    return ::mkdir(path.c_str(), 0777) == 0 ? 0 : errno;
  }

  int Rename(const std::string& from, const std::string& to) override {
    return ::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
  }

  int RenameNew(const std::string& from, const std::string& to) override {
    if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
    if (errno != EINVAL && errno != ENOSYS) return errno;
    // A file system without RENAME_NOREPLACE: callers hold a lock, so looking first is enough.
    struct stat info;
    if (::lstat(to.c_str(), &info) == 0) return EEXIST;
    return Rename(from, to);
  }

  int MakeSymlink(const std::string& target, const std::string& path) override {
    return ::symlink(target.c_str(), path.c_str()) == 0 ? 0 : errno;
  }

  int RemoveFile(const std::string& path) override {
    return ::unlink(path.c_str()) == 0 ? 0 : errno;
  }
};

std::string ParentOf(const std::string& path) {
  const std::string parent = std::filesystem::path(path).parent_path().string();
  return parent.empty() ? "." : parent;
}

template <class Bytes>
Result<Bytes> Read(const std::string& path, uint64_t max_bytes) {
  // O_NONBLOCK so that a pipe put in place of a file cannot hang the open.
  Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (file.get() < 0) return FailErrno(errno, "cannot open", path);
  struct stat info;
  if (::fstat(file.get(), &info) != 0) return FailErrno(errno, "cannot read", path);
  if (!S_ISREG(info.st_mode))
    return Fail(ErrorCode::kInvalidArgument, path + " is not a regular file");
  const auto size = static_cast<uint64_t>(info.st_size);
  if (size > max_bytes) {
    return Fail(ErrorCode::kOutOfRange, path + " has " + std::to_string(size) +
                                            " bytes, more than the limit of " +
                                            std::to_string(max_bytes));
  }
  Bytes bytes;
  bytes.resize(size);
  size_t done = 0;
  while (done < size) {
    const ssize_t n = ::read(file.get(), bytes.data() + done, size - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return FailErrno(errno, "cannot read", path);
    if (n == 0) return Fail(ErrorCode::kIo, path + " became shorter while it was read");
    done += static_cast<size_t>(n);
  }
  return bytes;
}

}  // namespace

FileSystem& RealFileSystem() {
  static PosixFileSystem files;
  return files;
}

tl::unexpected<Error> FailErrno(int error_number, const std::string& what,
                                const std::string& path) {
  ErrorCode code = ErrorCode::kIo;
  std::string remedy;
  switch (error_number) {
    case ENOENT:
      code = ErrorCode::kNotFound;
      break;
    case EEXIST:
      code = ErrorCode::kConflict;
      break;
    case ENOSPC:
    case EDQUOT:
      code = ErrorCode::kResourceExhausted;
      remedy = "; free some space or write elsewhere";
      break;
    case EMFILE:
    case ENFILE:
    case ENOMEM:
      code = ErrorCode::kResourceExhausted;
      break;
    case EACCES:
    case EPERM:
    case EROFS:
      remedy = "; check the permissions";
      break;
    default:
      break;
  }
  char buffer[256];
  const char* reason = ::strerror_r(error_number, buffer, sizeof buffer);
  return Fail(code, what + " " + path + ": " + reason + remedy);
}

Result<std::vector<uint8_t>> ReadFile(const std::string& path, uint64_t max_bytes) {
  return Read<std::vector<uint8_t>>(path, max_bytes);
}

Result<std::string> ReadTextFile(const std::string& path, uint64_t max_bytes) {
  return Read<std::string>(path, max_bytes);
}

Status WriteFileDurably(const std::string& path, std::span<const uint8_t> bytes,
                        FileSystem& files) {
  static std::atomic<unsigned> counter{0};
  const std::string temporary =
      path + ".tmp-" + std::to_string(::getpid()) + "-" + std::to_string(counter.fetch_add(1));
  int error = files.WriteSynced(temporary, bytes);
  if (error == 0) error = files.Rename(temporary, path);
  if (error != 0) {
    files.RemoveFile(temporary);
    return FailErrno(error, "cannot write", path);
  }
  error = files.Sync(ParentOf(path));
  if (error != 0) return FailErrno(error, "cannot sync", ParentOf(path));
  return {};
}

Status WriteFileDurably(const std::string& path, std::string_view text, FileSystem& files) {
  return WriteFileDurably(path, AsBytes(text), files);
}

Status MakeDirectories(const std::string& path, FileSystem& files) {
  struct stat info;
  if (path.empty() || ::stat(path.c_str(), &info) == 0) {
    if (path.empty() || S_ISDIR(info.st_mode)) return {};
    return Fail(ErrorCode::kConflict, path + " exists and is not a directory");
  }
  std::string trimmed = path;
  while (trimmed.size() > 1 && trimmed.back() == '/') trimmed.pop_back();
  PATINA_TRY(MakeDirectories(std::filesystem::path(trimmed).parent_path().string(), files));
  const int error = files.MakeDirectory(trimmed);
  if (error != 0 && error != EEXIST) return FailErrno(error, "cannot create directory", trimmed);
  return {};
}

}  // namespace patina
