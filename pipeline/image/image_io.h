// Image files in and out. The only file behind this header knows OpenImageIO, and its exceptions
// stop there.
#pragma once

#include <cstdint>
#include <string>

#include "formats/base/result.h"
#include "pipeline/image/image.h"

namespace patina {

inline constexpr int kMaxImageSide = 65536;
inline constexpr uint64_t kMaxImagePixels = uint64_t{1} << 28;

// Limits the threads (at least 1) that decoders and encoders start of themselves, for the whole
// process.
void SetImageIoThreads(int threads);

// Reads the header of a PNG, JPEG, TGA, TIFF, OpenEXR, Radiance HDR or DDS file. The format is told
// by the first bytes (TGA, which has no magic, by its extension).
// The first part of a multi-part file and its first mip are meant; more than four channels are cut
// to the first four, integer channels of 32 bits and whatever follows them are left out: each with
// a warning in the result. Errors, with path and remedy: kNotFound, kInvalidArgument (a directory),
// kIo, kCorruptData, kUnsupported (another format, deep or volume images, 32-bit integer or 64-bit
// samples), kOutOfRange (a side above kMaxImageSide, more than kMaxImagePixels pixels, or pixels
// that cannot come from a file of that size).
Result<ImageInfo> ReadImageInfo(const std::string& path);

// Reads header and pixels. Safe to call from several threads at once.
// Errors: those of ReadImageInfo; kCorruptData also for truncated or damaged pixels,
// kResourceExhausted without memory.
Result<Image> ReadImage(const std::string& path);

enum class WriteFormat { kPng8, kPng16, kExrHalf, kExrFloat };

// Writes rows from the top of interleaved values: [height][width][channels], 1 to 4 channels (grey,
// grey + alpha, RGB, RGBA; alpha unassociated). PNG clamps to [0, 1] and rounds to nearest; NaN
// becomes 0. Values are written as they are: no colour conversion, no dithering. The same input
// gives the same bytes (no time stamps). `primaries`: null, or of the values, to be named in an EXR
// file. Errors: kInvalidArgument (sizes), kIo (with the path; what
// was written is removed), kResourceExhausted.
Status WriteImage(const std::string& path, WriteFormat format, int width, int height, int channels,
                  const float* values, const Primaries* primaries = nullptr);

}  // namespace patina
