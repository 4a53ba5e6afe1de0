// What is watched, what becomes of it, and what is told about it.
//
// Paths are bytes as the operating system has them; they need not be UTF-8.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/config/config.h"

namespace patina::daemon {

struct WatchOptions {
  std::string root;  // the drop folder
  // Folders that are passed over with all they hold, such as the output folder; they need not be
  // there yet.
  std::vector<std::string> exclude;
  // kAuto polls network file systems, which report nothing of what other machines write, and has
  // the kernel report the changes of all others.
  WatchMode mode = WatchMode::kAuto;
  int64_t settle_ms = 2000;  // an asset is ready when nothing happened to it for so long
  int64_t poll_ms = 2000;    // between two looks at what is polled
  int64_t rescan_s = 600;    // between two looks at everything, however it is watched
  int64_t retry_ms = 10000;  // until an asset that could not be handed over is offered again
  int max_depth = 32;        // folders deeper than this below the root are not looked into
  int max_folders = 100000;  // more are not watched
};

// An asset that is complete: a folder with images, or a file of measurements.
struct ReadyAsset {
  std::string path;   // absolute
  std::string name;   // a legal asset name, from the path below the root (AssetNameBelow)
  bool is_file;       // a BRDF; else a folder of maps
  std::string token;  // changes whenever a name, size or time of its files does
  int files = 0;
  uint64_t bytes = 0;
};

enum class AssetState {
  kChanging,    // something happened to it within the settle time
  kOpen,        // a program still has a file of it open for writing
  kUnreadable,  // it cannot be read
  kOffered,     // ready, but not handed over yet
  kReady        // handed over as it is now
};
const char* AssetStateName(
    AssetState state);  // "changing", "open", "unreadable", "offered", "ready"

struct WatchedAsset {
  std::string path;  // absolute
  std::string name;
  bool is_file = false;
  AssetState state = AssetState::kChanging;
  std::string reason;  // a sentence for a person: why it is not baked yet; empty if kReady
  std::string token;   // as handed over last; empty if it never was
  int files = 0;
  uint64_t bytes = 0;
};

// Something that keeps the watcher from vouching for what it says.
struct WatchProblem {
  std::string code;    // "watch_limit", "root_missing", ...; stable
  std::string reason;  // a sentence
  std::string cure;    // what to do about it
};

struct WatchStatus {
  std::string root;
  std::string mode;                    // "inotify", "polling", or "mixed"
  std::string mode_reason;             // why, e.g. "the folder is on nfs"
  std::vector<WatchProblem> problems;  // empty: what is said here is so
  bool scanning = false;               // a look at everything is under way
  int folders = 0;
  int folders_polled = 0;
  int assets = 0;
  int assets_waiting = 0;  // not kReady
  uint64_t events = 0;     // reported by the kernel
  uint64_t overflows = 0;  // of the kernel's queue of events
  uint64_t rescans = 0;
  std::vector<std::string> passed_over;  // at most 100: what is not looked into, and why
};

}  // namespace patina::daemon
