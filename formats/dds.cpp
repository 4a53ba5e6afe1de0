#include "formats/dds.h"

#include <algorithm>
#include <cstring>

#include "formats/base/check.h"
#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"

namespace patina {
namespace {

constexpr uint32_t kMagic = 0x20534444;  // "DDS "
constexpr uint32_t kDx10 = 0x30315844;   // "DX10"
constexpr uint32_t kFlags =
    0x000A1007;  // caps, height, width, pixel format, mip map count, linear size
constexpr uint32_t kDataFlags = 0x0002100F;  // the same with a pitch in place of the linear size
constexpr uint32_t kPixelFormatFourCc = 0x4;
constexpr uint32_t kCapsTexture = 0x1000;
constexpr uint32_t kCapsComplexMipmap = 0x400008;
constexpr uint32_t kDimensionTexture2d = 3;
constexpr uint32_t kMiscTextureCube = 0x4;

// Offsets in the file; the DDS_HEADER starts at 4, the DDS_HEADER_DXT10 at 128.
enum Offset : int {
  kMagicAt = 0,
  kSizeAt = 4,
  kFlagsAt = 8,
  kHeightAt = 12,
  kWidthAt = 16,
  kLinearSizeAt = 20,
  kDepthAt = 24,
  kMipCountAt = 28,
  kPixelFormatSizeAt = 76,
  kPixelFormatFlagsAt = 80,
  kFourCcAt = 84,
  kCapsAt = 108,
  kDxgiFormatAt = 128,
  kDimensionAt = 132,
  kMiscFlagAt = 136,
  kArraySizeAt = 140
};

constexpr uint16_t kHalfOne = 0x3C00;
constexpr uint64_t kHalfTexelBytes = DataTexelBytes(DataFormat::kRgba16Float);

uint64_t LevelBlocks(int width, int height, int level) {
  return static_cast<uint64_t>(DdsBlocks(DdsLevelSide(width, level))) *
         static_cast<uint64_t>(DdsBlocks(DdsLevelSide(height, level)));
}

uint64_t LevelTexels(int width, int height, int level) {
  return static_cast<uint64_t>(DdsLevelSide(width, level)) *
         static_cast<uint64_t>(DdsLevelSide(height, level));
}

uint64_t LevelBytes(TextureFormat format, int width, int height, int level) {
  return format == TextureFormat::kRgba16f ? LevelTexels(width, height, level) * kHalfTexelBytes
                                           : LevelBlocks(width, height, level) * bc6h::kBlockBytes;
}

// Fills a zeroed header. size: bytes of level 0 with kFlags, of a row with kDataFlags.
void PutHeader(uint8_t* bytes, uint32_t flags, uint32_t size, int width, int height, size_t levels,
               uint32_t dxgi_format) {
  const auto put = [&](int offset, uint32_t value) { StoreLittle32(bytes + offset, value); };
  put(kMagicAt, kMagic);
  put(kSizeAt, 124);
  put(kFlagsAt, flags);
  put(kHeightAt, static_cast<uint32_t>(height));
  put(kWidthAt, static_cast<uint32_t>(width));
  put(kLinearSizeAt, size);
  put(kDepthAt, 1);
  put(kMipCountAt, static_cast<uint32_t>(levels));
  put(kPixelFormatSizeAt, 32);
  put(kPixelFormatFlagsAt, kPixelFormatFourCc);
  put(kFourCcAt, kDx10);
  put(kCapsAt, kCapsTexture | (levels > 1 ? kCapsComplexMipmap : 0));
  put(kDxgiFormatAt, dxgi_format);
  put(kDimensionAt, kDimensionTexture2d);
  put(kArraySizeAt, 1);
}

std::string SizeText(int64_t width, int64_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

tl::unexpected<Error> BadHeader(const std::string& field, int offset, uint32_t value,
                                const std::string& wanted) {
  return Fail(ErrorCode::kCorruptData, "bad header: " + field + " at byte " +
                                           std::to_string(offset) + " is " + std::to_string(value) +
                                           ", not " + wanted);
}

Status CheckSize(int width, int height, size_t levels) {
  if (width < 1 || height < 1 || width > kMaxDdsSide || height > kMaxDdsSide) {
    return Fail(ErrorCode::kInvalidArgument, "a DDS texture of " + SizeText(width, height) +
                                                 " texels cannot be written: sides are 1 to " +
                                                 std::to_string(kMaxDdsSide));
  }
  const int full = DdsFullChainLevels(width, height);
  if (levels < 1 || levels > static_cast<size_t>(full)) {
    return Fail(ErrorCode::kInvalidArgument,
                std::to_string(levels) + " levels for a DDS texture of " + SizeText(width, height) +
                    ", which can have 1 to " + std::to_string(full));
  }
  return {};
}

Status CheckCount(size_t level, size_t count, const char* what, uint64_t wanted) {
  if (count == wanted) return {};
  return Fail(ErrorCode::kInvalidArgument, "DDS level " + std::to_string(level) + " has " +
                                               std::to_string(count) + " " + what + " instead of " +
                                               std::to_string(wanted));
}

// The header, and room for the levels.
Result<std::vector<uint8_t>> BeginFile(TextureFormat format, int width, int height, size_t levels) {
  const uint64_t first = LevelBytes(format, width, height, 0);
  if (first > UINT32_MAX) {
    return Fail(ErrorCode::kInvalidArgument,
                "a DDS texture of " + SizeText(width, height) + " is 4 GiB or more");
  }
  uint64_t total = kDdsHeaderBytes;
  for (size_t level = 0; level < levels; ++level)
    total += LevelBytes(format, width, height, static_cast<int>(level));
  std::vector<uint8_t> bytes(total, 0);
  const bool blocks = format != TextureFormat::kRgba16f;
  const uint64_t size = blocks ? first : static_cast<uint64_t>(width) * kHalfTexelBytes;
  PutHeader(bytes.data(), blocks ? kFlags : kDataFlags, static_cast<uint32_t>(size), width, height,
            levels, static_cast<uint32_t>(format));
  return bytes;
}

}  // namespace

int DdsFullChainLevels(int width, int height) {
  int levels = 1;
  for (int side = std::max(width, height); side > 1; side >>= 1) ++levels;
  return levels;
}

const char* TextureFormatName(TextureFormat format) {
  switch (format) {
    case TextureFormat::kRgba16f:
      return "RGBA16F";
    case TextureFormat::kBc6hSf16:
      return "BC6H_SF16";
    case TextureFormat::kBc6hUf16:
      break;
  }
  return "BC6H_UF16";
}

Result<std::vector<uint8_t>> EncodeDds(bc6h::Format format, int width, int height,
                                       std::span<const std::vector<bc6h::Block>> levels) {
  PATINA_TRY(CheckSize(width, height, levels.size()));
  for (size_t level = 0; level < levels.size(); ++level) {
    PATINA_TRY(CheckCount(level, levels[level].size(), "blocks",
                          LevelBlocks(width, height, static_cast<int>(level))));
  }
  PATINA_ASSIGN(std::vector<uint8_t> bytes,
                BeginFile(static_cast<TextureFormat>(format), width, height, levels.size()));
  uint8_t* out = bytes.data() + kDdsHeaderBytes;
  for (const auto& level : levels) {
    std::memcpy(out, level.data(), level.size() * sizeof(bc6h::Block));
    out += level.size() * sizeof(bc6h::Block);
  }
  return bytes;
}

Result<std::vector<uint8_t>> EncodeHalvesDds(int width, int height,
                                             std::span<const std::vector<uint16_t>> levels) {
  PATINA_TRY(CheckSize(width, height, levels.size()));
  for (size_t level = 0; level < levels.size(); ++level) {
    PATINA_TRY(CheckCount(level, levels[level].size(), "halves",
                          3 * LevelTexels(width, height, static_cast<int>(level))));
  }
  PATINA_ASSIGN(std::vector<uint8_t> bytes,
                BeginFile(TextureFormat::kRgba16f, width, height, levels.size()));
  uint8_t* out = bytes.data() + kDdsHeaderBytes;
  for (const auto& level : levels) {
    for (size_t i = 0; i < level.size(); i += 3, out += kHalfTexelBytes) {
      for (size_t c = 0; c < 3; ++c) StoreLittle16(out + 2 * c, level[i + c]);
      StoreLittle16(out + 6, kHalfOne);
    }
  }
  return bytes;
}

Result<std::vector<uint8_t>> EncodeDds(const DdsTexture& texture) {
  if (!texture.has_blocks()) return EncodeHalvesDds(texture.width, texture.height, texture.halves);
  return EncodeDds(static_cast<bc6h::Format>(texture.format), texture.width, texture.height,
                   texture.levels);
}

std::vector<uint8_t> EncodeDataDds(DataFormat format, int width, int height,
                                   std::span<const uint8_t> texels) {
  const int texel_bytes = DataTexelBytes(format);
  PATINA_CHECK(width >= 1 && height >= 1 &&
               texels.size() == static_cast<size_t>(width) * height * texel_bytes);
  std::vector<uint8_t> bytes(kDdsHeaderBytes + texels.size(), 0);
  PutHeader(bytes.data(), kDataFlags, static_cast<uint32_t>(width * texel_bytes), width, height, 1,
            static_cast<uint32_t>(format));
  std::memcpy(bytes.data() + kDdsHeaderBytes, texels.data(), texels.size());
  return bytes;
}

Result<DdsTexture> ParseDds(std::span<const uint8_t> bytes) {
  if (bytes.size() < 4) {
    return Fail(ErrorCode::kCorruptData,
                "truncated: " + std::to_string(bytes.size()) + " bytes, no room for a magic");
  }
  const auto get = [&](int offset) { return LoadLittle32(bytes.data() + offset); };
  if (get(kMagicAt) != kMagic)
    return Fail(ErrorCode::kCorruptData, "bad magic: the file does not start with \"DDS \"");
  if (bytes.size() < kDdsHeaderBytes) {
    return Fail(ErrorCode::kCorruptData, "truncated: " + std::to_string(bytes.size()) + " of " +
                                             std::to_string(kDdsHeaderBytes) + " header bytes");
  }
  if (get(kSizeAt) != 124) return BadHeader("header size", kSizeAt, get(kSizeAt), "124");
  if (get(kPixelFormatSizeAt) != 32) {
    return BadHeader("pixel format size", kPixelFormatSizeAt, get(kPixelFormatSizeAt), "32");
  }
  if ((get(kPixelFormatFlagsAt) & kPixelFormatFourCc) == 0 || get(kFourCcAt) != kDx10) {
    return Fail(ErrorCode::kUnsupported,
                "a DDS file without a DX10 header; only BC6H and RGBA16F with one are read");
  }
  const auto format = static_cast<TextureFormat>(get(kDxgiFormatAt));
  if (format != TextureFormat::kBc6hUf16 && format != TextureFormat::kBc6hSf16 &&
      format != TextureFormat::kRgba16f) {
    return Fail(ErrorCode::kUnsupported,
                "DXGI format " + std::to_string(get(kDxgiFormatAt)) +
                    " at byte 128; only 95 (BC6H_UF16), 96 (BC6H_SF16) and 10 (RGBA16F) are read");
  }
  if (get(kDimensionAt) != kDimensionTexture2d || get(kArraySizeAt) != 1 ||
      (get(kMiscFlagAt) & kMiscTextureCube) != 0) {
    return Fail(ErrorCode::kUnsupported,
                "a DDS volume, cube map or array; only single 2D textures are read");
  }
  DdsTexture texture;
  const uint32_t width = get(kWidthAt);
  const uint32_t height = get(kHeightAt);
  if (width < 1 || width > kMaxDdsSide)
    return BadHeader("width", kWidthAt, width, "1 to " + std::to_string(kMaxDdsSide));
  if (height < 1 || height > kMaxDdsSide) {
    return BadHeader("height", kHeightAt, height, "1 to " + std::to_string(kMaxDdsSide));
  }
  texture.format = format;
  texture.width = static_cast<int>(width);
  texture.height = static_cast<int>(height);
  const uint32_t levels = std::max(1u, get(kMipCountAt));  // 0 means 1 in files of some tools
  const int full = DdsFullChainLevels(texture.width, texture.height);
  if (levels > static_cast<uint32_t>(full)) {
    return BadHeader("mip map count", kMipCountAt, levels, "1 to " + std::to_string(full));
  }
  uint64_t wanted = kDdsHeaderBytes;
  for (int level = 0; level < static_cast<int>(levels); ++level) {
    wanted += LevelBytes(format, texture.width, texture.height, level);
  }
  if (bytes.size() < wanted) {
    return Fail(ErrorCode::kCorruptData, "truncated: " + std::to_string(bytes.size()) + " of the " +
                                             std::to_string(wanted) + " bytes of " +
                                             std::to_string(levels) + " levels from " +
                                             SizeText(width, height));
  }
  if (bytes.size() > wanted) {
    return Fail(ErrorCode::kCorruptData, "trailing bytes: the texture ends at byte " +
                                             std::to_string(wanted) + ", the file at " +
                                             std::to_string(bytes.size()));
  }
  const uint8_t* in = bytes.data() + kDdsHeaderBytes;
  if (!texture.has_blocks()) {
    for (int level = 0; level < static_cast<int>(levels); ++level) {
      std::vector<uint16_t>& halves = texture.halves.emplace_back();
      halves.resize(3 * LevelTexels(texture.width, texture.height, level));
      for (size_t i = 0; i < halves.size(); i += 3, in += kHalfTexelBytes) {
        for (size_t c = 0; c < 3; ++c) halves[i + c] = LoadLittle16(in + 2 * c);
      }
    }
    return texture;
  }
  texture.levels.resize(levels);
  for (int level = 0; level < static_cast<int>(levels); ++level) {
    auto& blocks = texture.levels[level];
    blocks.resize(LevelBlocks(texture.width, texture.height, level));
    std::memcpy(blocks.data(), in, blocks.size() * sizeof(bc6h::Block));
    in += blocks.size() * sizeof(bc6h::Block);
  }
  return texture;
}

Status WriteDds(const std::string& path, bc6h::Format format, int width, int height,
                std::span<const std::vector<bc6h::Block>> levels) {
  auto bytes = EncodeDds(format, width, height, levels);
  if (!bytes) return Fail(std::move(bytes).error(), path);
  return WriteFileDurably(path, std::span<const uint8_t>(*bytes));
}

Result<DdsTexture> ReadDds(const std::string& path, uint64_t max_bytes) {
  PATINA_ASSIGN(const std::vector<uint8_t> bytes, ReadFile(path, max_bytes));
  auto texture = ParseDds(bytes);
  if (!texture) return Fail(std::move(texture).error(), path);
  return texture;
}

std::vector<uint16_t> DecodeDdsLevel(const DdsTexture& texture, int level) {
  PATINA_CHECK(level >= 0 && level < texture.level_count());
  if (!texture.has_blocks()) return texture.halves[static_cast<size_t>(level)];
  const int width = DdsLevelSide(texture.width, level);
  const int height = DdsLevelSide(texture.height, level);
  const int across = DdsBlocks(width);
  std::vector<uint16_t> texels(static_cast<size_t>(width) * height * 3);
  for (int by = 0; by < DdsBlocks(height); ++by) {
    for (int bx = 0; bx < across; ++bx) {
      uint16_t block[16][3];
      bc6h::Decode(texture.levels[level][static_cast<size_t>(by) * across + bx].data(),
                   static_cast<bc6h::Format>(texture.format), block);
      const int columns = std::min(4, width - 4 * bx);
      for (int y = 0; y < std::min(4, height - 4 * by); ++y) {
        std::memcpy(&texels[(static_cast<size_t>(4 * by + y) * width + 4 * bx) * 3], block[4 * y],
                    static_cast<size_t>(columns) * 3 * sizeof(uint16_t));
      }
    }
  }
  return texels;
}

}  // namespace patina
