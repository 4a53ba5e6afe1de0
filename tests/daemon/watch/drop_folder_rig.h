// A drop folder, a WatchCore over it, and a clock that is wound by hand. The kernel queues an event
// before the call that causes it returns, so nothing here depends on timing.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/watch/watch_core.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {

// The kernel's events, which a test can take away, and whose limit it can set.
class RiggedEvents : public FolderEvents {
 public:
  RiggedEvents();
  Result<int> AddFolder(const std::string& path) override;
  void RemoveFolder(int watch) override;
  int fd() const override;
  bool Read(std::vector<FolderEvent>* events) override;

  int limit = 1000000;    // on watches
  int watches = 0;        // in use
  bool deaf = false;      // throws away what the kernel says, without a word
  bool lose_all = false;  // the same, once, and says that events were lost

 private:
  std::unique_ptr<FolderEvents> kernel_;
};

class DropFolderRig {
 public:
  static constexpr int64_t kSettleMs = 2000;

  // change: to the options, before anything is opened. kind: of the file system of a path.
  explicit DropFolderRig(const std::function<void(WatchOptions*)>& change = {},
                         WatchCore::KindAt kind = {});

  // Winds the clock forward and does all that falls due on the way; assets that become ready are
  // put into `ready`, and the queue takes them unless `refuse` is set.
  void Advance(int64_t ms);
  // Advance(0): what is due now.
  void Step() { Advance(0); }

  std::string Path(const std::string& relative) const { return root + "/" + relative; }
  void Write(const std::string& relative, const std::string& content) const;
  void MakeFolder(const std::string& relative) const;
  void Remove(const std::string& relative) const;
  void Rename(const std::string& from, const std::string& to) const;
  // Names of `ready`, in order of their coming, and empties it.
  std::vector<std::string> TakeReady();
  std::vector<std::string> TakeGone();
  WatchedAsset Asset(const std::string& name) const;

  test::TemporaryDirectory folder;
  std::string root;  // <folder>/drop
  RiggedEvents events;
  std::unique_ptr<WatchCore> core;
  int64_t now_ns = 1000000000;
  std::vector<ReadyAsset> ready, gone;
  bool refuse = false;
};

}  // namespace patina::daemon
