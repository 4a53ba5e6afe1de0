#include "formats/container.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>

#include "formats/base/check.h"
#include "formats/base/names.h"
#include "formats/base/sha256.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLockName = ".lock";
constexpr std::string_view kStagingPrefix = ".staging-";

// The lock on an asset; gone when the process is.
class AssetLock {
 public:
  AssetLock() = default;
  ~AssetLock() { Release(); }
  AssetLock(const AssetLock&) = delete;
  AssetLock& operator=(const AssetLock&) = delete;

  // Creates the asset's directory and takes its lock.
  Status Acquire(const std::string& asset_directory, FileSystem& files) {
    path_ = asset_directory + "/" + kLockName;
    // A bake that ends without a container removes its lock file and directory; then this one
    // starts over.
    for (int attempt = 0; attempt < 100; ++attempt) {
      PATINA_TRY(MakeDirectories(asset_directory, files));
      fd_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
      if (fd_ < 0 && errno == ENOENT) continue;
      if (fd_ < 0) return FailErrno(errno, "cannot create", path_);
      if (::flock(fd_, LOCK_EX | LOCK_NB) != 0) {
        const int error = errno;
        Release();
        if (error != EWOULDBLOCK) return FailErrno(error, "cannot lock", path_);
        break;
      }
      struct stat mine;
      struct stat there;
      if (::fstat(fd_, &mine) == 0 && ::stat(path_.c_str(), &there) == 0 &&
          mine.st_ino == there.st_ino && mine.st_dev == there.st_dev) {
        return {};
      }
      Release();
    }
    return Fail(ErrorCode::kConflict,
                "another bake is writing to " + asset_directory + "; wait for it to end");
  }

  // Removes the lock file and, if nothing else is in it, the asset's directory.
  void RemoveEmptyAsset(const std::string& asset_directory) {
    std::error_code ignored;
    int others = 0;
    for (const auto& entry : fs::directory_iterator(asset_directory, ignored)) {
      if (entry.path().filename() != kLockName) ++others;
    }
    if (others != 0) return;
    ::unlink(path_.c_str());
    ::rmdir(asset_directory.c_str());
  }

 private:
  void Release() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }

  int fd_ = -1;
  std::string path_;
};

// The process id in ".staging-<pid>-<n>", or 0.
pid_t PidOfStaging(std::string_view name) {
  if (name.substr(0, kStagingPrefix.size()) != kStagingPrefix) return 0;
  name.remove_prefix(kStagingPrefix.size());
  pid_t pid = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), pid);
  return error == std::errc() && pid > 0 && end < name.data() + name.size() && *end == '-' ? pid
                                                                                           : 0;
}

// A zombie is dead as well: where nobody reaps orphans, as in many a container, it stays for ever.
bool IsDead(pid_t pid) {
  if (::kill(pid, 0) != 0) return errno == ESRCH;
  std::ifstream stat("/proc/" + std::to_string(pid) + "/stat");
  std::string line;
  std::getline(stat, line);
  // "pid (name) state ..."; the name may hold anything.
  const size_t end = line.rfind(") ");
  return end != std::string::npos && line.compare(end, 3, ") Z") == 0;
}

// Call with the lock held: then no staging area of this process is alive either.
void RemoveDeadStaging(const std::string& asset_directory) {
  std::vector<fs::path> dead;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(asset_directory, ignored)) {
    const pid_t pid = PidOfStaging(entry.path().filename().string());
    if (pid != 0 && (pid == ::getpid() || IsDead(pid))) dead.push_back(entry.path());
  }
  for (const fs::path& path : dead) fs::remove_all(path, ignored);
}

// The number of "r0012", or 0.
int RevisionNumber(std::string_view name) {
  if (name.size() < 5 || name.size() > 10 || name.front() != 'r') return 0;
  int number = 0;
  const auto [end, error] = std::from_chars(name.data() + 1, name.data() + name.size(), number);
  return error == std::errc() && end == name.data() + name.size() && number > 0 ? number : 0;
}

std::string RevisionName(int number) {
  char text[16];
  std::snprintf(text, sizeof text, "r%04d", number);
  return text;
}

Result<int> NewestRevision(const std::string& asset_directory) {
  int newest = 0;
  std::error_code error;
  for (fs::directory_iterator entry(asset_directory, error), end; !error && entry != end;
       entry.increment(error)) {
    newest = std::max(newest, RevisionNumber(entry->path().filename().string()));
  }
  if (error) return FailErrno(error.value(), "cannot list", asset_directory);
  return newest;
}

}  // namespace

Status CheckAssetName(std::string_view name) { return CheckPlainName(name, "asset name"); }

struct StagingArea::State {
  FileSystem* files = nullptr;
  std::string asset;
  std::string out_directory;
  std::string asset_directory;
  std::string directory;
  std::string link;  // the new `current` before it gets its name
  AssetLock lock;
  std::vector<ManifestPayload> payloads;
  std::set<std::string> names;
  bool has_manifest = false;
  bool published = false;

