// Files that clients send because they cannot put them into a folder that the daemon reads.
//   <folder>/<id>/<name>/...   the files, in the folder that becomes the asset's
//   <folder>/<id>/jobs         numbers of the jobs that read them, one a line
// An upload is begun with the list of its files, whose pieces come in order; once all are there it
// is closed, and jobs are made of its folder. What is not finished is removed after a while; what
// is, when the queue keeps none of its jobs any more.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/base/file_calls.h"
#include "formats/base/result.h"

namespace patina::daemon {

struct UploadOptions {
  std::string folder;          // absolute; made when it is needed; empty: uploads are not taken
  FileCalls* files = nullptr;  // must outlive the uploads
  uint64_t max_bytes = uint64_t{4} << 30;  // of one upload
  size_t max_files = 500;                  // of one upload
  size_t max_open = 16;
  uint64_t keep_free_bytes = uint64_t{256} << 20;  // on the disk
  std::chrono::seconds idle{600};                  // an open one without a piece is dropped
};

struct UploadFile {
  std::string name;  // '/' between folders
  uint64_t bytes = 0;
};

// Thread-safe: two uploads do not wait for each other's writes.
class Uploads {
 public:
  using Clock = std::chrono::steady_clock;
  explicit Uploads(UploadOptions options) : options_(std::move(options)) {}

  // name: of the folder, an asset name. Returns the upload's id. Errors: kInvalidArgument (a name
  // that leads out of the folder, is hidden, or stands twice; nothing in it), kOutOfRange (too many
  // or too large files), kResourceExhausted (too many uploads, or the disk is full), kIo.
  Result<std::string> Begin(const std::string& name, const std::vector<UploadFile>& files,
                            Clock::time_point now);

  // A piece of a file, which must begin where the one before ended. Returns how many bytes of the
  // file are there. Errors: kNotFound (no such upload, or file in it), kConflict (another offset;
  // the message says which), kOutOfRange (beyond the size that was announced), kResourceExhausted,
  // kIo.
  Result<uint64_t> Write(const std::string& id, const std::string& file, uint64_t offset,
                         std::string_view bytes, Clock::time_point now);

  // Syncs an upload whose files are all there, takes no more pieces, and returns its folder.
  // Errors: kNotFound, kConflict (a file is not complete), kResourceExhausted, kIo.
  Result<std::string> Close(const std::string& id);
  // Notes which jobs read it; an upload without jobs is removed.
  Status NoteJobs(const std::string& id, const std::vector<int64_t>& jobs);

  // Removes one that is open. Errors: kNotFound.
  Status Drop(const std::string& id);

  // Removes what is no longer needed: open ones that were left, and closed ones none of whose jobs
  // is known any more. Looks at the closed ones at most once an hour.
  void CleanUp(const std::function<bool(int64_t job)>& is_known, Clock::time_point now);

  size_t open_count() const;

 private:
  struct File {
    uint64_t bytes = 0, done = 0;
  };
  struct Upload {
    std::mutex mutex;  // of all that follows
    std::string folder;
    std::map<std::string, File> files;
    Clock::time_point last;
    bool ended = false;
  };

  std::string FolderOf(const std::string& id) const { return options_.folder + "/" + id; }
  Result<std::shared_ptr<Upload>> Find(const std::string& id) const;
  Status CheckFiles(const std::vector<UploadFile>& files) const;
  Status CheckSpace(uint64_t bytes) const;
  Status Append(const std::string& path, bool first, std::string_view bytes);

  UploadOptions options_;
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Upload>> open_;
  std::set<std::string> closing_;  // ids whose jobs are being made
  Clock::time_point cleaned_{};
};

}  // namespace patina::daemon
