#include "formats/base/zstd_frame.h"

#include <zstd.h>
#include <zstd_errors.h>

#include <memory>
#include <string>

namespace patina {
namespace {

constexpr uint8_t kMagic[4] = {0x28, 0xB5, 0x2F, 0xFD};

tl::unexpected<Error> Bad(const std::string& what) {
  return Fail(ErrorCode::kCorruptData, "bad zstd frame: " + what);
}

}  // namespace

bool IsZstdFrame(std::span<const uint8_t> bytes) {
  return bytes.size() >= 4 && bytes[0] == kMagic[0] && bytes[1] == kMagic[1] &&
         bytes[2] == kMagic[2] && bytes[3] == kMagic[3];
}

Result<std::vector<uint8_t>> CompressZstd(std::span<const uint8_t> bytes, int level) {
  if (level < 1 || level > 19) {
    return Fail(ErrorCode::kInvalidArgument,
                "zstd level " + std::to_string(level) + " is not within 1 to 19");
  }
  const std::unique_ptr<ZSTD_CCtx, size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(),
                                                                   &ZSTD_freeCCtx);
  if (context == nullptr) return Fail(ErrorCode::kResourceExhausted, "no memory for zstd");
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, level);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  std::vector<uint8_t> frame(ZSTD_compressBound(bytes.size()));
  const size_t size =
      ZSTD_compress2(context.get(), frame.data(), frame.size(), bytes.data(), bytes.size());
  if (ZSTD_isError(size) != 0)
    return Fail(ErrorCode::kInternal, std::string("zstd: ") + ZSTD_getErrorName(size));
  frame.resize(size);
  return frame;
}

Result<std::vector<uint8_t>> DecompressZstd(std::span<const uint8_t> bytes, uint64_t max_bytes) {
  const size_t frame_bytes = ZSTD_findFrameCompressedSize(bytes.data(), bytes.size());
  if (ZSTD_isError(frame_bytes) != 0) {
    if (ZSTD_getErrorCode(frame_bytes) == ZSTD_error_srcSize_wrong) {
      return Fail(ErrorCode::kCorruptData,
                  "truncated: the zstd frame does not end within the file's " +
                      std::to_string(bytes.size()) + " bytes");
    }
    return Bad(ZSTD_getErrorName(frame_bytes));
  }
  if (frame_bytes < bytes.size()) {
    return Fail(ErrorCode::kCorruptData, "trailing bytes: the zstd frame ends at byte " +
                                             std::to_string(frame_bytes) + ", the file at " +
                                             std::to_string(bytes.size()));
  }
  const unsigned long long content = ZSTD_getFrameContentSize(bytes.data(), bytes.size());
  if (content == ZSTD_CONTENTSIZE_ERROR) return Bad("no legal header");
  if (content == ZSTD_CONTENTSIZE_UNKNOWN) {
    return Bad("it does not state the size of its content; decompress the file with `zstd -d`");
  }
  if (content > max_bytes) {
    return Fail(ErrorCode::kOutOfRange, "the zstd frame states a content of " +
                                            std::to_string(content) + " bytes, more than " +
                                            std::to_string(max_bytes));
  }
  std::vector<uint8_t> result(static_cast<size_t>(content));
  const size_t size = ZSTD_decompress(result.data(), result.size(), bytes.data(), bytes.size());
  if (ZSTD_isError(size) != 0) return Bad(ZSTD_getErrorName(size));
  if (size != result.size()) {
    return Bad("it states " + std::to_string(content) + " bytes and holds " + std::to_string(size));
  }
  return result;
}

}  // namespace patina
