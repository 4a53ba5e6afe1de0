// DDS files with a DX10 header that hold one texture of three features and its mip chain, as BC6H
// blocks or as halves. Byte table: FORMATS.md.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bc6h.h"

namespace patina {

inline constexpr int kDdsHeaderBytes = 148;
inline constexpr int kMaxDdsSide = 65536;

// The values are DXGI formats. RGBA16F stands for three halves and an alpha of 1, as DXGI has no
// three halves without it.
enum class TextureFormat : uint32_t { kRgba16f = 10, kBc6hUf16 = 95, kBc6hSf16 = 96 };
// As manifests have it: "RGBA16F", "BC6H_UF16", "BC6H_SF16".
const char* TextureFormatName(TextureFormat format);

struct DdsTexture {
  TextureFormat format = TextureFormat::kBc6hUf16;
  int width = 0;  // of level 0, texels
  int height = 0;
  // Of BC6H. levels[l]: blocks of the level of DdsLevelSide(width, l) x DdsLevelSide(height, l)
  // texels, row-major, DdsBlocks(side) across and down. Texels of a block beyond the edge mean
  // nothing.
  std::vector<std::vector<bc6h::Block>> levels;
  // Of RGBA16F. halves[l]: bits of the texels of the level, [y][x][rgb], row-major.
  std::vector<std::vector<uint16_t>> halves;

  bool has_blocks() const { return format != TextureFormat::kRgba16f; }
  int level_count() const { return static_cast<int>(has_blocks() ? levels.size() : halves.size()); }
};

inline int DdsLevelSide(int side, int level) {
  return level < 31 && (side >> level) > 1 ? side >> level : 1;
}
inline int DdsBlocks(int side) { return (side + 3) / 4; }
// Levels of the chain down to 1x1. Sides >= 1.
int DdsFullChainLevels(int width, int height);

// The bytes of a file: the 148-byte header, then the levels, largest first.
// Errors: kInvalidArgument (sizes below 1 or above kMaxDdsSide, no level, more levels than the full
// chain, a level with a wrong number of blocks, a level 0 of 4 GiB or more).
Result<std::vector<uint8_t>> EncodeDds(bc6h::Format format, int width, int height,
                                       std::span<const std::vector<bc6h::Block>> levels);
// The same of texels as bits of halves, levels[l]: [y][x][rgb], row-major; any value is written.
Result<std::vector<uint8_t>> EncodeHalvesDds(int width, int height,
                                             std::span<const std::vector<uint16_t>> levels);
// Whichever of the two the texture's format calls for.
Result<std::vector<uint8_t>> EncodeDds(const DdsTexture& texture);

// Reads what these write, and the same kind of files from other tools (flags, linear size or pitch,
// and alpha are not checked). Errors: kCorruptData, with a message that starts with "bad magic",
// "bad header", "truncated" or "trailing bytes"; kUnsupported for another format, a volume, a cube
// map or an array.
Result<DdsTexture> ParseDds(std::span<const uint8_t> bytes);

// The same for files; errors name the file. Reading refuses files above max_bytes with kOutOfRange.
Status WriteDds(const std::string& path, bc6h::Format format, int width, int height,
                std::span<const std::vector<bc6h::Block>> levels);
Result<DdsTexture> ReadDds(const std::string& path, uint64_t max_bytes = uint64_t{8} << 30);

// Textures of plain numbers that shaders fetch by texel; the values are DXGI formats.
enum class DataFormat : uint32_t {
  kRgba32Float = 2,
  kRgba16Float = 10,
  kR32Uint = 42,
  kR16Uint = 57
};

constexpr int DataTexelBytes(DataFormat format) {
  return format == DataFormat::kRgba32Float   ? 16
         : format == DataFormat::kRgba16Float ? 8
         : format == DataFormat::kR32Uint     ? 4
                                              : 2;
}

// The bytes of a file with one level: the 148-byte header with the DXGI format, then the texels,
// little-endian, row by row without padding. Sides >= 1; texels has exactly the level's bytes.
std::vector<uint8_t> EncodeDataDds(DataFormat format, int width, int height,
                                   std::span<const uint8_t> texels);

// The texels of a level as bits of halves: [y][x][rgb], row-major.
std::vector<uint16_t> DecodeDdsLevel(const DdsTexture& texture, int level);

}  // namespace patina
