#include "daemon/api/uploads.h"

#include <fcntl.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <charconv>
#include <set>

#include "daemon/api/tickets.h"
#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "pipeline/jobs/job.h"

namespace patina::daemon {
namespace {

constexpr int kDeepest = 8;  // folders in one another
constexpr size_t kMostKept = 1'000'000;
constexpr std::chrono::hours kCleanUpEvery{1};
// One that was closed without a note of its jobs: the daemon was stopped in between.
constexpr int64_t kKeepUnnotedS = 7 * 86400;

std::string ParentOf(const std::string& path) {
  const size_t slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

// Plain names, '/' between them: nothing hidden, nothing that leads out.
Status CheckName(const std::string& name) {
  for (size_t at = 0; at <= name.size();) {
    const size_t slash = std::min(name.find('/', at), name.size());
    PATINA_TRY(CheckPlainName(std::string_view(name).substr(at, slash - at), "file name"));
    at = slash + 1;
  }
  return {};
}

std::string Megabytes(uint64_t bytes) { return std::to_string(bytes >> 20) + " MiB"; }

std::vector<int64_t> JobsOf(const std::string& text) {
  std::vector<int64_t> jobs;
  const char* at = text.data();
  const char* end = at + text.size();
  while (at < end) {
    int64_t job = 0;
    const auto parsed = std::from_chars(at, end, job);
    if (parsed.ec != std::errc()) break;
    jobs.push_back(job);
    at = parsed.ptr + 1;
  }
  return jobs;
}

}  // namespace

Status Uploads::CheckFiles(const std::vector<UploadFile>& files) const {
  if (files.empty())
    return Fail(ErrorCode::kInvalidArgument, "/files: must name at least one file");
  if (files.size() > options_.max_files) {
    return Fail(ErrorCode::kOutOfRange, "/files: " + std::to_string(files.size()) +
                                            " files; at most " +
                                            std::to_string(options_.max_files) +
                                            " are taken at once; use a drop folder for more");
  }
  std::set<std::string> names, folders;
  uint64_t bytes = 0;
  for (size_t i = 0; i < files.size(); ++i) {
    const std::string at = "/files/" + std::to_string(i);
    const Status named = CheckName(files[i].name);
    if (!named) return Fail(named.error().code, at + "/name: " + named.error().message);
    if (std::count(files[i].name.begin(), files[i].name.end(), '/') > kDeepest) {
      return Fail(ErrorCode::kInvalidArgument, at + "/name: " + QuoteForMessage(files[i].name) +
                                                   " lies more than " + std::to_string(kDeepest) +
                                                   " folders deep");
    }
    if (!names.insert(files[i].name).second)
      return Fail(ErrorCode::kInvalidArgument,
                  at + "/name: " + QuoteForMessage(files[i].name) + " stands twice");
    for (std::string folder = ParentOf(files[i].name); !folder.empty(); folder = ParentOf(folder))
      folders.insert(folder);
    if (files[i].bytes > options_.max_bytes - bytes) {
      return Fail(ErrorCode::kOutOfRange, at + "/bytes: the files are larger than " +
                                              Megabytes(options_.max_bytes) +
                                              " together; use a drop folder for more");
    }
    bytes += files[i].bytes;
  }
  for (const std::string& folder : folders) {
    if (names.count(folder) != 0)
      return Fail(ErrorCode::kInvalidArgument,
                  "/files: " + QuoteForMessage(folder) + " is a file and a folder");
  }
  return CheckSpace(bytes);
}

Status Uploads::CheckSpace(uint64_t bytes) const {
  struct statvfs disk {};
  if (::statvfs(options_.folder.c_str(), &disk) != 0)
    return FailErrno(errno, "cannot look at the disk of", options_.folder);
  const uint64_t free = uint64_t{disk.f_bavail} * disk.f_frsize;
  if (free >= options_.keep_free_bytes && bytes <= free - options_.keep_free_bytes) return {};
  return Fail(ErrorCode::kResourceExhausted,
              "the disk of " + options_.folder + " has " + Megabytes(free) + " left, and " +
                  Megabytes(options_.keep_free_bytes) + " stay free; " + Megabytes(bytes) +
                  " do not fit: make room, or use a drop folder");
}

Result<std::string> Uploads::Begin(const std::string& name, const std::vector<UploadFile>& files,
                                   Clock::time_point now) {
  if (!IsAssetName(name)) {
    return Fail(ErrorCode::kInvalidArgument,
                "/name: " + QuoteForMessage(name) +
                    " is no name for an asset: 1 to 100 of A-Z a-z 0-9 _ - . and not beginning "
                    "with - or .");
  }
  PATINA_TRY(MakeDirectories(options_.folder, *options_.files));
  PATINA_TRY(CheckFiles(files));
  PATINA_ASSIGN(const std::string id, RandomName(12));
  auto upload = std::make_shared<Upload>();
  upload->folder = FolderOf(id) + "/" + name;
  upload->last = now;
  for (const UploadFile& file : files) upload->files[file.name].bytes = file.bytes;
  {
    const std::lock_guard lock(mutex_);
    if (open_.size() >= options_.max_open) {
      return Fail(ErrorCode::kResourceExhausted,
                  "there are " + std::to_string(options_.max_open) +
                      " uploads already; wait until one of them is complete");
    }
    open_[id] = upload;
  }
  const std::lock_guard lock(upload->mutex);
  Status made = MakeDirectories(upload->folder, *options_.files);
  for (const UploadFile& file : files) {
    const std::string path = upload->folder + "/" + file.name;
    if (made) made = MakeDirectories(ParentOf(path), *options_.files);
    // Of an empty file no piece comes.
    if (made && file.bytes == 0) made = Append(path, true, "");
  }
  if (made) return id;
  upload->ended = true;
  options_.files->RemoveTree(FolderOf(id));
  const std::lock_guard outer(mutex_);
  open_.erase(id);
  return Fail(made.error());
}

Result<std::shared_ptr<Uploads::Upload>> Uploads::Find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto found = open_.find(id);
  if (found != open_.end()) return found->second;
  return Fail(ErrorCode::kNotFound, "there is no open upload " + QuoteForMessage(id) +
                                        "; it is complete, was left for too long, or the daemon "
                                        "was started anew: begin again");
}

Status Uploads::Append(const std::string& path, bool first, std::string_view bytes) {
  int fd = -1;
  const int flags = O_WRONLY | O_NOFOLLOW | (first ? O_CREAT | O_TRUNC : O_APPEND);
  if (const int error = options_.files->Open(path, flags, 0600, &fd))
    return FailErrno(error, "cannot open", path);
  const int error = options_.files->Write(fd, AsBytes(bytes));
  options_.files->Close(fd);
  if (error != 0) return FailErrno(error, "cannot write", path);
  return {};
}

Result<uint64_t> Uploads::Write(const std::string& id, const std::string& file, uint64_t offset,
                                std::string_view bytes, Clock::time_point now) {
  PATINA_ASSIGN(const std::shared_ptr<Upload> upload, Find(id));
  const std::lock_guard lock(upload->mutex);
  const auto found = upload->files.find(file);
  if (upload->ended || found == upload->files.end())
    return Fail(ErrorCode::kNotFound, "the upload has no file " + QuoteForMessage(file));
  File& state = found->second;
  upload->last = now;
  if (offset != state.done) {
    return Fail(ErrorCode::kConflict, "the next piece of " + QuoteForMessage(file) +
                                          " begins at byte " + std::to_string(state.done) +
                                          ", not at " + std::to_string(offset));
  }
  if (bytes.size() > state.bytes - state.done) {
    return Fail(ErrorCode::kOutOfRange, QuoteForMessage(file) + " was announced with " +
                                            std::to_string(state.bytes) + " bytes; this is byte " +
                                            std::to_string(state.done + bytes.size()));
  }
  const std::string path = upload->folder + "/" + file;
  const Status written = Append(path, state.done == 0, bytes);
  if (!written) {
    // What came of the piece is not known: the file begins anew.
    state.done = 0;
    return Fail(written.error());
  }
  state.done += bytes.size();
  return state.done;
}

Result<std::string> Uploads::Close(const std::string& id) {
  PATINA_ASSIGN(const std::shared_ptr<Upload> upload, Find(id));
  const std::lock_guard lock(upload->mutex);
  if (upload->ended) return Fail(ErrorCode::kConflict, "the upload is being closed already");
  for (const auto& [name, file] : upload->files) {
    if (file.done == file.bytes) continue;
    return Fail(ErrorCode::kConflict, QuoteForMessage(name) + " has " + std::to_string(file.done) +
                                          " of its " + std::to_string(file.bytes) +
                                          " bytes; send the rest first");
  }
  std::set<std::string> folders = {upload->folder, FolderOf(id), options_.folder};
  for (const auto& [name, file] : upload->files) {
    const std::string path = upload->folder + "/" + name;
    if (const int error = options_.files->Sync(path)) return FailErrno(error, "cannot sync", path);
    for (std::string folder = ParentOf(path); folder.size() > upload->folder.size();
         folder = ParentOf(folder))
      folders.insert(folder);
  }
  for (const std::string& folder : folders) {
    if (const int error = options_.files->Sync(folder))
      return FailErrno(error, "cannot sync", folder);
  }
  upload->ended = true;
  const std::lock_guard outer(mutex_);
  open_.erase(id);
  closing_.insert(id);
  return upload->folder;
}

Status Uploads::NoteJobs(const std::string& id, const std::vector<int64_t>& jobs) {
  Status noted;
  if (jobs.empty()) {
    options_.files->RemoveTree(FolderOf(id));
  } else {
    std::string text;
    for (const int64_t job : jobs) text += std::to_string(job) + "\n";
    noted = WriteFileDurably(FolderOf(id) + "/jobs", std::string_view(text), *options_.files);
  }
  const std::lock_guard lock(mutex_);
  closing_.erase(id);
  return noted;
}

Status Uploads::Drop(const std::string& id) {
  PATINA_ASSIGN(const std::shared_ptr<Upload> upload, Find(id));
  const std::lock_guard lock(upload->mutex);
  if (upload->ended) return Fail(ErrorCode::kNotFound, "the upload is complete");
  upload->ended = true;
  options_.files->RemoveTree(FolderOf(id));
  const std::lock_guard outer(mutex_);
  open_.erase(id);
  return {};
}

void Uploads::CleanUp(const std::function<bool(int64_t job)>& is_known, Clock::time_point now) {
  std::vector<std::string> left;
  std::set<std::string> in_use;
  bool look = false;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [id, upload] : open_) {
      in_use.insert(id);
      const std::unique_lock own(upload->mutex, std::try_to_lock);
      if (own && now - upload->last > options_.idle) left.push_back(id);
    }
    in_use.insert(closing_.begin(), closing_.end());
    look = cleaned_ == Clock::time_point() || now - cleaned_ >= kCleanUpEvery;
    if (look) cleaned_ = now;
  }
  for (const std::string& id : left) {
    const Status dropped = Drop(id);
    static_cast<void>(dropped);  // completed meanwhile
  }
  std::vector<DirectoryEntry> entries;
  if (!look || options_.files->List(options_.folder, kMostKept, &entries) != 0) return;
  const int64_t wall_s = std::chrono::duration_cast<std::chrono::seconds>(
                             std::chrono::system_clock::now().time_since_epoch())
                             .count();
  for (const DirectoryEntry& entry : entries) {
    if (in_use.count(entry.name) != 0) continue;
    const std::string folder = FolderOf(entry.name);
    const auto noted = ReadTextFile(folder + "/jobs", 1 << 20);
    bool needed = false;
    if (noted) {
      const std::vector<int64_t> jobs = JobsOf(*noted);
      needed = std::any_of(jobs.begin(), jobs.end(), is_known);
    } else {
      struct stat info {};
      needed = options_.files->Stat(folder, false, &info) == 0 &&
               wall_s - info.st_mtim.tv_sec < kKeepUnnotedS;
    }
    if (!needed) options_.files->RemoveTree(folder);
  }
}

size_t Uploads::open_count() const {
  const std::lock_guard lock(mutex_);
  return open_.size();
}

}  // namespace patina::daemon
