// What WatchCore does with single assets, and what it tells about them.
#include <algorithm>
#include <utility>

#include "daemon/watch/watch_core.h"
#include "formats/base/names.h"
#include "formats/base/sha256.h"
#include "formats/layered/layered_file.h"
#include "formats/layered/varying_stack.h"
#include "pipeline/jobs/brdf_files.h"
#include "pipeline/jobs/drop_jobs.h"

namespace patina::daemon {
namespace {

constexpr int64_t kNsPerMs = 1000000;
// Of one call of OnTime: the events that come meanwhile have to fit into the kernel's queue.
constexpr int kScansPerCall = 64;
constexpr int kVisitsPerCall = 256;
constexpr size_t kMaxPassedOver = 100;
// Polling may take this much of the time: half a millisecond for each folder.
constexpr int64_t kPollPauseNsPerFolder = kNsPerMs / 2;

std::string Seconds(int64_t ns) {
  const int64_t tenths = std::max<int64_t>(0, ns) / (100 * kNsPerMs);
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " s";
}

bool IsMappedStack(const std::string& path) {
  return layered::IsLayersFileName(path) && layered::HasStackMaps(path);
}

}  // namespace

const char* AssetStateName(AssetState state) {
  switch (state) {
    case AssetState::kChanging:
      return "changing";
    case AssetState::kOpen:
      return "open";
    case AssetState::kUnreadable:
      return "unreadable";
    case AssetState::kOffered:
      return "offered";
    case AssetState::kReady:
      return "ready";
  }
  return "changing";
}

// ---- time ------------------------------------------------------------------------------------

int64_t WatchCore::PollInterval() const {
  return std::max(std::max<int64_t>(1, options_.poll_ms) * kNsPerMs,
                  folders_polled_ * kPollPauseNsPerFolder);
}

int64_t WatchCore::NextDeadline() const {
  if (!to_scan_.empty()) return 0;
  int64_t next = next_rescan_ns_;
  if (root_lost_ || folders_polled_ > 0) next = std::min(next, next_poll_ns_);
  if (!due_.empty()) next = std::min(next, due_.begin()->first);
  return next;
}

WatchCore::Outcome WatchCore::OnTime(int64_t now_ns) {
  if (root_lost_ && now_ns >= next_poll_ns_ && !OpenRoot(now_ns))
    next_poll_ns_ = now_ns + PollInterval();
  if (root_lost_) return std::exchange(outcome_, {});
  if (now_ns >= next_rescan_ns_) BeginRescan(now_ns);
  if (folders_polled_ > 0 && now_ns >= next_poll_ns_) {
    LookAtExcluded();
    for (auto& [relative, folder] : folders_) {
      if (folder.watch < 0) QueueScan(&folder, false);
    }
    next_poll_ns_ = now_ns + PollInterval();
  }
  for (int i = 0; i < kScansPerCall && !to_scan_.empty(); ++i) {
    Folder* folder = FindFolder(to_scan_.front());
    to_scan_.pop_front();
    // One that was removed and has come again stands here twice.
    if (folder == nullptr || !folder->scan_queued) continue;
    const bool deep = folder->scan_deep;
    folder->scan_queued = folder->scan_deep = false;
    ScanFolder(folder, deep, now_ns);
  }
  if (scanning_ && to_scan_.empty()) {
    scanning_ = false;
    ++rescans_;
    last_rescan_ns_ = now_ns;
    next_rescan_ns_ = now_ns + std::max<int64_t>(1, options_.rescan_s) * 1000 * kNsPerMs;
    if (rescan_again_) RequestRescan(now_ns);
  }
  for (int i = 0; i < kVisitsPerCall && !due_.empty() && due_.begin()->first <= now_ns; ++i) {
    Unit* unit = by_serial_.at(due_.begin()->second);
    Unschedule(unit);
    Visit(unit, now_ns);
  }
  return std::exchange(outcome_, {});
}

// ---- the life of an asset --------------------------------------------------------------------

void WatchCore::Schedule(Unit* unit, int64_t at_ns) {
  Unschedule(unit);
  unit->queued_ns = at_ns;
  due_.insert({at_ns, unit->serial});
}

void WatchCore::Unschedule(Unit* unit) {
  if (unit->queued_ns < 0) return;
  due_.erase({unit->queued_ns, unit->serial});
  unit->queued_ns = -1;
}

WatchCore::Unit* WatchCore::AddFile(Folder* folder, const std::string& name) {
  Unit& unit = folder->files[name];
  unit.folder = folder;
  unit.file = name;
  unit.serial = next_serial_++;
  by_serial_[unit.serial] = &unit;
  return &unit;
}

void WatchCore::RemoveFile(Folder* folder, const std::string& name) {
  const auto found = folder->files.find(name);
  if (found == folder->files.end()) return;
  NoteGone(&found->second);
  Unschedule(&found->second);
  by_serial_.erase(found->second.serial);
  folder->files.erase(found);
}

void WatchCore::Touch(Unit* unit, const std::string& name, int64_t now_ns) {
  unit->last_event_ns = now_ns;
  unit->last_name = name;
  // Where it is restless already it stands in the queue, and what is late there is put off then.
  if (unit->phase == Phase::kRestless) return;
  unit->phase = Phase::kRestless;
  unit->state = AssetState::kChanging;
  Schedule(unit, now_ns + probe_ns_);
}

void WatchCore::TouchImages(Folder* folder, const std::string& name, int64_t now_ns) {
  Touch(&folder->images, name, now_ns);
  TouchAbove(folder->relative, name, now_ns);
}

void WatchCore::TouchAbove(const std::string& relative, const std::string& name, int64_t now_ns) {
  for (std::string above = relative; !above.empty();) {
    const size_t slash = above.rfind('/');
    above.resize(slash == std::string::npos ? 0 : slash);
    Folder* folder = FindFolder(above);
    if (folder != nullptr && folder->images.seen.spans_below) Touch(&folder->images, name, now_ns);
  }
}

void WatchCore::Visit(Unit* unit, int64_t now_ns) {
  switch (unit->phase) {
    case Phase::kRestless:
      return VisitRestless(unit, now_ns);
    case Phase::kQuiet:
      return VisitQuiet(unit, now_ns);
    case Phase::kSettled:
      return Decide(unit, now_ns);
  }
}

void WatchCore::VisitRestless(Unit* unit, int64_t now_ns) {
  const int64_t due = unit->last_event_ns + probe_ns_;
  if (now_ns < due) return Schedule(unit, due);
  auto look = LookAtUnit(*unit);
  unit->seen = look ? std::move(*look) : Look();
  unit->phase = Phase::kQuiet;
  Schedule(unit, std::max(unit->last_event_ns + settle_ns_, now_ns + settle_ns_ / 2));
}

void WatchCore::VisitQuiet(Unit* unit, int64_t now_ns) {
  auto look = LookAtUnit(*unit);
  if (!look) {
    // Of a folder that is gone the folder that held it tells.
    const bool gone = look.error().code == ErrorCode::kNotFound;
    if (gone && !unit->file.empty()) return RemoveFile(unit->folder, std::string(unit->file));
    unit->state = AssetState::kUnreadable;
    unit->reason = look.error().message;
    // An event of its attributes, or the next look at everything, comes back to it.
    unit->phase = Phase::kSettled;
    unit->seen = Look();
    return;
  }
  if (look->identity != unit->seen.identity) {
    unit->seen = std::move(*look);
    unit->last_event_ns = now_ns;
    unit->last_name.clear();
    unit->state = AssetState::kChanging;
    return Schedule(unit, now_ns + settle_ns_);
  }
  unit->seen = std::move(*look);
  const std::string open = OpenFileOf(*unit);
  if (!open.empty()) {
    unit->has_asset = true;
    unit->state = AssetState::kOpen;
    unit->reason = QuoteForMessage(open) + " is still open for writing in some program";
    return Schedule(unit, now_ns + settle_ns_);
  }
  unit->phase = Phase::kSettled;
  Decide(unit, now_ns);
}

void WatchCore::Decide(Unit* unit, int64_t now_ns) {
  const std::string path = PathOf(*unit);
  unit->has_asset = !unit->seen.token.empty() && (unit->file.empty() || LooksLikeBrdfFile(path));
  if (unit->has_asset && !unit->file.empty() && IsMappedStack(path)) {
    // Layers with maps are one asset with these, that of their folder, which no event told of it.
    unit->has_asset = false;
    Touch(&unit->folder->images, unit->file, now_ns);
  }
  if (!unit->has_asset) return NoteGone(unit);
  if (unit->seen.token == unit->handed_token) {
    unit->state = AssetState::kReady;
    return;
  }
  unit->state = AssetState::kOffered;
  unit->reason = "it is being handed to the queue";
  // Whoever was offered the state before has not answered yet, or never will.
  Schedule(unit, now_ns + std::max<int64_t>(1, options_.retry_ms) * kNsPerMs);
  ReadyAsset asset;
  asset.path = PathOf(*unit);
  asset.name = NameOf(*unit);
  asset.is_file = !unit->file.empty();
  asset.token = unit->seen.token;
  asset.files = unit->seen.files;
  asset.bytes = unit->seen.bytes;
  outcome_.ready.push_back(std::move(asset));
}

void WatchCore::HandedOver(const ReadyAsset& asset, const Status& status, int64_t now_ns) {
  const std::string root = Absolute("");
  if (asset.path.compare(0, root.size(), root) != 0) return;
  std::string relative = asset.path.substr(std::min(asset.path.size(), root.size()));
  if (!relative.empty() && relative[0] == '/') relative.erase(0, 1);
  std::string file;
  if (asset.is_file) {
    const size_t slash = relative.rfind('/');
    file = relative.substr(slash == std::string::npos ? 0 : slash + 1);
    relative.resize(slash == std::string::npos ? 0 : slash);
  }
  Folder* folder = FindFolder(relative);
  if (folder == nullptr) return;  // removed meanwhile
  Unit* unit = &folder->images;
  if (asset.is_file) {
    const auto found = folder->files.find(file);
    if (found == folder->files.end()) return;
    unit = &found->second;
  }
  if (status) unit->handed_token = asset.token;
  if (unit->phase != Phase::kSettled || unit->seen.token != asset.token) return;
  if (status) {
    unit->state = AssetState::kReady;
    unit->reason.clear();
    Unschedule(unit);
    return;
  }
  unit->reason = "it could not be handed to the queue: " + status.error().message;
  Schedule(unit, now_ns + std::max<int64_t>(1, options_.retry_ms) * kNsPerMs);
}

// ---- looks -----------------------------------------------------------------------------------

WatchCore::Look WatchCore::LookAtImages(const Folder& folder,
                                        const std::vector<Entry>& entries) const {
  Look look;
  std::string everything, images;
  bool manifest = false, weights = false;
  for (const Entry& entry : entries) {
    manifest = manifest || entry.name == "manifest.json";
    weights = weights || entry.name == "decoder.weights";
    if (entry.kind != Entry::Kind::kFile) continue;
    FileRole role = RoleOfFile(entry.name);
    if (role == FileRole::kBrdf && IsMappedStack(Absolute(folder.relative) + "/" + entry.name))
      role = FileRole::kImage;
    if (role != FileRole::kImage && role != FileRole::kOther) continue;
    if (entry.is_link &&
        (role == FileRole::kOther || LeadsOut(Absolute(folder.relative) + "/" + entry.name)))
      continue;
    AppendIdentity(entry, &everything);
    if (role != FileRole::kImage) continue;
    AppendIdentity(entry, &images);
    ++look.files;
    look.bytes += entry.size;
    look.names.push_back(entry.name);
    look.spans_below = look.spans_below || NamesFilesBelow(entry.name);
  }
  look.is_container = manifest && weights;
  if (look.spans_below && !look.is_container) LookBelow(folder, "", &everything, &images, &look);
  look.identity = look.is_container    ? "container"
                  : everything.empty() ? ""
                                       : Sha256Hex(std::string_view(everything));
  if (!images.empty() && !look.is_container) look.token = Sha256Hex(std::string_view(images));
  return look;
}

void WatchCore::LookBelow(const Folder& folder, const std::string& path, std::string* everything,
                          std::string* images, Look* look) const {
  for (const std::string& child_name : folder.children) {
    const auto child =
        folders_.find((folder.relative.empty() ? "" : folder.relative + "/") + child_name);
    if (child == folders_.end() || child->second.images.seen.is_container) continue;
    const auto entries = ListEntries(Absolute(child->first));
    if (!entries) continue;  // its own unit says so
    const std::string inner = path + child_name + "/";
    for (Entry entry : *entries) {
      if (entry.kind != Entry::Kind::kFile || entry.is_link ||
          RoleOfFile(entry.name) != FileRole::kImage)
        continue;
      entry.name = inner + entry.name;
      AppendIdentity(entry, everything);
      AppendIdentity(entry, images);
      ++look->files;
      look->bytes += entry.size;
      look->names.push_back(entry.name);
    }
    LookBelow(child->second, inner, everything, images, look);
  }
}

Result<WatchCore::Look> WatchCore::LookAtUnit(const Unit& unit) const {
  const std::string folder = Absolute(unit.folder->relative);
  if (unit.file.empty()) {
    PATINA_ASSIGN(const std::vector<Entry> entries, ListEntries(folder));
    return LookAtImages(*unit.folder, entries);
  }
  PATINA_ASSIGN(const Entry entry, LookAt(folder, unit.file));
  Look look;
  if (entry.kind != Entry::Kind::kFile || (entry.is_link && LeadsOut(folder + "/" + unit.file)))
    return look;
  AppendIdentity(entry, &look.identity);
  look.token = Sha256Hex(std::string_view(look.identity));
  look.files = 1;
  look.bytes = entry.size;
  look.names.push_back(unit.file);
  return look;
}

std::string WatchCore::OpenFileOf(const Unit& unit) const {
  if (unit.folder->network) return "";  // whose kernel would know is another one
  for (const std::string& name : unit.seen.names) {
    if (WriterOf(Absolute(unit.folder->relative) + "/" + name) == WriterState::kOpen) return name;
  }
  return "";
}

std::string WatchCore::PathOf(const Unit& unit) const {
  const std::string folder = Absolute(unit.folder->relative);
  return unit.file.empty() ? folder : (folder == "/" ? "" : folder) + "/" + unit.file;
}

std::string WatchCore::NameOf(const Unit& unit) const {
  std::string relative = unit.folder->relative;
  if (!unit.file.empty()) relative += (relative.empty() ? "" : "/") + unit.file;
  return AssetNameBelow(root_name_, relative, !unit.file.empty());
}

// ---- status ----------------------------------------------------------------------------------

std::string WatchCore::ReasonOf(const Unit& unit, int64_t now_ns) const {
  if (unit.state == AssetState::kReady) return "";
  if (unit.state != AssetState::kChanging) return unit.reason;
  const std::string what = unit.last_name.empty() ? "a file" : QuoteForMessage(unit.last_name);
  return what + " changed " + Seconds(now_ns - unit.last_event_ns) +
         " ago; it is taken up when nothing has changed for " + Seconds(settle_ns_);
}

bool WatchCore::IsListed(const Unit& unit) {
  // What is not known to be an asset is listed while it may be one: when there is a file to bake.
  if (unit.has_asset || unit.state == AssetState::kUnreadable) return true;
  return unit.phase != Phase::kSettled && !unit.seen.token.empty();
}

void WatchCore::AddAsset(const Unit& unit, int64_t now_ns,
                         std::vector<WatchedAsset>* assets) const {
  if (!IsListed(unit)) return;
  WatchedAsset asset;
  asset.path = PathOf(unit);
  asset.name = NameOf(unit);
  asset.is_file = !unit.file.empty();
  asset.state = unit.state;
  asset.reason = ReasonOf(unit, now_ns);
  asset.token = unit.handed_token;
  asset.files = unit.seen.files;
  asset.bytes = unit.seen.bytes;
  assets->push_back(std::move(asset));
}

std::vector<WatchedAsset> WatchCore::assets(int64_t now_ns) const {
  std::vector<WatchedAsset> assets;
  for (const auto& [relative, folder] : folders_) {
    AddAsset(folder.images, now_ns, &assets);
    for (const auto& [name, unit] : folder.files) AddAsset(unit, now_ns, &assets);
  }
  return assets;
}

void WatchCore::AddProblems(WatchStatus* status) const {
  if (root_lost_) {
    status->problems.push_back(
        {"root_missing", "the watched folder " + QuoteForMessage(options_.root) + " is not there",
         "make it or mount it again; it is looked for every few seconds"});
  }
  if (events_ == nullptr && options_.mode != WatchMode::kPolling) {
    status->problems.push_back(
        {"no_inotify", "the kernel gives no inotify instance, so that everything is polled",
         "raise fs.inotify.max_user_instances with sysctl and start again"});
  }
  if (folders_limited_ > 0) {
    status->problems.push_back(
        {"watch_limit",
         "the kernel's limit on watched folders is reached: " + std::to_string(folders_limited_) +
             " folders are polled",
         "sysctl fs.inotify.max_user_watches=" + std::to_string(2 * folders_.size() + 65536)});
  }
  if (too_many_) {
    status->problems.push_back({"too_many_folders",
                                "there are more than " + std::to_string(options_.max_folders) +
                                    " folders; the others are not watched",
                                "move what is not to be baked out of the watched folder"});
  }
  int unreadable = 0;
  std::string first;
  for (const auto& [relative, folder] : folders_) {
    if (folder.unreadable.empty()) continue;
    if (unreadable++ == 0) first = folder.unreadable;
  }
  if (unreadable > 0) {
    status->problems.push_back(
        {"unreadable", std::to_string(unreadable) + " folders cannot be read; the first: " + first,
         "let the user of the service read and enter them"});
  }
}

WatchStatus WatchCore::status() const {
  WatchStatus status;
  status.root = options_.root;
  const int folders = static_cast<int>(folders_.size());
  const bool all_polled = folders_polled_ == folders && (folders > 0 || events_ == nullptr);
  status.mode = all_polled ? "polling" : folders_polled_ == 0 ? "inotify" : "mixed";
  if (options_.mode != WatchMode::kAuto) {
    status.mode_reason = "the configuration says so; the folder is on " + root_kind_;
  } else {
    status.mode_reason = "the folder is on " + root_kind_;
  }
  AddProblems(&status);
  status.scanning = scanning_;
  status.folders = folders;
  status.folders_polled = folders_polled_;
  const auto count = [&status](const Unit& unit) {
    if (!IsListed(unit)) return;
    ++status.assets;
    if (unit.state != AssetState::kReady) ++status.assets_waiting;
  };
  for (const auto& [relative, folder] : folders_) {
    count(folder.images);
    for (const auto& [name, unit] : folder.files) count(unit);
  }
  status.events = events_seen_;
  status.overflows = overflows_;
  status.rescans = rescans_;
  for (const auto& [relative, folder] : folders_) {
    for (const std::string& line : folder.passed_over) {
      if (status.passed_over.size() < kMaxPassedOver) status.passed_over.push_back(line);
    }
  }
  return status;
}

}  // namespace patina::daemon
