// Decides when an asset of a drop folder is complete. Has no thread and no clock: it is told what
// time it is, and says when it wants to be called again.
//
// Each asset goes round this loop:
//
//     settled --event, or a look that finds another state--> restless
//     restless --no event for the probe time--> quiet, with its state (names, sizes, times) noted
//     quiet --event--> restless
//     quiet --settle time since the last event--> settled, if the state is the one that was noted
//             and no program has a file open for writing; else quiet for another settle time
//
// and is offered when it settles in a state that was not handed over before. Nothing but looks
// decides what is there: events only say where to look soon, so that a lost one costs time and
// nothing else.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "daemon/watch/asset_files.h"
#include "daemon/watch/file_system_kind.h"
#include "daemon/watch/folder_events.h"
#include "daemon/watch/watch_types.h"

namespace patina::daemon {

class WatchCore {
 public:
  using KindAt = std::function<Result<FileSystemKind>(const std::string& path)>;

  // events: not owned; null if the kernel has none for us, and everything is polled. kind_at:
  // FileSystemKindAt, or what a test says.
  WatchCore(WatchOptions options, FolderEvents* events, KindAt kind_at);
  ~WatchCore();
  WatchCore(const WatchCore&) = delete;
  WatchCore& operator=(const WatchCore&) = delete;

  // Resolves the paths and begins the first look at everything. Times are in ns of any clock that
  // does not go back. Errors: kNotFound (no such folder), kInvalidArgument (not a folder; the root
  // is one of the excluded folders), kIo.
  Status Open(int64_t now_ns);

  // lost: events are missing, and everything is to be looked at.
  void OnEvents(const std::vector<FolderEvent>& events, bool lost, int64_t now_ns);

  // What became of assets.
  struct Outcome {
    std::vector<ReadyAsset> ready;  // each must be answered by HandedOver
    std::vector<ReadyAsset> gone;   // handed over once, and no longer there
  };

  // Does a bounded part of what is due.
  Outcome OnTime(int64_t now_ns);

  // What became of a ready asset: on an error it is offered again later.
  void HandedOver(const ReadyAsset& asset, const Status& status, int64_t now_ns);

  // When OnTime has something to do; in the past if there is more of it already.
  int64_t NextDeadline() const;

  // Looks at everything soon.
  void RequestRescan(int64_t now_ns);

  // Whether everything was looked at at least once.
  bool HasScanned() const { return rescans_ > 0; }

  WatchStatus status() const;
  std::vector<WatchedAsset> assets(int64_t now_ns) const;

 private:
  enum class Phase { kSettled, kRestless, kQuiet };

  // What a look at an asset found.
  struct Look {
    std::string identity;  // of everything whose change means that somebody is at work
    std::string token;     // of what is baked; empty if there is nothing
    int files = 0;
    uint64_t bytes = 0;
    std::vector<std::string> names;  // of the files that are baked
    bool is_container = false;
    bool spans_below =
        false;  // has a scene or a list of images, whose files may lie in folders below
  };

  struct Folder;

  // A file of measurements, or the images of a folder.
  struct Unit {
    Folder* folder = nullptr;
    std::string file;  // name; empty for the images of the folder
    uint64_t serial = 0;
    Phase phase = Phase::kSettled;
    int64_t last_event_ns = 0;
    std::string last_name;   // of the file that changed; empty if not known
    int64_t queued_ns = -1;  // in due_; -1 if not
    Look seen;
    bool has_asset = false;
    AssetState state = AssetState::kChanging;
    std::string reason;        // of kUnreadable, kOpen and kOffered
    std::string handed_token;  // of the state that was handed over; empty: none was
  };

  struct Folder {
    std::string relative;  // "" is the root
    int depth = 0;
    uint64_t device = 0, inode = 0;
    int watch = -1;        // -1: polled
    bool network = false;  // polled for its file system
    bool limited = false;  // polled for the limit on watches
    bool scan_queued = false;
    bool scan_deep = false;
    std::string unreadable;  // why it cannot be listed; empty if it can
    std::set<std::string> children;
    Unit images;
    std::map<std::string, Unit> files;
    std::vector<std::string> passed_over;
  };

  std::string Absolute(const std::string& relative) const;
  bool IsExcluded(const std::string& path, uint64_t device, uint64_t inode) const;
  void LookAtExcluded();
  bool LeadsOut(const std::string& path) const;