  ~State() {
    if (asset_directory.empty()) return;
    std::error_code ignored;
    if (!published && !directory.empty()) {
      fs::remove_all(directory, ignored);
      fs::remove(link, ignored);
    }
    lock.RemoveEmptyAsset(asset_directory);
  }

  Status Write(const std::string& name, std::span<const uint8_t> bytes) {
    PATINA_TRY(CheckPlainName(name, "payload name"));
    if (name == kManifestName || !names.insert(name).second) {
      return Fail(ErrorCode::kConflict,
                  "the container already has a file " + QuoteForMessage(name));
    }
    return WriteSynced(name, bytes);
  }

  Status WriteSynced(const std::string& name, std::span<const uint8_t> bytes) {
    const std::string path = directory + "/" + name;
    const int error = files->WriteSynced(path, bytes);
    if (error != 0) return FailErrno(error, "cannot write", path);
    return {};
  }
};

StagingArea::StagingArea(std::unique_ptr<State> state) : state_(std::move(state)) {}
StagingArea::StagingArea(StagingArea&&) noexcept = default;
StagingArea& StagingArea::operator=(StagingArea&&) noexcept = default;
StagingArea::~StagingArea() = default;

Result<StagingArea> StagingArea::Create(const std::string& out_directory, const std::string& asset,
                                        FileSystem& files) {
  PATINA_TRY(CheckAssetName(asset));
  auto state = std::make_unique<State>();
  state->files = &files;
  state->asset = asset;
  state->out_directory = out_directory.empty() ? "." : out_directory;
  const std::string asset_directory = state->out_directory + "/" + asset;
  PATINA_TRY(state->lock.Acquire(asset_directory, files));
  state->asset_directory = asset_directory;
  RemoveDeadStaging(asset_directory);
  int error = files.Sync(state->out_directory);
  if (error != 0) return FailErrno(error, "cannot sync", state->out_directory);

  static std::atomic<unsigned> counter{0};
  const std::string staging = asset_directory + "/" + std::string(kStagingPrefix) +
                              std::to_string(::getpid()) + "-" +
                              std::to_string(counter.fetch_add(1));
  error = files.MakeDirectory(staging);
  if (error != 0) return FailErrno(error, "cannot create directory", staging);
  state->directory = staging;
  state->link = staging + ".current";
  return StagingArea(std::move(state));
}

const std::string& StagingArea::directory() const { return state_->directory; }

const std::vector<ManifestPayload>& StagingArea::payloads() const { return state_->payloads; }

Status StagingArea::AddPayload(const std::string& name, const std::string& role,
                               std::span<const uint8_t> bytes) {
  PATINA_TRY(state_->Write(name, bytes));
  state_->payloads.push_back({name, role, bytes.size(), Sha256Hex(bytes)});
  return {};
}

Status StagingArea::AddUnlisted(const std::string& name, std::span<const uint8_t> bytes) {
  return state_->Write(name, bytes);
}

Status StagingArea::WriteManifest(Manifest manifest) {
  manifest.asset = state_->asset;
  manifest.payloads = state_->payloads;
  PATINA_ASSIGN(const std::string text, ToJson(manifest));
  PATINA_TRY(state_->WriteSynced(kManifestName, AsBytes(text)));
  state_->has_manifest = true;
  return {};
}

Result<PublishedContainer> StagingArea::Publish() {
  PATINA_CHECK(state_->has_manifest && !state_->published);
  FileSystem& files = *state_->files;
  const std::string& asset_directory = state_->asset_directory;
  const std::string current = asset_directory + "/" + kCurrentName;
  struct stat info;
  if (::lstat(current.c_str(), &info) == 0 && !S_ISLNK(info.st_mode)) {
    return Fail(ErrorCode::kConflict, current + " is not a symbolic link; move it away");
  }
  int error = files.Sync(state_->directory);
  if (error != 0) return FailErrno(error, "cannot sync", state_->directory);

  PATINA_ASSIGN(int number, NewestRevision(asset_directory));
  PublishedContainer published;
  // The lock keeps other bakes out; a revision that a person puts there meanwhile is stepped over.
  do {
    published.revision = RevisionName(++number);
    published.directory = asset_directory + "/" + published.revision;
    error = files.RenameNew(state_->directory, published.directory);
  } while ((error == EEXIST || error == ENOTEMPTY) && number < 100000000);
  if (error != 0) return FailErrno(error, "cannot create", published.directory);

  error = files.Sync(asset_directory);
  if (error == 0) error = files.MakeSymlink(published.revision, state_->link);
  if (error == 0) error = files.Rename(state_->link, current);
  if (error != 0) {
    files.Rename(published.directory, state_->directory);
    return FailErrno(error, "cannot publish", published.directory);
  }
  state_->published = true;
  error = files.Sync(asset_directory);
  if (error != 0)
    published.warning = FailErrno(error, "cannot sync", asset_directory).value().message;
  return published;
}

