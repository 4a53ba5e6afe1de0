// Whole files in and out: bounded reads, durable writes, and the file calls that a test can make
// fail.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace patina {

// The operating system's file calls that publishing needs. Each member returns 0 or an errno value.
// Tests replace single calls to force errors; all other code uses RealFileSystem().
class FileSystem {
 public:
  virtual ~FileSystem() = default;
  // Creates (or truncates) a file, writes all bytes, fsyncs and closes it.
  virtual int WriteSynced(const std::string& path, std::span<const uint8_t> bytes) = 0;
  // fsync of an existing file or directory.
  virtual int Sync(const std::string& path) = 0;
  virtual int MakeDirectory(
      const std::string& path) = 0;  // EEXIST if it is there; the parent must exist
  virtual int Rename(const std::string& from, const std::string& to) = 0;
  // As Rename, but EEXIST if `to` is there.
  virtual int RenameNew(const std::string& from, const std::string& to) = 0;
  virtual int MakeSymlink(const std::string& target, const std::string& path) = 0;
  virtual int RemoveFile(const std::string& path) = 0;  // a file or symbolic link
};

FileSystem& RealFileSystem();

// An errno value as an Error: "<what> <path>: <reason>", with a remedy where there is one. ENOENT
// gives kNotFound, EEXIST kConflict, ENOSPC, EDQUOT, EMFILE, ENFILE and ENOMEM kResourceExhausted,
// everything else kIo.
tl::unexpected<Error> FailErrno(int error_number, const std::string& what, const std::string& path);

// The bytes of a regular file.
// Errors: kNotFound, kIo, kInvalidArgument (a directory or device), kOutOfRange (larger than
// max_bytes).
Result<std::vector<uint8_t>> ReadFile(const std::string& path, uint64_t max_bytes);
Result<std::string> ReadTextFile(const std::string& path, uint64_t max_bytes);

// Replaces a file so that after a crash either the old or the new content is there: temporary file
// beside it, fsync, rename, fsync of the directory. Nothing is left behind on an error.
Status WriteFileDurably(const std::string& path, std::span<const uint8_t> bytes,
                        FileSystem& files = RealFileSystem());
Status WriteFileDurably(const std::string& path, std::string_view text,
                        FileSystem& files = RealFileSystem());

// Creates a directory and its missing parents. An existing directory is no error.
Status MakeDirectories(const std::string& path, FileSystem& files = RealFileSystem());

inline std::span<const uint8_t> AsBytes(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

}  // namespace patina
