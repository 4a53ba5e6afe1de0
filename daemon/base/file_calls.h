// The operating system's file calls as the daemon makes them, so that a test can make the N-th of
// them fail. All code of the daemon that changes files, or must survive that they cannot be read,
// takes a FileCalls&; only main() names RealFileCalls(). (SQLite has its own such layer, the VFS.)
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/file_io.h"

namespace patina::daemon {

struct DirectoryEntry {
  std::string name;  // any bytes but '/' and NUL; never "." or ".."
  // DT_REG, DT_DIR, DT_LNK ... of readdir(3); DT_UNKNOWN where the file system does not say.
  unsigned char type = 0;
};

// As FileSystem (whole files written durably, rename, symlink, mkdir, unlink), and what a daemon
// needs besides. Each member returns 0 or an errno value. Thread-safe.
class FileCalls : public FileSystem {
 public:
  // open(2) with O_CLOEXEC added. The caller closes *fd with Close.
  virtual int Open(const std::string& path, int flags, mode_t mode, int* fd) = 0;
  virtual int Close(int fd) = 0;
  // Up to bytes.size() bytes; *done says how many, 0 at the end of the file.
  virtual int Read(int fd, std::span<uint8_t> bytes, size_t* done) = 0;
  // All bytes, or an error after some of them.
  virtual int Write(int fd, std::span<const uint8_t> bytes) = 0;
  virtual int SyncFile(int fd) = 0;
  // stat(2), or lstat(2) if `follow` is false.
  virtual int Stat(const std::string& path, bool follow, struct stat* info) = 0;
  // All entries, in no order. Stops with EOVERFLOW beyond max_entries.
  virtual int List(const std::string& path, size_t max_entries,
                   std::vector<DirectoryEntry>* entries) = 0;
  // rmdir(2).
  virtual int RemoveDirectory(const std::string& path) = 0;
  // A file, a link (not what it points at), or a folder with all that is in it; nothing there is no
  // error.
  virtual int RemoveTree(const std::string& path) = 0;
};

FileCalls& RealFileCalls();

}  // namespace patina::daemon