Result<int> PruneRevisions(const std::string& out_directory, const std::string& asset, int keep) {
  PATINA_TRY(CheckAssetName(asset));
  const std::string asset_directory = out_directory + "/" + asset;
  std::error_code error;
  if (!fs::is_directory(asset_directory, error))
    return Fail(ErrorCode::kNotFound, "there is no asset " + asset_directory);
  AssetLock lock;
  PATINA_TRY(lock.Acquire(asset_directory, RealFileSystem()));
  RemoveDeadStaging(asset_directory);
  const fs::path target = fs::read_symlink(asset_directory + "/" + kCurrentName, error);
  const int current = error ? 0 : RevisionNumber(target.string());
  if (current == 0 || !fs::is_directory(asset_directory + "/" + target.string(), error)) return 0;
  std::vector<int> numbers;
  for (fs::directory_iterator entry(asset_directory, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    const int number = RevisionNumber(name);
    if (number != 0 && name == RevisionName(number)) numbers.push_back(number);
  }
  if (error) return FailErrno(error.value(), "cannot list", asset_directory);
  std::sort(numbers.rbegin(), numbers.rend());
  int removed = 0;
  for (size_t i = static_cast<size_t>(std::max(keep, 0)); i < numbers.size(); ++i) {
    if (numbers[i] == current) continue;
    // Renamed first, so that half of a revision is never seen under its name; what a crash leaves
    // is removed as dead staging.
    const std::string revision = asset_directory + "/" + RevisionName(numbers[i]);
    const std::string doomed = asset_directory + "/" + std::string(kStagingPrefix) +
                               std::to_string(::getpid()) + "-" + RevisionName(numbers[i]);
    if (const int failed = RealFileSystem().Rename(revision, doomed))
      return FailErrno(failed, "cannot remove", revision);
    fs::remove_all(doomed, error);
    if (error) return FailErrno(error.value(), "cannot remove", revision);
    ++removed;
  }
  return removed;
}

Result<Container> OpenContainer(const std::string& path) {
  std::error_code error;
  fs::path directory = path;
  if (fs::is_regular_file(path, error)) {
    if (directory.filename() != kManifestName) {
      return Fail(ErrorCode::kInvalidArgument,
                  path + " is not a container: name its directory or its manifest.json");
    }
    directory = directory.parent_path().empty() ? fs::path(".") : directory.parent_path();
  } else if (!fs::is_directory(path, error)) {
    return Fail(ErrorCode::kNotFound, path + ": no such container");
  } else if (!fs::exists(directory / kManifestName, error)) {
    if (!fs::exists(directory / kCurrentName, error)) {
      return Fail(ErrorCode::kNotFound,
                  path + " holds neither manifest.json nor a `current` revision");
    }
    directory /= kCurrentName;
  }
  Container container;
  const fs::path resolved = fs::canonical(directory, error);
  if (error) return FailErrno(error.value(), "cannot open", directory.string());
  container.directory = resolved.string();
  const std::string manifest_path = container.PathOf(kManifestName);
  PATINA_ASSIGN(const std::string text, ReadTextFile(manifest_path, kMaxManifestBytes));
  auto manifest = ParseManifest(text);
  if (!manifest) return Fail(std::move(manifest).error(), manifest_path);
  container.manifest = std::move(*manifest);
  return container;
}

Status VerifyPayloads(const Container& container) {
  if (container.manifest.brdf && !container.manifest.brdf->shared_codebook_file.empty()) {
    const ManifestBrdf& brdf = *container.manifest.brdf;
    // Beside the pack, or in the folder that holds the assets.
    std::string path = container.PathOf(brdf.shared_codebook_file);
    std::error_code ignored;
    if (!fs::exists(path, ignored)) path = container.PathOf("../../" + brdf.shared_codebook_file);
    PATINA_ASSIGN(const FileDigest digest, Sha256OfFile(path));
    if (digest.sha256 != brdf.shared_codebook_sha256) {
      return Fail(ErrorCode::kCorruptData,
                  path + " does not match its SHA-256 in the manifest; bake or copy it again");
    }
  }
  for (const ManifestPayload& payload : container.manifest.payloads) {
    const std::string path = container.PathOf(payload.name);
    PATINA_ASSIGN(const FileDigest digest, Sha256OfFile(path));
    if (digest.bytes != payload.bytes) {
      return Fail(ErrorCode::kCorruptData,
                  path + " has " + std::to_string(digest.bytes) + " bytes, the manifest says " +
                      std::to_string(payload.bytes) + "; bake or copy it again");
    }
    if (digest.sha256 != payload.sha256) {
      return Fail(ErrorCode::kCorruptData,
                  path + " does not match its SHA-256 in the manifest; bake or copy it again");
    }
  }
  return {};
}

}  // namespace patina
