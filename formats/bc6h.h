// BC6H blocks: fields <-> 128 bits, and bit-exact decoding to halves. All 14 modes, UF16 and SF16.
//
// Source: the BC6H section of the Direct3D 11 functional specification (also Khronos Data Format 1.3, chapter 20).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "formats/base/result.h"

namespace patina::bc6h {

// The values are the DXGI_FORMAT numbers written to DDS headers.
enum class Format : uint32_t { kUf16 = 95, kSf16 = 96 };

inline constexpr int kModeCount = 14;
inline constexpr int kPartitionCount = 32;
inline constexpr int kBlockBytes = 16;
using Block = std::array<uint8_t, kBlockBytes>;

struct ModeInfo {
  int mode_bits;        // the value in the low 2 or 5 bits of the block
  int mode_bit_count;   // 2 or 5
  int regions;          // 1 or 2
  bool transformed;     // endpoints 1..3 are stored as deltas from endpoint 0
  int endpoint_bits;    // precision of endpoint 0, and of all after delta reconstruction
  int delta_bits[3];    // stored bits of endpoints 1..3 per channel; equals endpoint_bits if not transformed
  int index_bits;       // 3 (two regions) or 4 (one region)
};

// `mode` is 0..13, in the order of the specification's modes 1..14:
//   0..9 two regions (10.555, 7.666, 11.544, 11.454, 11.445, 9.555, 8.655, 8.565, 8.556, 6.666), 10..13 one region
//   (10.10, 11.9, 12.8, 16.4).
const ModeInfo& Mode(int mode);
inline constexpr int kModeSixBit = 9;  // 6-bit absolute endpoints, mode bits 0x1E: the only one Weinreich 2024 exports

// Bit t of PartitionMask(p) is set where texel t (row-major in the 4x4 block) belongs to region 1.
uint16_t PartitionMask(int partition);
// The texel of region 1 whose index has its top bit implied zero; that of region 0 is always texel 0.
int AnchorTexel(int partition);

// The content of a block. `endpoints[2*region + side][channel]` are the absolute codes at endpoint_bits of the mode,
// two's complement when signed; indices are 0..7 (two regions) or 0..15 (one region), row-major.
struct BlockFields {
  int mode = kModeSixBit;
  int partition = 0;  // 0 when the mode has one region
  int32_t endpoints[4][3] = {};
  uint8_t indices[16] = {};
};

// Packs legal fields. Errors: kOutOfRange when a code does not fit its bits, a delta does not fit its bits, or an anchor
// index has its top bit set (see FixAnchors).
Result<Block> Pack(const BlockFields& fields, Format format);

// Swaps the endpoints of a region, and mirrors its indices, where the anchor index has its top bit set. The decoded
// texels do not change.
void FixAnchors(BlockFields* fields);

// The fields of a block; nullopt for the reserved modes.
std::optional<BlockFields> Unpack(const uint8_t* block, Format format);

// Endpoint code -> 16- or 17-bit interpolation scale (0..65535, or -32767..32767).
int32_t Unquantize(int32_t code, int bits, Format format);
// Interpolates two unquantised endpoints with weight 0..64: (a*(64-w) + b*w + 32) >> 6.
inline int32_t Interpolate(int32_t a, int32_t b, int32_t weight) { return (a * (64 - weight) + b * weight + 32) >> 6; }
// Interpolated value -> bits of a half: scales by 31/64 (unsigned) or 31/32 (signed).
uint16_t FinishUnquantize(int32_t value, Format format);

// Weights over 64 of the 3-bit and 4-bit indices.
inline constexpr std::array<int, 8> kWeights3 = {0, 9, 18, 27, 37, 46, 55, 64};
inline constexpr std::array<int, 16> kWeights4 = {0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64};

// Decodes 16 texels, row-major, to the bits of halves; reserved modes give (0,0,0). Any 16 bytes are accepted.
void Decode(const uint8_t* block, Format format, uint16_t texels[16][3]);

}  // namespace patina::bc6h
