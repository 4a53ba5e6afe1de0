// Where the watcher hears of changes.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina::daemon {

// One change, as the kernel reports it.
struct FolderEvent {
  enum class Kind {
    kChanged,    // a file was created, written, closed after writing, or its attributes changed
    kAppeared,   // `name` was created or moved in
    kVanished,   // `name` was deleted or moved out
    kFolderLost  // the watched folder itself is gone, moved or unmounted
  };
  int watch = -1;  // as AddFolder returned
  Kind kind = Kind::kChanged;
  bool is_folder = false;  // `name` is a folder
  std::string name;        // within the watched folder; empty if kFolderLost
};

class FolderEvents {
 public:
  virtual ~FolderEvents() = default;

  // Begins to report what happens directly in a folder. The same folder gives the same number
  // again. Errors: kNotFound (not there, not a folder), kResourceExhausted (the limit on watches),
  // kIo.
  virtual Result<int> AddFolder(const std::string& path) = 0;

  // Ends it. Events that are already under way may still come.
  virtual void RemoveFolder(int watch) = 0;

  // Readable when there are events.
  virtual int fd() const = 0;

  // Appends what has happened since, without waiting, at most a few thousand events; true if some
  // events were lost.
  virtual bool Read(std::vector<FolderEvent>* events) = 0;
};

// The kernel's. Events of opening and reading are not asked for: a bake would trigger itself.
// Errors: kResourceExhausted, with the limit that was met; kIo.
Result<std::unique_ptr<FolderEvents>> OpenInotify();

}  // namespace patina::daemon
