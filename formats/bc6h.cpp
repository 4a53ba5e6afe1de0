// Based on: the BC6H section of the Direct3D 11 functional specification; field names as in the
// Khronos Data Format.
#include "formats/bc6h.h"

#include <utility>

#include "formats/base/check.h"
#include "formats/base/little_endian.h"

namespace patina::bc6h {
namespace {

constexpr ModeInfo kModes[kModeCount] = {
    {0x00, 2, 2, true, 10, {5, 5, 5}, 3},     {0x01, 2, 2, true, 7, {6, 6, 6}, 3},
    {0x02, 5, 2, true, 11, {5, 4, 4}, 3},     {0x06, 5, 2, true, 11, {4, 5, 4}, 3},
    {0x0A, 5, 2, true, 11, {4, 4, 5}, 3},     {0x0E, 5, 2, true, 9, {5, 5, 5}, 3},
    {0x12, 5, 2, true, 8, {6, 5, 5}, 3},      {0x16, 5, 2, true, 8, {5, 6, 5}, 3},
    {0x1A, 5, 2, true, 8, {5, 5, 6}, 3},      {0x1E, 5, 2, false, 6, {6, 6, 6}, 3},
    {0x03, 5, 1, false, 10, {10, 10, 10}, 4}, {0x07, 5, 1, true, 11, {9, 9, 9}, 4},
    {0x0B, 5, 1, true, 12, {8, 8, 8}, 4},     {0x0F, 5, 1, true, 16, {4, 4, 4}, 4},
};

// What follows the mode bits, from the lowest bit up: channel, endpoint, and bits [high:low] of its
// code. [10:15] is a reversed run: bit 15 comes first. Two-region modes continue with the partition
// (5 bits); all end in the indices.
// clang-format off
constexpr const char* kLayouts[kModeCount] = {
    "g2[4] b2[4] b3[4] r0[9:0] g0[9:0] b0[9:0] r1[4:0] g3[4] g2[3:0] g1[4:0] b3[0] g3[3:0] "
    "b1[4:0] b3[1] b2[3:0] r2[4:0] b3[2] r3[4:0] b3[3]",
    "g2[5] g3[4] g3[5] r0[6:0] b3[0] b3[1] b2[4] g0[6:0] b2[5] b3[2] g2[4] b0[6:0] b3[3] b3[5] "
    "b3[4] r1[5:0] g2[3:0] g1[5:0] g3[3:0] b1[5:0] b2[3:0] r2[5:0] r3[5:0]",
    "r0[9:0] g0[9:0] b0[9:0] r1[4:0] r0[10] g2[3:0] g1[3:0] g0[10] b3[0] g3[3:0] b1[3:0] "
    "b0[10] b3[1] b2[3:0] r2[4:0] b3[2] r3[4:0] b3[3]",
    "r0[9:0] g0[9:0] b0[9:0] r1[3:0] r0[10] g3[4] g2[3:0] g1[4:0] g0[10] g3[3:0] b1[3:0] "
    "b0[10] b3[1] b2[3:0] r2[3:0] b3[0] b3[2] r3[3:0] g2[4] b3[3]",
    "r0[9:0] g0[9:0] b0[9:0] r1[3:0] r0[10] b2[4] g2[3:0] g1[3:0] g0[10] b3[0] g3[3:0] b1[4:0] "
    "b0[10] b2[3:0] r2[3:0] b3[1] b3[2] r3[3:0] b3[4] b3[3]",
    "r0[8:0] b2[4] g0[8:0] g2[4] b0[8:0] b3[4] r1[4:0] g3[4] g2[3:0] g1[4:0] b3[0] g3[3:0] "
    "b1[4:0] b3[1] b2[3:0] r2[4:0] b3[2] r3[4:0] b3[3]",
    "r0[7:0] g3[4] b2[4] g0[7:0] b3[2] g2[4] b0[7:0] b3[3] b3[4] r1[5:0] g2[3:0] g1[4:0] b3[0] "
    "g3[3:0] b1[4:0] b3[1] b2[3:0] r2[5:0] r3[5:0]",
    "r0[7:0] b3[0] b2[4] g0[7:0] g2[5] g2[4] b0[7:0] g3[5] b3[4] r1[4:0] g3[4] g2[3:0] g1[5:0] "
    "g3[3:0] b1[4:0] b3[1] b2[3:0] r2[4:0] b3[2] r3[4:0] b3[3]",
    "r0[7:0] b3[1] b2[4] g0[7:0] b2[5] g2[4] b0[7:0] b3[5] b3[4] r1[4:0] g3[4] g2[3:0] g1[4:0] "
    "b3[0] g3[3:0] b1[5:0] b2[3:0] r2[4:0] b3[2] r3[4:0] b3[3]",
    "r0[5:0] g3[4] b3[0] b3[1] b2[4] g0[5:0] g2[5] b2[5] b3[2] g2[4] b0[5:0] g3[5] b3[3] b3[5] "
    "b3[4] r1[5:0] g2[3:0] g1[5:0] g3[3:0] b1[5:0] b2[3:0] r2[5:0] r3[5:0]",
    "r0[9:0] g0[9:0] b0[9:0] r1[9:0] g1[9:0] b1[9:0]",
    "r0[9:0] g0[9:0] b0[9:0] r1[8:0] r0[10] g1[8:0] g0[10] b1[8:0] b0[10]",
    "r0[9:0] g0[9:0] b0[9:0] r1[7:0] r0[10:11] g1[7:0] g0[10:11] b1[7:0] b0[10:11]",
    "r0[9:0] g0[9:0] b0[9:0] r1[3:0] r0[10:15] g1[3:0] g0[10:15] b1[3:0] b0[10:15]",
};
// clang-format on

constexpr uint16_t kPartitions[kPartitionCount] = {
    0xCCCC, 0x8888, 0xEEEE, 0xECC8, 0xC880, 0xFEEC, 0xFEC8, 0xEC80, 0xC800, 0xFFEC, 0xFE80,
    0xE800, 0xFFE8, 0xFF00, 0xFFF0, 0xF000, 0xF710, 0x008E, 0x7100, 0x08CE, 0x008C, 0x7310,
    0x3100, 0x8CCE, 0x088C, 0x3110, 0x6666, 0x366C, 0x17E8, 0x0FF0, 0x718E, 0x399C};
constexpr uint8_t kAnchors[kPartitionCount] = {15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15,
                                               15, 15, 15, 15, 15, 15, 2,  8,  2,  2,  8,
                                               8,  15, 2,  8,  2,  2,  8,  8,  2,  2};

// A run of bits of one endpoint code.
struct Run {
  uint8_t position;  // in the block
  uint8_t count;
  uint8_t slot;     // endpoint * 3 + channel
  uint8_t low_bit;  // of the code
};

struct Layout {
  Run runs[40] = {};
  int count = 0;
  int end = 0;  // first bit after the endpoints
};

// A reversed run becomes runs of one bit.
constexpr Layout ParseLayout(const char* text, int position) {
  Layout layout;
  while (*text != '\0') {
    const int channel = *text == 'r' ? 0 : *text == 'g' ? 1 : 2;
    const int slot = (text[1] - '0') * 3 + channel;
    text += 3;  // "r0["
    int numbers[2] = {0, -1};
    for (int n = 0; *text != ']'; ++text) {
      if (*text == ':') {
        numbers[++n] = 0;
      } else {
        numbers[n] = numbers[n] * 10 + (*text - '0');
      }
    }
    const int first = numbers[0];
    const int last = numbers[1] < 0 ? first : numbers[1];
    for (int bit = last; bit >= first && last != first; --bit) {
      layout.runs[layout.count++] = {static_cast<uint8_t>(position++), 1,
                                     static_cast<uint8_t>(slot), static_cast<uint8_t>(bit)};
    }
    if (last <= first) {
      const int count = first - last + 1;
      layout.runs[layout.count++] = {static_cast<uint8_t>(position), static_cast<uint8_t>(count),
                                     static_cast<uint8_t>(slot), static_cast<uint8_t>(last)};
      position += count;
    }
    ++text;
    if (*text == ' ') ++text;
  }
  layout.end = position;
  return layout;
}

struct Tables {
  Layout layouts[kModeCount];
  int8_t mode_of_bits[32] = {};  // by the low five bits of a block; -1: reserved
};

constexpr Tables MakeTables() {
  Tables tables;
  for (int bits = 0; bits < 32; ++bits) tables.mode_of_bits[bits] = -1;
  for (int mode = 0; mode < kModeCount; ++mode) {
    tables.layouts[mode] = ParseLayout(kLayouts[mode], kModes[mode].mode_bit_count);
    for (int bits = 0; bits < 32; ++bits) {
      if ((bits & ((1 << kModes[mode].mode_bit_count) - 1)) == kModes[mode].mode_bits) {
        tables.mode_of_bits[bits] = static_cast<int8_t>(mode);
      }
    }
  }
  return tables;
}

constexpr Tables kTables = MakeTables();

constexpr bool LayoutsAreComplete() {
  for (int mode = 0; mode < kModeCount; ++mode) {
    if (kTables.layouts[mode].end != (kModes[mode].regions == 2 ? 77 : 65)) return false;
  }
  return true;
}
static_assert(LayoutsAreComplete());

struct Bits {
  uint64_t low = 0;
  uint64_t high = 0;