  Status OpenRoot(int64_t now_ns);
  void LoseRoot(int64_t now_ns);
  Folder* FindFolder(const std::string& relative);
  void AddFolder(Folder* parent, const Entry& entry, int64_t now_ns);
  bool BeginToWatch(Folder* folder);
  // Nothing of it is reported as gone if `silent`.
  void RemoveTree(const std::string& relative, bool silent = false);
  void ForgetFolder(Folder* folder, bool silent);
  void NoteGone(Unit* unit);

  void QueueScan(Folder* folder, bool deep);
  void BeginRescan(int64_t now_ns);
  void ScanFolder(Folder* folder, bool deep, int64_t now_ns);
  // False if it is no folder that is looked into.
  bool TakeChild(Folder* folder, const Entry& entry, bool deep, int64_t now_ns);
  void ScanChildFolders(Folder* folder, const std::vector<Entry>& entries, bool deep,
                        int64_t now_ns);
  void ScanFiles(Folder* folder, const std::vector<Entry>& entries, int64_t now_ns);

  void OnEvent(const FolderEvent& event, int64_t now_ns);
  void OnFolderEvent(Folder* folder, const FolderEvent& event, int64_t now_ns);
  void OnFileEvent(Folder* folder, const FolderEvent& event, int64_t now_ns);

  Unit* AddFile(Folder* folder, const std::string& name);
  void RemoveFile(Folder* folder, const std::string& name);
  void Touch(Unit* unit, const std::string& name, int64_t now_ns);
  // The images of a folder, and those of folders above it whose scenes may refer to them.
  void TouchImages(Folder* folder, const std::string& name, int64_t now_ns);
  void TouchAbove(const std::string& relative, const std::string& name, int64_t now_ns);
  void Schedule(Unit* unit, int64_t at_ns);
  void Unschedule(Unit* unit);
  // Any of these may remove the unit.
  void Visit(Unit* unit, int64_t now_ns);
  void VisitRestless(Unit* unit, int64_t now_ns);
  void VisitQuiet(Unit* unit, int64_t now_ns);
  void Decide(Unit* unit, int64_t now_ns);

  Look LookAtImages(const Folder& folder, const std::vector<Entry>& entries) const;
  // Adds the images of the folders below one; `path` is theirs as seen from it.
  void LookBelow(const Folder& folder, const std::string& path, std::string* everything,
                 std::string* images, Look* look) const;
  Result<Look> LookAtUnit(const Unit& unit) const;
  // The first file of the unit that somebody is writing to; empty if there is none.
  std::string OpenFileOf(const Unit& unit) const;
  std::string PathOf(const Unit& unit) const;
  std::string NameOf(const Unit& unit) const;
  std::string ReasonOf(const Unit& unit, int64_t now_ns) const;
  static bool IsListed(const Unit& unit);
  void AddAsset(const Unit& unit, int64_t now_ns, std::vector<WatchedAsset>* assets) const;
  void AddProblems(WatchStatus* status) const;
  int64_t PollInterval() const;

  WatchOptions options_;
  FolderEvents* events_;
  KindAt kind_at_;
  int64_t settle_ns_, probe_ns_;

  std::string root_name_;
  std::string root_kind_;
  bool root_lost_ = false;
  std::vector<std::string> excluded_;
  std::set<std::pair<uint64_t, uint64_t>> excluded_ids_;  // device and inode

  std::map<std::string, Folder> folders_;  // by path below the root; nodes stay where they are
  std::unordered_map<int, Folder*> by_watch_;
  std::unordered_map<uint64_t, Unit*> by_serial_;
  uint64_t next_serial_ = 0;
  std::set<std::pair<int64_t, uint64_t>> due_;  // time and serial of units
  std::deque<std::string> to_scan_;             // paths below the root
  Outcome outcome_;                             // of the next OnTime

  bool scanning_ = false;
  bool rescan_again_ = false;
  bool too_many_ = false;
  int64_t next_rescan_ns_ = 0;
  int64_t last_rescan_ns_ = 0;
  int64_t next_poll_ns_ = 0;
  int folders_polled_ = 0, folders_limited_ = 0;
  uint64_t events_seen_ = 0, overflows_ = 0, rescans_ = 0;
};

}  // namespace patina::daemon
