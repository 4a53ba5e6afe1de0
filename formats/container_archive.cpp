#include "formats/container_archive.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <memory>
#include <set>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/base/sha256.h"
#include "formats/index_pack.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxUnlistedBytes = uint64_t{32} << 20;

bool IsUnlisted(const std::string& name) {
  return std::find(std::begin(kUnlistedFiles), std::end(kUnlistedFiles), name) !=
         std::end(kUnlistedFiles);
}

// An open file, shared by the functions that read it.
class OpenFile {
 public:
  explicit OpenFile(int fd) : fd_(fd) {}
  ~OpenFile() {
    if (fd_ >= 0) ::close(fd_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  int fd() const { return fd_; }

 private:
  int fd_;
};

Result<std::shared_ptr<OpenFile>> Open(const std::string& path, uint64_t* bytes) {
  // O_NONBLOCK so that a pipe put in place of a file cannot hang the open.
  auto file = std::make_shared<OpenFile>(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat info;
  if (file->fd() < 0) return FailErrno(errno, "cannot open", path);
  if (::fstat(file->fd(), &info) != 0) return FailErrno(errno, "cannot read", path);
  if (!S_ISREG(info.st_mode))
    return Fail(ErrorCode::kInvalidArgument, path + " is not a regular file");
  *bytes = static_cast<uint64_t>(info.st_size);
  return file;
}

// Writes a file piece by piece; synced by Close.
class NewFile {
 public:
  explicit NewFile(std::string path)
      : path_(std::move(path)),
        file_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666)),
        error_(file_.fd() < 0 ? errno : 0) {}
  Status Write(std::span<const uint8_t> bytes) {
    while (!bytes.empty() && error_ == 0) {
      const ssize_t written = ::write(file_.fd(), bytes.data(), bytes.size());
      if (written >= 0) {
        bytes = bytes.subspan(static_cast<size_t>(written));
      } else if (errno != EINTR) {
        error_ = errno;
      }
    }
    return Outcome();
  }
  Status Close() {
    if (error_ == 0 && ::fsync(file_.fd()) != 0) error_ = errno;
    return Outcome();
  }

 private:
  Status Outcome() const {
    if (error_ == 0) return {};
    return FailErrno(error_, "cannot write", path_);
  }
  std::string path_;
  OpenFile file_;
  int error_;
};

// A folder that goes away with the object unless Keep was called.
class Staging {
 public:
  explicit Staging(std::string path) : path_(std::move(path)) {}
  ~Staging() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;
  void Keep() { path_.clear(); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// Which members a container may have, and what its manifest says of them.
class WantedMembers {
 public:
  Status ReadManifest(const std::vector<uint8_t>& bytes) {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    auto manifest = ParseManifest(text);
    if (!manifest) return Fail(std::move(manifest).error(), kManifestName);
    manifest_ = std::move(*manifest);
    for (const ManifestPayload& payload : manifest_.payloads) missing_.insert(payload.name);
    return {};
  }

  Status Check(const ArchiveMember& member) {
    for (const ManifestPayload& payload : manifest_.payloads) {
      if (payload.name != member.name) continue;
      missing_.erase(member.name);
      if (payload.bytes == member.content_bytes && payload.sha256 == member.sha256) return {};
      return Refuse(member, "its size or SHA-256 is not that of the manifest");
    }
    if (IsUnlisted(member.name) && member.content_bytes <= kMaxUnlistedBytes) return {};
    if (manifest_.brdf && member.name == manifest_.brdf->shared_codebook_file) {
      if (member.sha256 == manifest_.brdf->shared_codebook_sha256 &&
          member.content_bytes <= kMaxIndexPackBytes)
        return {};
      return Refuse(member, "it is not the codebook of the manifest");
    }
    return Refuse(member, "the manifest does not list it");
  }

  Status CheckComplete() const {
    if (missing_.empty()) return {};
    return Fail(ErrorCode::kCorruptData, "bad member: " + QuoteForMessage(*missing_.begin()) +
                                             " of the manifest is not in the archive");
  }

 private:
  static Status Refuse(const ArchiveMember& member, const char* why) {
    return Fail(ErrorCode::kCorruptData, "bad member " + QuoteForMessage(member.name) + ": " + why);
  }
  Manifest manifest_;
  std::set<std::string> missing_;
};

Result<ArchiveMember> MemberOfFile(const std::string& path, const std::string& name) {
  PATINA_ASSIGN(const FileDigest digest, Sha256OfFile(path));
  ArchiveMember member;
  member.name = name;
  member.content_bytes = digest.bytes;
  member.sha256 = digest.sha256;
  return member;
}

}  // namespace

Result<ReadBytes> ReadPieces(const std::string& path) {
  uint64_t bytes = 0;
  PATINA_ASSIGN(const std::shared_ptr<OpenFile> file, Open(path, &bytes));
  return ReadBytes([file, path](std::span<uint8_t> out) -> Result<size_t> {
    for (;;) {
      const ssize_t got = ::read(file->fd(), out.data(), out.size());
      if (got >= 0) return static_cast<size_t>(got);
      if (errno != EINTR) return FailErrno(errno, "cannot read", path);
    }
  });
}

Result<ReadAt> OpenForReadAt(const std::string& path, uint64_t* bytes) {
  PATINA_ASSIGN(const std::shared_ptr<OpenFile> file, Open(path, bytes));
  return ReadAt([file, path](uint64_t offset, std::span<uint8_t> out) -> Status {
    while (!out.empty()) {
      const ssize_t got = ::pread(file->fd(), out.data(), out.size(), static_cast<off_t>(offset));
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) return FailErrno(errno, "cannot read", path);
      if (got == 0) return Fail(ErrorCode::kCorruptData, "truncated: the file became shorter");
      out = out.subspan(static_cast<size_t>(got));
      offset += static_cast<uint64_t>(got);
    }
    return {};
  });
}

Result<PackedContainer> PackContainer(const Container& container, int level,
                                      const WriteBytes& write,
                                      const std::function<void(const ArchiveMember&)>& on_member) {
  std::vector<std::pair<ArchiveMember, std::string>> plan;  // with the file's path
  const auto add = [&](const std::string& path, const std::string& name) -> Status {
    PATINA_ASSIGN(ArchiveMember member, MemberOfFile(path, name));
    plan.emplace_back(std::move(member), path);
    return {};
  };
  PATINA_TRY(add(container.PathOf(kManifestName), kManifestName));
  std::set<std::string> known = {kManifestName};
  known.insert(std::begin(kUnlistedFiles), std::end(kUnlistedFiles));
  for (const ManifestPayload& payload : container.manifest.payloads) {
    ArchiveMember member;
    member.name = payload.name;
    member.content_bytes = payload.bytes;
    member.sha256 = payload.sha256;
    plan.emplace_back(std::move(member), container.PathOf(payload.name));
    known.insert(payload.name);
  }
  if (container.manifest.brdf && !container.manifest.brdf->shared_codebook_file.empty()) {
    const std::string& name = container.manifest.brdf->shared_codebook_file;
    std::error_code ignored;
    std::string path = container.PathOf(name);
    if (!fs::exists(path, ignored)) path = container.PathOf("../../" + name);
    PATINA_TRY(add(path, name));
    if (plan.back().first.sha256 != container.manifest.brdf->shared_codebook_sha256) {
      return Fail(ErrorCode::kCorruptData,
                  path + " does not match its SHA-256 in the manifest; bake or copy it again");
    }
    known.insert(name);
  }
  PackedContainer packed;
  std::error_code error;
  for (fs::directory_iterator entry(container.directory, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (known.count(name) == 0) packed.left_out.push_back(name);
  }
  if (error) return FailErrno(error.value(), "cannot list", container.directory);
  std::sort(packed.left_out.begin(), packed.left_out.end());
  for (const char* name : kUnlistedFiles) {
    if (fs::exists(container.PathOf(name), error)) PATINA_TRY(add(container.PathOf(name), name));
  }

  PATINA_ASSIGN(ArchiveWriter writer,
                ArchiveWriter::Begin(static_cast<uint32_t>(plan.size()), level, write));
  for (auto& [member, path] : plan) {
    PATINA_ASSIGN(const ReadBytes read, ReadPieces(path));
    if (const Status added = writer.Add(std::move(member), read); !added)
      return Fail(added.error(), container.directory);
    on_member(writer.members().back());
  }
  PATINA_TRY(writer.Finish());
  packed.members = writer.members();
  return packed;
}

Result<std::vector<ArchiveMember>> UnpackArchive(
    const ReadBytes& read, const std::string& directory, uint64_t max_bytes,
    const std::function<void(const ArchiveMember&)>& on_member) {
  fs::path target = fs::path(directory).lexically_normal();
  if (!target.has_filename()) target = target.parent_path();
  std::error_code error;
  if (fs::exists(target, error) &&
      !(fs::is_directory(target, error) && fs::is_empty(target, error)))
    return Fail(ErrorCode::kConflict, directory + " is there already; name a new folder");
  const fs::path parent = target.has_parent_path() ? target.parent_path() : fs::path(".");
  PATINA_TRY(MakeDirectories(parent.string()));
  Staging staging(
      (parent / ("." + target.filename().string() + ".unpack-" + std::to_string(::getpid())))
          .string());
  FileSystem& files = RealFileSystem();
  if (const int failed = files.MakeDirectory(staging.path()))
    return FailErrno(failed, "cannot create directory", staging.path());

  ArchiveStream archive(read);
  PATINA_TRY(archive.Begin());
  WantedMembers wanted;
  std::vector<ArchiveMember> members;
  uint64_t total = 0;
  for (uint32_t i = 0; i < archive.count(); ++i) {
    PATINA_ASSIGN(const ArchiveMember member, archive.Next());
    if (member.content_bytes > max_bytes - total) {
      return Fail(ErrorCode::kOutOfRange,
                  QuoteForMessage(member.name) + " of " + std::to_string(member.content_bytes) +
                      " bytes makes more than the " + std::to_string(max_bytes) +
                      " bytes that may be unpacked; --max-bytes allows more");
    }
    total += member.content_bytes;
    if ((i == 0) != (member.name == kManifestName) ||
        (i == 0 && member.content_bytes > kMaxManifestBytes)) {
      return Fail(ErrorCode::kCorruptData, "bad member " + QuoteForMessage(member.name) +
                                               ": the first one is manifest.json");
    }
    if (i > 0) PATINA_TRY(wanted.Check(member));
    NewFile file(staging.path() + "/" + member.name);
    std::vector<uint8_t> manifest;
    PATINA_TRY(archive.Content([&](std::span<const uint8_t> bytes) -> Status {
      if (i == 0) manifest.insert(manifest.end(), bytes.begin(), bytes.end());
      return file.Write(bytes);
    }));
    PATINA_TRY(file.Close());
    if (i == 0) PATINA_TRY(wanted.ReadManifest(manifest));
    members.push_back(member);
    on_member(member);
  }
  PATINA_TRY(wanted.CheckComplete());
  PATINA_TRY(archive.End());
  int failed = files.Sync(staging.path());
  // Takes the place of an empty folder too.
  if (failed == 0) failed = files.Rename(staging.path(), target.string());
  if (failed != 0) return FailErrno(failed, "cannot create", target.string());
  staging.Keep();
  if (failed = files.Sync(parent.string()); failed != 0)
    return FailErrno(failed, "cannot sync", parent.string());
  return members;
}

}  // namespace patina