  // 1 <= count <= 16, position + count <= 128
  uint32_t Get(int position, int count) const {
    uint64_t value;
    if (position >= 64) {
      value = high >> (position - 64);
    } else {
      value = low >> position;
      if (position + count > 64) value |= high << (64 - position);
    }
    return static_cast<uint32_t>(value & ((uint64_t{1} << count) - 1));
  }
  // The bits must be zero before.
  void Put(int position, int count, uint32_t value) {
    if (position >= 64) {
      high |= static_cast<uint64_t>(value) << (position - 64);
    } else {
      low |= static_cast<uint64_t>(value) << position;
      if (position + count > 64) high |= static_cast<uint64_t>(value) >> (64 - position);
    }
  }
};

int32_t SignExtend(uint32_t value, int bits) {
  const uint32_t sign = uint32_t{1} << (bits - 1);
  const uint32_t kept = value & ((sign << 1) - 1);
  return static_cast<int32_t>(kept ^ sign) - static_cast<int32_t>(sign);
}

// Mode, partition and absolute endpoints; false for a reserved mode.
bool UnpackHead(const Bits& bits, Format format, int* mode, int* partition,
                int32_t endpoints[4][3]) {
  *mode = kTables.mode_of_bits[bits.low & 31];
  *partition = 0;
  if (*mode < 0) return false;
  const ModeInfo& info = kModes[*mode];
  const Layout& layout = kTables.layouts[*mode];
  uint32_t codes[12] = {};
  for (int i = 0; i < layout.count; ++i) {
    const Run& run = layout.runs[i];
    codes[run.slot] |= bits.Get(run.position, run.count) << run.low_bit;
  }
  const bool is_signed = format == Format::kSf16;
  const uint32_t mask = (uint32_t{1} << info.endpoint_bits) - 1;
  const int count = 2 * info.regions;
  for (int e = 0; e < 4; ++e) {
    for (int c = 0; c < 3; ++c) {
      uint32_t code = codes[e * 3 + c];
      if (e >= count) {
        code = 0;
      } else if (e > 0 && info.transformed) {
        code = (codes[c] + static_cast<uint32_t>(SignExtend(code, info.delta_bits[c]))) & mask;
      }
      endpoints[e][c] =
          is_signed ? SignExtend(code, info.endpoint_bits) : static_cast<int32_t>(code);
    }
  }
  if (info.regions == 2) *partition = static_cast<int>(bits.Get(77, 5));
  return true;
}

void UnpackIndices(const Bits& bits, const ModeInfo& info, int partition, uint8_t indices[16]) {
  int position = info.regions == 2 ? 82 : 65;
  const int anchor = info.regions == 2 ? kAnchors[partition] : 0;
  for (int t = 0; t < 16; ++t) {
    const int count = info.index_bits - (t == 0 || t == anchor ? 1 : 0);
    indices[t] = static_cast<uint8_t>(bits.Get(position, count));
    position += count;
  }
}

bool CodeFits(int32_t code, int bits, bool is_signed) {
  const int32_t low = is_signed ? -(int32_t{1} << (bits - 1)) : 0;
  return code >= low && code < low + (int32_t{1} << bits);
}

std::string Place(int endpoint, int channel) {
  return "endpoint " + std::to_string(endpoint) + ", channel " + std::to_string(channel);
}

}  // namespace

const ModeInfo& Mode(int mode) {
  PATINA_CHECK(mode >= 0 && mode < kModeCount);
  return kModes[mode];
}

uint16_t PartitionMask(int partition) {
  PATINA_CHECK(partition >= 0 && partition < kPartitionCount);
  return kPartitions[partition];
}

int AnchorTexel(int partition) {
  PATINA_CHECK(partition >= 0 && partition < kPartitionCount);
  return kAnchors[partition];
}

Result<Block> Pack(const BlockFields& fields, Format format) {
  if (fields.mode < 0 || fields.mode >= kModeCount) {
    return Fail(ErrorCode::kOutOfRange,
                "BC6H mode " + std::to_string(fields.mode) + " is not in 0..13");
  }
  const ModeInfo& info = kModes[fields.mode];
  const bool two = info.regions == 2;
  if (fields.partition < 0 || fields.partition >= (two ? kPartitionCount : 1)) {
    return Fail(ErrorCode::kOutOfRange, "BC6H partition " + std::to_string(fields.partition) +
                                            " is not one of mode " + std::to_string(fields.mode));
  }
  const bool is_signed = format == Format::kSf16;
  uint32_t codes[12] = {};
  for (int e = 0; e < 2 * info.regions; ++e) {
    for (int c = 0; c < 3; ++c) {
      const int32_t code = fields.endpoints[e][c];
      if (!CodeFits(code, info.endpoint_bits, is_signed)) {
        return Fail(ErrorCode::kOutOfRange, "BC6H code " + std::to_string(code) + " of " +
                                                Place(e, c) + " does not fit " +
                                                std::to_string(info.endpoint_bits) + " bits");
      }
      int stored_bits = info.endpoint_bits;
      int32_t stored = code;
      if (e > 0 && info.transformed) {
        // The decoder adds modulo 2^endpoint_bits, so the delta is taken modulo that too.
        stored =
            SignExtend(static_cast<uint32_t>(code) - static_cast<uint32_t>(fields.endpoints[0][c]),
                       info.endpoint_bits);
        stored_bits = info.delta_bits[c];
        if (!CodeFits(stored, stored_bits, true)) {
          return Fail(ErrorCode::kOutOfRange, "BC6H delta " + std::to_string(stored) + " of " +
                                                  Place(e, c) + " does not fit " +
                                                  std::to_string(stored_bits) + " bits");
        }
      }
      codes[e * 3 + c] = static_cast<uint32_t>(stored) & ((uint32_t{1} << stored_bits) - 1);
    }
  }

  Bits bits;
  bits.Put(0, info.mode_bit_count, static_cast<uint32_t>(info.mode_bits));
  const Layout& layout = kTables.layouts[fields.mode];
  for (int i = 0; i < layout.count; ++i) {
    const Run& run = layout.runs[i];
    bits.Put(run.position, run.count, (codes[run.slot] >> run.low_bit) & ((1u << run.count) - 1));
  }
  if (two) bits.Put(77, 5, static_cast<uint32_t>(fields.partition));
  int position = two ? 82 : 65;
  const int anchor = two ? kAnchors[fields.partition] : 0;
  for (int t = 0; t < 16; ++t) {
    const int count = info.index_bits - (t == 0 || t == anchor ? 1 : 0);
    if (fields.indices[t] >= 1 << count) {
      return Fail(ErrorCode::kOutOfRange, "BC6H index " + std::to_string(fields.indices[t]) +
                                              " of texel " + std::to_string(t) + " does not fit " +
                                              std::to_string(count) + " bits");
    }
    bits.Put(position, count, fields.indices[t]);
    position += count;
  }
  Block block;
  StoreLittle64(block.data(), bits.low);
  StoreLittle64(block.data() + 8, bits.high);
  return block;
}

void FixAnchors(BlockFields* fields) {
  const ModeInfo& info = Mode(fields->mode);
  const int top = 1 << (info.index_bits - 1);
  for (int region = 0; region < info.regions; ++region) {
    const int anchor = region == 0 ? 0 : AnchorTexel(fields->partition);
    if (fields->indices[anchor] < top) continue;
    const int mask = info.regions == 2 ? PartitionMask(fields->partition) : 0;
    for (int c = 0; c < 3; ++c) {
      std::swap(fields->endpoints[2 * region][c], fields->endpoints[2 * region + 1][c]);
    }
    for (int t = 0; t < 16; ++t) {
      if (((mask >> t) & 1) == region)
        fields->indices[t] = static_cast<uint8_t>(2 * top - 1 - fields->indices[t]);
    }
  }
}

std::optional<BlockFields> Unpack(const uint8_t* block, Format format) {
  const Bits bits{LoadLittle64(block), LoadLittle64(block + 8)};
  BlockFields fields;
  if (!UnpackHead(bits, format, &fields.mode, &fields.partition, fields.endpoints))
    return std::nullopt;
  UnpackIndices(bits, kModes[fields.mode], fields.partition, fields.indices);
  return fields;
}

int32_t Unquantize(int32_t code, int bits, Format format) {
  if (format == Format::kUf16) {
    if (bits >= 15 || code == 0) return code;
    if (code == (1 << bits) - 1) return 0xFFFF;
    return ((code << 16) + 0x8000) >> bits;
  }
  if (bits >= 16 || code == 0) return code;
  const int32_t magnitude = code < 0 ? -code : code;
  const int32_t scaled =
      magnitude >= (1 << (bits - 1)) - 1 ? 0x7FFF : ((magnitude << 15) + 0x4000) >> (bits - 1);
  return code < 0 ? -scaled : scaled;
}

uint16_t FinishUnquantize(int32_t value, Format format) {
  if (format == Format::kUf16) return static_cast<uint16_t>((value * 31) >> 6);
  const int32_t magnitude = ((value < 0 ? -value : value) * 31) >> 5;
  // A negative value that scales to zero is a positive zero.
  return static_cast<uint16_t>(value < 0 && magnitude != 0 ? 0x8000 | magnitude : magnitude);
}

void Decode(const uint8_t* block, Format format, uint16_t texels[16][3]) {
  const Bits bits{LoadLittle64(block), LoadLittle64(block + 8)};
  int mode;
  int partition;
  int32_t endpoints[4][3];
  if (!UnpackHead(bits, format, &mode, &partition, endpoints)) {
    for (int t = 0; t < 16; ++t) texels[t][0] = texels[t][1] = texels[t][2] = 0;
    return;
  }
  const ModeInfo& info = kModes[mode];
  uint8_t indices[16];
  UnpackIndices(bits, info, partition, indices);

  const int levels = 1 << info.index_bits;
  const int* weights = info.index_bits == 3 ? kWeights3.data() : kWeights4.data();
  uint16_t palette[2][16][3];
  for (int region = 0; region < info.regions; ++region) {
    for (int c = 0; c < 3; ++c) {
      const int32_t a = Unquantize(endpoints[2 * region][c], info.endpoint_bits, format);
      const int32_t b = Unquantize(endpoints[2 * region + 1][c], info.endpoint_bits, format);
      for (int i = 0; i < levels; ++i) {
        palette[region][i][c] = FinishUnquantize(Interpolate(a, b, weights[i]), format);
      }
    }
  }
  const int mask = info.regions == 2 ? kPartitions[partition] : 0;
  for (int t = 0; t < 16; ++t) {
    const uint16_t* color = palette[(mask >> t) & 1][indices[t]];
    texels[t][0] = color[0];
    texels[t][1] = color[1];
    texels[t][2] = color[2];
  }
}

}  // namespace patina::bc6h
