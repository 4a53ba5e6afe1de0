// One zstd frame around a whole file, for formats where it is optional.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/base/result.h"

namespace patina {

// Whether the bytes begin like a zstd frame.
bool IsZstdFrame(std::span<const uint8_t> bytes);

// A frame that states its content's size and holds a checksum; the same bytes for the same input
// and version of libzstd. `level` is 1..19. Errors: kInvalidArgument (level), kInternal.
Result<std::vector<uint8_t>> CompressZstd(std::span<const uint8_t> bytes, int level);

// The content of a file that is exactly one frame. Allocates no more than max_bytes for it. Errors:
// kCorruptData with a message that starts with "truncated", "trailing bytes" or "bad zstd frame";
// kOutOfRange (a content above max_bytes, before anything is decompressed).
Result<std::vector<uint8_t>> DecompressZstd(std::span<const uint8_t> bytes, uint64_t max_bytes);

}  // namespace patina
