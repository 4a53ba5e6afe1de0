#include "formats/base/zstd_stream.h"

#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

namespace patina {
namespace {

// Of both directions. The bytes of a frame do not depend on it: the encoder gathers whole blocks.
constexpr size_t kPieceBytes = size_t{1} << 17;
constexpr int kMaxWindowLog = 27;

tl::unexpected<Error> NoMemory() {
  return Fail(ErrorCode::kResourceExhausted, "no memory for zstd");
}

tl::unexpected<Error> Truncated(std::string_view what) {
  return Fail(ErrorCode::kCorruptData, "truncated: the file ends within " + std::string(what));
}

std::string SizeProblem(uint64_t wanted) {
  return "the content has not the " + std::to_string(wanted) + " bytes that are stated";
}

}  // namespace

Result<uint64_t> CompressFrame(uint64_t content_bytes, int level, const ReadBytes& read,
                               const WriteBytes& write) {
  if (level < 1 || level > 19) {
    return Fail(ErrorCode::kInvalidArgument,
                "zstd level " + std::to_string(level) + " is not within 1 to 19");
  }
  const std::unique_ptr<ZSTD_CCtx, size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(),
                                                                   &ZSTD_freeCCtx);
  if (context == nullptr) return NoMemory();
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, level);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  ZSTD_CCtx_setPledgedSrcSize(context.get(), content_bytes);
  std::vector<uint8_t> in(kPieceBytes), out(ZSTD_CStreamOutSize());
  uint64_t taken = 0, written = 0;
  for (bool last = false; !last;) {
    // Whole pieces, whatever the source gives at a time, so that the same calls follow each other.
    size_t held = 0;
    while (held < in.size() && !last) {
      PATINA_ASSIGN(const size_t got, read(std::span(in).subspan(held)));
      held += got;
      last = got == 0;
    }
    taken += held;
    if (taken > content_bytes || (last && taken != content_bytes))
      return Fail(ErrorCode::kConflict, SizeProblem(content_bytes));
    ZSTD_inBuffer piece{in.data(), held, 0};
    for (bool done = false; !done;) {
      ZSTD_outBuffer result{out.data(), out.size(), 0};
      const size_t left =
          ZSTD_compressStream2(context.get(), &result, &piece, last ? ZSTD_e_end : ZSTD_e_continue);
      if (ZSTD_isError(left) != 0)
        return Fail(ErrorCode::kInternal, std::string("zstd: ") + ZSTD_getErrorName(left));
      PATINA_TRY(write(std::span(out).first(result.pos)));
      written += result.pos;
      done = last ? left == 0 : piece.pos == piece.size;
    }
  }
  return written;
}

BufferedReader::BufferedReader(ReadBytes read)
    : read_(std::move(read)), buffer_(std::make_unique<uint8_t[]>(kPieceBytes)) {}

Result<std::span<const uint8_t>> BufferedReader::Peek() {
  if (begin_ == end_) {
    PATINA_ASSIGN(end_, read_(std::span(buffer_.get(), kPieceBytes)));
    begin_ = 0;
  }
  return std::span<const uint8_t>(buffer_.get() + begin_, end_ - begin_);
}

void BufferedReader::Take(size_t count) {
  begin_ += count;
  position_ += count;
}

Status BufferedReader::ReadExactly(std::span<uint8_t> out, std::string_view what) {
  while (!out.empty()) {
    PATINA_ASSIGN(const std::span<const uint8_t> ready, Peek());
    if (ready.empty()) return Truncated(what);
    const size_t count = std::min(out.size(), ready.size());
    std::memcpy(out.data(), ready.data(), count);
    out = out.subspan(count);
    Take(count);
  }
  return {};
}

Status DecompressFrame(uint64_t content_bytes, BufferedReader* source, const WriteBytes& write) {
  const std::unique_ptr<ZSTD_DCtx, size_t (*)(ZSTD_DCtx*)> context(ZSTD_createDCtx(),
                                                                   &ZSTD_freeDCtx);
  if (context == nullptr) return NoMemory();
  ZSTD_DCtx_setParameter(context.get(), ZSTD_d_windowLogMax, kMaxWindowLog);
  std::vector<uint8_t> out(ZSTD_DStreamOutSize());
  uint64_t passed = 0;
  for (size_t left = 1; left != 0;) {
    PATINA_ASSIGN(const std::span<const uint8_t> ready, source->Peek());
    ZSTD_inBuffer piece{ready.data(), ready.size(), 0};
    ZSTD_outBuffer result{out.data(), out.size(), 0};
    left = ZSTD_decompressStream(context.get(), &result, &piece);
    if (ZSTD_isError(left) != 0)
      return Fail(ErrorCode::kCorruptData,
                  std::string("bad zstd frame: ") + ZSTD_getErrorName(left));
    // Nothing came in, nothing came out, and the frame is not at its end.
    if (ready.empty() && result.pos == 0 && left != 0) return Truncated("a zstd frame");
    source->Take(piece.pos);
    passed += result.pos;
    if (passed > content_bytes) return Fail(ErrorCode::kCorruptData, SizeProblem(content_bytes));
    PATINA_TRY(write(std::span(out).first(result.pos)));
  }
  if (passed != content_bytes) return Fail(ErrorCode::kCorruptData, SizeProblem(content_bytes));
  return {};
}

}  // namespace patina
