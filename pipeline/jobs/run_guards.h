// What whoever starts runs, and may start them again, asks of a run besides the job itself: not to
// bake what is there already, and not to publish once another attempt has taken its place.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "formats/base/file_io.h"
#include "formats/base/result.h"
#include "pipeline/image/shared_images.h"

namespace patina {

struct RunGuards {
  // Be done, without baking, if `current` of the asset is whole and has the fingerprint that the
  // job would give. The result is then that container, with stopped_by "unchanged".
  bool skip_unchanged = false;
  // Not if `current` is this revision: a forced job that is tried again finds what it published
  // itself, and not what was there before. Empty: any revision will do.
  std::string not_revision;
  // The fence of the job and the attempt that this run is. Empty: none.
  std::string fence_file;
  int64_t attempt = 0;
  // Of several runs in one process that may read the same files; not owned. Null: none.
  SharedImages* images = nullptr;
};

// A fence is a file that holds the number of a job's current attempt. Who publishes holds a shared
// lock on it meanwhile, who starts the next attempt an exclusive one: once MoveFence has returned,
// no earlier attempt publishes any more.
class FenceHold {
 public:
  // Errors: kConflict (another attempt is current, or the file does not hold a number), kNotFound,
  // kIo.
  static Result<FenceHold> Acquire(const std::string& fence_file, int64_t attempt);
  FenceHold(FenceHold&& other) noexcept;
  FenceHold& operator=(FenceHold&&) = delete;
  ~FenceHold();

 private:
  friend Status MoveFence(const std::string& fence_file, int64_t attempt);
  explicit FenceHold(int fd) : fd_(fd) {}
  int fd_;
};

// Makes `attempt` the current one; creates the file if need be. Waits for one that is publishing.
// Errors: kConflict (a later attempt is current already), those of FailErrno.
Status MoveFence(const std::string& fence_file, int64_t attempt);

}  // namespace patina
