// A thread that watches a drop folder and sleeps while nothing happens there.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "daemon/watch/watch_types.h"
#include "formats/base/result.h"

namespace patina::daemon {

// All are called on the watcher's thread, which watches nothing meanwhile, and without a lock held.
struct WatchHandlers {
  // An asset is complete. On an error it is offered again after WatchOptions::retry_ms. Each is
  // offered once after a start, and again whenever its token has changed.
  std::function<Status(const ReadyAsset&)> on_ready;
  // What was handed over once is no longer there. May be empty.
  std::function<void(const ReadyAsset&)> on_gone;
  // The first look at everything is done. May be empty.
  std::function<void()> on_scanned;
};

class Watcher {
 public:
  // Returns before the first look at the folder. Errors: those of WatchCore::Open; kIo. A kernel
  // without inotify is none: then everything is polled, and status() says so.
  static Result<std::unique_ptr<Watcher>> Start(const WatchOptions& options,
                                                WatchHandlers handlers);
  // Waits for the handler that runs.
  virtual ~Watcher() = default;

  // These may be called from any thread. status() does not wait for a disk: when the watcher looks
  // at one that takes longer than 0.2 s, it is that of before.
  virtual WatchStatus status() const = 0;
  virtual std::vector<WatchedAsset> assets() const = 0;
  virtual void RequestRescan() = 0;
};

}  // namespace patina::daemon
