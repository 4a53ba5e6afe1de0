// zstd frames in pieces, for content that need not fit into memory.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>

#include "formats/base/result.h"

namespace patina {

// Fills a buffer with the next bytes of a source; returns how many, 0 only at the end.
using ReadBytes = std::function<Result<size_t>(std::span<uint8_t>)>;
// Takes bytes, all or an error.
using WriteBytes = std::function<Status(std::span<const uint8_t>)>;

// Writes one frame that states its content's size and holds a checksum: the same bytes for the same
// content, level and version of libzstd. Returns the bytes of the frame. Errors: those of read and
// write; kInvalidArgument (level not 1..19), kConflict (the source has not exactly
// `content_bytes`), kResourceExhausted, kInternal.
Result<uint64_t> CompressFrame(uint64_t content_bytes, int level, const ReadBytes& read,
                               const WriteBytes& write);

// Bytes of a source that may be looked at before they are taken.
class BufferedReader {
 public:
  explicit BufferedReader(ReadBytes read);
  // At least one byte, or nothing at the end.
  Result<std::span<const uint8_t>> Peek();
  void Take(size_t count);  // at most what was peeked at
  // Exactly so many bytes. Errors: those of the source; kCorruptData ("truncated").
  Status ReadExactly(std::span<uint8_t> out, std::string_view what);
  uint64_t position() const { return position_; }

 private:
  ReadBytes read_;
  std::unique_ptr<uint8_t[]> buffer_;
  size_t begin_ = 0, end_ = 0;
  uint64_t position_ = 0;
};

// Reads one frame, no byte more, and passes its content on in pieces. The window a frame may ask
// for is at most 128 MiB. Errors: those of the source and of write; kCorruptData with "truncated"
// or "bad zstd frame", or if the content has not exactly `content_bytes`, of which no more than
// that is passed on.
Status DecompressFrame(uint64_t content_bytes, BufferedReader* source, const WriteBytes& write);

}  // namespace patina
