// Archives (.patina): the files of a container in one file, each as a zstd frame, with an index at
// the end. Byte table: FORMATS.md. Written and read front to back, or member by member by the
// index.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/zstd_stream.h"

namespace patina {

inline constexpr uint32_t kArchiveVersion = 1;
inline constexpr uint32_t kMaxArchiveMembers = 1024;
inline constexpr uint64_t kMaxArchiveMemberBytes = uint64_t{8} << 30;
inline constexpr int kDefaultArchiveLevel = 9;

struct ArchiveMember {
  std::string name;            // a plain file name, unique in the archive
  uint64_t content_bytes = 0;  // at most kMaxArchiveMemberBytes
  std::string sha256;          // of the content
  uint64_t offset = 0;         // of the member's header in the archive
  uint64_t frame_bytes = 0;    // of the zstd frame behind that header
};

// Writes an archive front to back.
class ArchiveWriter {
 public:
  // `count` members follow.
  static Result<ArchiveWriter> Begin(uint32_t count, int level, WriteBytes write);
  // Adds a file; offset and frame_bytes of the member are set here. Errors: kInvalidArgument (name,
  // size), kConflict (the content is not of the stated size or SHA-256), those of read and of
  // CompressFrame.
  Status Add(ArchiveMember member, const ReadBytes& read);
  // Writes the index. Call once, after all members.
  Status Finish();
  const std::vector<ArchiveMember>& members() const { return members_; }

 private:
  ArchiveWriter(uint32_t count, int level, WriteBytes write);
  Status Write(std::span<const uint8_t> bytes);
  uint32_t count_ = 0;
  int level_ = 0;
  WriteBytes write_;
  uint64_t position_ = 0;
  std::vector<ArchiveMember> members_;
};

// Reads an archive front to back. After Begin, for each of count() members: Next, then Content.
// Then End. All errors about the bytes are kCorruptData (kUnsupported for a newer version), with a
// message that starts with "bad magic", "bad header", "truncated", "trailing bytes", "bad index",
// "bad name" or "bad member".
class ArchiveStream {
 public:
  explicit ArchiveStream(ReadBytes read) : reader_(std::move(read)) {}
  Status Begin();
  uint32_t count() const { return count_; }
  // The next member's header; frame_bytes is not known yet.
  Result<ArchiveMember> Next();
  // Passes the content on; it is known to be right only once this has returned without an error.
  Status Content(const WriteBytes& write);
  // The index must be there, say the same as the headers, and be the end.
  Status End();

 private:
  BufferedReader reader_;
  uint32_t count_ = 0;
  std::vector<ArchiveMember> members_;
};

// The members by the index of an archive of `archive_bytes` bytes, of which read_at gives any part.
// Reads the first and the last bytes only. Errors as above, and those of read_at.
using ReadAt = std::function<Status(uint64_t offset, std::span<uint8_t> out)>;
Result<std::vector<ArchiveMember>> ReadArchiveIndex(uint64_t archive_bytes, const ReadAt& read_at);

// The content of one member, read alone, with its header, size and hash checked. Errors as above;
// kOutOfRange above max_bytes.
Result<std::vector<uint8_t>> ReadArchiveMember(const ArchiveMember& member, uint64_t max_bytes,
                                               const ReadAt& read_at);

}  // namespace patina
