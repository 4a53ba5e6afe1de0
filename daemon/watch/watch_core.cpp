#include "daemon/watch/watch_core.h"

#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <memory>

#include "formats/base/names.h"

namespace patina::daemon {
namespace {

constexpr int64_t kNsPerMs = 1000000;
constexpr int64_t kNever = std::numeric_limits<int64_t>::max();
// Between the end of one look at everything and the next, when events keep getting lost.
constexpr int64_t kRescanPauseNs = 200 * kNsPerMs;

std::string Join(const std::string& folder, const std::string& name) {
  return folder.empty() ? name : folder + "/" + name;
}

std::string RealPath(const std::string& path) {
  const std::unique_ptr<char, decltype(&std::free)> real(realpath(path.c_str(), nullptr),
                                                         &std::free);
  return real ? std::string(real.get()) : std::string();
}

// As RealPath, for a path whose last parts may not be there yet.
std::string Resolved(const std::string& path) {
  std::string head = path, tail;
  for (;;) {
    const std::string real = RealPath(head.empty() ? "/" : head);
    if (!real.empty()) return (real == "/" ? "" : real) + tail;
    const size_t slash = head.rfind('/');
    if (slash == std::string::npos) return RealPath(".") + "/" + head + tail;
    tail = head.substr(slash) + tail;
    head.resize(slash);
  }
}

bool IsWithin(const std::string& path, const std::string& folder) {
  return path.size() > folder.size() && path.compare(0, folder.size(), folder) == 0 &&
         (folder == "/" || path[folder.size()] == '/');
}

}  // namespace

WatchCore::WatchCore(WatchOptions options, FolderEvents* events, KindAt kind_at)
    : options_(std::move(options)),
      events_(options_.mode == WatchMode::kPolling ? nullptr : events),
      kind_at_(std::move(kind_at)),
      settle_ns_(std::max<int64_t>(1, options_.settle_ms) * kNsPerMs),
      probe_ns_(std::min<int64_t>(settle_ns_ / 4, 50 * kNsPerMs)) {}

WatchCore::~WatchCore() = default;

std::string WatchCore::Absolute(const std::string& relative) const {
  if (relative.empty()) return options_.root;
  return (options_.root == "/" ? "" : options_.root) + "/" + relative;
}

// ---- the root, and what is left out ---------------------------------------------------------

Status WatchCore::Open(int64_t now_ns) {
  const std::string real = RealPath(options_.root);
  if (real.empty()) {
    return Fail(ErrorCode::kNotFound, "there is no folder " + QuoteForMessage(options_.root) +
                                          " to watch; make it, or name another");
  }
  options_.root = real;
  root_name_ = real.substr(real.rfind('/') + 1);
  for (const std::string& path : options_.exclude) {
    if (!path.empty()) excluded_.push_back(Resolved(path));
  }
  if (std::find(excluded_.begin(), excluded_.end(), real) != excluded_.end()) {
    return Fail(ErrorCode::kInvalidArgument,
                "the folder " + QuoteForMessage(real) +
                    " is both watched and written to, so that every result would be taken for "
                    "input; give the results a folder of their own");
  }
  return OpenRoot(now_ns);
}

Status WatchCore::OpenRoot(int64_t now_ns) {
  struct stat info {};
  if (stat(options_.root.c_str(), &info) != 0)
    return Fail(ErrorCode::kNotFound, "there is no folder " + QuoteForMessage(options_.root));
  if (!S_ISDIR(info.st_mode)) {
    return Fail(ErrorCode::kInvalidArgument,
                QuoteForMessage(options_.root) + " is not a folder; a folder is watched");
  }
  Entry entry;
  entry.kind = Entry::Kind::kFolder;
  entry.device = info.st_dev;
  entry.inode = info.st_ino;
  AddFolder(nullptr, entry, now_ns);
  if (folders_.empty()) {
    return Fail(ErrorCode::kIo, "the folder " + QuoteForMessage(options_.root) +
                                    " cannot be watched; it was there a moment ago");
  }
  root_lost_ = false;
  BeginRescan(now_ns);
  return {};
}

void WatchCore::LoseRoot(int64_t now_ns) {
  // A disk that is unmounted has not lost its assets.
  RemoveTree("", true);
  to_scan_.clear();
  next_rescan_ns_ = kNever;
  root_lost_ = true;
  scanning_ = rescan_again_ = false;
  next_poll_ns_ = now_ns + PollInterval();
}

void WatchCore::LookAtExcluded() {
  excluded_ids_.clear();
  for (const std::string& path : excluded_) {
    struct stat info {};
    if (stat(path.c_str(), &info) == 0) excluded_ids_.insert({info.st_dev, info.st_ino});
  }
}

bool WatchCore::IsExcluded(const std::string& path, uint64_t device, uint64_t inode) const {
  return excluded_ids_.count({device, inode}) != 0 ||
         std::find(excluded_.begin(), excluded_.end(), path) != excluded_.end();
}

bool WatchCore::LeadsOut(const std::string& path) const {
  const std::string real = RealPath(path);
  return real.empty() || !IsWithin(real, options_.root);
}

// ---- folders ---------------------------------------------------------------------------------

WatchCore::Folder* WatchCore::FindFolder(const std::string& relative) {
  const auto found = folders_.find(relative);
  return found == folders_.end() ? nullptr : &found->second;
}

void WatchCore::AddFolder(Folder* parent, const Entry& entry, int64_t now_ns) {
  const std::string relative = parent == nullptr ? "" : Join(parent->relative, entry.name);
  if (static_cast<int>(folders_.size()) >= options_.max_folders) {
    too_many_ = true;
    return;
  }
  Folder& folder = folders_[relative];
  folder.relative = relative;
  folder.depth = parent == nullptr ? 0 : parent->depth + 1;
  folder.device = entry.device;
  folder.inode = entry.inode;
  folder.images.folder = &folder;
  folder.images.serial = next_serial_++;
  folder.images.last_event_ns = now_ns;
  by_serial_[folder.images.serial] = &folder.images;
  folder.network = parent != nullptr && parent->network;
  if (parent == nullptr || parent->device != folder.device) {
    const auto kind = kind_at_(Absolute(relative));
    folder.network = kind && kind->network;
    if (parent == nullptr) root_kind_ = kind ? kind->name : "an unknown file system";
  }
  ++folders_polled_;
  if (!BeginToWatch(&folder)) {
    ForgetFolder(&folder, true);
    folders_.erase(relative);
    return;
  }
  if (parent != nullptr) parent->children.insert(entry.name);
  QueueScan(&folder, true);
}

// False if the folder is gone.
bool WatchCore::BeginToWatch(Folder* folder) {
  const bool polled =
      events_ == nullptr || (folder->network && options_.mode != WatchMode::kInotify);
  if (polled || folder->watch >= 0) return true;
  const auto watch = events_->AddFolder(Absolute(folder->relative));
  const bool limited = !watch && watch.error().code == ErrorCode::kResourceExhausted;
  folders_limited_ += limited - folder->limited;
  folder->limited = limited;
  if (!watch) return watch.error().code != ErrorCode::kNotFound;
  --folders_polled_;
  folder->watch = *watch;
  // A folder that was moved without our hearing of it still has its number.
  by_watch_[*watch] = folder;
  return true;
}

void WatchCore::NoteGone(Unit* unit) {
  if (unit->handed_token.empty()) return;
  ReadyAsset asset;
  asset.path = PathOf(*unit);
  asset.name = NameOf(*unit);
  asset.is_file = !unit->file.empty();
  outcome_.gone.push_back(std::move(asset));
  unit->handed_token.clear();
}

void WatchCore::ForgetFolder(Folder* folder, bool silent) {
  if (!silent) NoteGone(&folder->images);
  for (auto& [name, unit] : folder->files) {
    if (!silent) NoteGone(&unit);
    Unschedule(&unit);
    by_serial_.erase(unit.serial);
  }
  Unschedule(&folder->images);
  by_serial_.erase(folder->images.serial);
  folders_limited_ -= folder->limited;
  if (folder->watch < 0) {
    --folders_polled_;
    return;
  }
  const auto watched = by_watch_.find(folder->watch);
  if (watched == by_watch_.end() || watched->second != folder) return;
  by_watch_.erase(watched);
  events_->RemoveFolder(folder->watch);
}

void WatchCore::RemoveTree(const std::string& relative, bool silent) {
  const auto top = folders_.find(relative);
  if (top == folders_.end()) return;
  if (!relative.empty()) {
    const size_t slash = relative.rfind('/');
    Folder* parent = FindFolder(slash == std::string::npos ? "" : relative.substr(0, slash));
    if (parent != nullptr)
      parent->children.erase(relative.substr(slash == std::string::npos ? 0 : slash + 1));
  }
  ForgetFolder(&top->second, silent);
  folders_.erase(top);
  const std::string prefix = relative.empty() ? "" : relative + "/";
  for (auto it = folders_.lower_bound(prefix);
       it != folders_.end() && it->first.compare(0, prefix.size(), prefix) == 0;) {
    ForgetFolder(&it->second, silent);
    it = folders_.erase(it);
  }
}

// ---- looking at everything -------------------------------------------------------------------

void WatchCore::QueueScan(Folder* folder, bool deep) {
  folder->scan_deep = folder->scan_deep || deep;
  if (folder->scan_queued) return;
  folder->scan_queued = true;
  to_scan_.push_back(folder->relative);
}

void WatchCore::RequestRescan(int64_t now_ns) {
  if (scanning_) {
    rescan_again_ = true;
    return;
  }
  next_rescan_ns_ = std::min(next_rescan_ns_, std::max(now_ns, last_rescan_ns_ + kRescanPauseNs));
}

void WatchCore::BeginRescan(int64_t now_ns) {
  LookAtExcluded();
  scanning_ = true;
  rescan_again_ = too_many_ = false;
  next_rescan_ns_ = kNever;
  if (Folder* root = FindFolder("")) QueueScan(root, true);
  next_poll_ns_ = now_ns + PollInterval();
}

void WatchCore::ScanFolder(Folder* folder, bool deep, int64_t now_ns) {
  if (!BeginToWatch(folder)) {
    folder->relative.empty() ? LoseRoot(now_ns) : RemoveTree(std::string(folder->relative));
    return;
  }
  const auto entries = ListEntries(Absolute(folder->relative));
  if (!entries) {
    if (entries.error().code != ErrorCode::kNotFound) {
      folder->unreadable = entries.error().message;
      return;
    }
    folder->relative.empty() ? LoseRoot(now_ns) : RemoveTree(std::string(folder->relative));
    return;
  }
  folder->unreadable.clear();
  folder->passed_over.clear();
  const Look images = LookAtImages(*folder, *entries);
  if (images.is_container) {
    folder->passed_over.push_back(QuoteForMessage(Absolute(folder->relative)) +
                                  ": a container of Patina's own");
    while (!folder->children.empty()) RemoveTree(Join(folder->relative, *folder->children.begin()));
    while (!folder->files.empty()) RemoveFile(folder, std::string(folder->files.begin()->first));
    Unit& unit = folder->images;
    Unschedule(&unit);
    NoteGone(&unit);
    unit.phase = Phase::kSettled;
    unit.has_asset = false;
    unit.seen = images;
    return;
  }
  if (folder->images.phase == Phase::kSettled && images.identity != folder->images.seen.identity)
    TouchImages(folder, "", now_ns);
  ScanFiles(folder, *entries, now_ns);
  ScanChildFolders(folder, *entries, deep, now_ns);
}

bool WatchCore::TakeChild(Folder* folder, const Entry& entry, bool deep, int64_t now_ns) {
  if (entry.kind != Entry::Kind::kFolder || IsHiddenName(entry.name)) return false;
  const std::string relative = Join(folder->relative, entry.name);
  const std::string path = Absolute(relative);
  const auto pass_over = [&](const char* why) {
    folder->passed_over.push_back(QuoteForMessage(path) + ": " + why);
    return false;
  };
  if (entry.is_link) return pass_over("a link to a folder; links are not followed");
  if (IsExcluded(path, entry.device, entry.inode)) return pass_over("the service writes there");
  if (folder->depth >= options_.max_depth) return pass_over("nested too deeply");
  Folder* child = FindFolder(relative);
  if (child != nullptr && (child->device != entry.device || child->inode != entry.inode)) {
    RemoveTree(relative);
    child = nullptr;
  }
  if (child == nullptr) {
    AddFolder(folder, entry, now_ns);
  } else if (deep) {
    QueueScan(child, true);
  }
  return true;
}

void WatchCore::ScanChildFolders(Folder* folder, const std::vector<Entry>& entries, bool deep,
                                 int64_t now_ns) {
  std::set<std::string> gone = folder->children;
  for (const Entry& entry : entries) {
    if (TakeChild(folder, entry, deep, now_ns)) gone.erase(entry.name);
  }
  for (const std::string& name : gone) RemoveTree(Join(folder->relative, name));
}

void WatchCore::ScanFiles(Folder* folder, const std::vector<Entry>& entries, int64_t now_ns) {
  std::set<std::string> gone;
  for (const auto& [name, unit] : folder->files) gone.insert(name);
  for (const Entry& entry : entries) {
    if (entry.kind != Entry::Kind::kFile) continue;
    const FileRole role = RoleOfFile(entry.name);
    if (entry.is_link && role != FileRole::kOther && role != FileRole::kNone) {
      const std::string path = Absolute(Join(folder->relative, entry.name));
      if (LeadsOut(path)) {
        folder->passed_over.push_back(QuoteForMessage(path) +
                                      ": a link that leads out of the watched folder");
        continue;
      }
    }
    if (role != FileRole::kBrdf) continue;
    gone.erase(entry.name);
    const auto known = folder->files.find(entry.name);
    Unit* unit = known == folder->files.end() ? AddFile(folder, entry.name) : &known->second;
    std::string identity;
    AppendIdentity(entry, &identity);
    if (unit->phase == Phase::kSettled && unit->seen.identity != identity) Touch(unit, "", now_ns);
  }
  // They may come again at once, as files do that are replaced.
  for (const std::string& name : gone) {
    Unit& unit = folder->files.at(name);
    if (unit.phase == Phase::kSettled) Touch(&unit, "", now_ns);
  }
}

// ---- events ----------------------------------------------------------------------------------

void WatchCore::OnEvents(const std::vector<FolderEvent>& events, bool lost, int64_t now_ns) {
  events_seen_ += events.size();
  for (const FolderEvent& event : events) OnEvent(event, now_ns);
  if (!lost) return;
  ++overflows_;
  RequestRescan(now_ns);
}

void WatchCore::OnEvent(const FolderEvent& event, int64_t now_ns) {
  const auto found = by_watch_.find(event.watch);
  if (found == by_watch_.end()) return;
  Folder* folder = found->second;
  if (event.kind == FolderEvent::Kind::kFolderLost) {
    folder->relative.empty() ? LoseRoot(now_ns) : RemoveTree(std::string(folder->relative));
  } else if (event.is_folder) {
    OnFolderEvent(folder, event, now_ns);
  } else {
    OnFileEvent(folder, event, now_ns);
  }
}

void WatchCore::OnFolderEvent(Folder* folder, const FolderEvent& event, int64_t now_ns) {
  if (event.name.empty()) return QueueScan(folder, false);
  const std::string relative = Join(folder->relative, event.name);
  if (event.kind == FolderEvent::Kind::kChanged) {
    if (Folder* child = FindFolder(relative)) QueueScan(child, false);
    return;
  }
  RemoveTree(relative);
  TouchAbove(relative, event.name, now_ns);
  if (event.kind == FolderEvent::Kind::kVanished) return;
  const auto entry = LookAt(Absolute(folder->relative), event.name);
  if (!entry) return;  // gone again
  LookAtExcluded();
  TakeChild(folder, *entry, true, now_ns);
}

void WatchCore::OnFileEvent(Folder* folder, const FolderEvent& event, int64_t now_ns) {
  const FileRole role = RoleOfFile(event.name);
  if (role == FileRole::kNone || folder->images.seen.is_container) return;
  if (role != FileRole::kBrdf) return TouchImages(folder, event.name, now_ns);
  const auto known = folder->files.find(event.name);
  if (known != folder->files.end()) return Touch(&known->second, event.name, now_ns);
  if (event.kind != FolderEvent::Kind::kVanished)
    Touch(AddFile(folder, event.name), event.name, now_ns);
}

}  // namespace patina::daemon
