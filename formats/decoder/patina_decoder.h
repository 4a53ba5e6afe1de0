// Reference decoder of Patina containers of kind "material": (u, v, s) -> the values of all
// channels.
//
// One header, C++17, needs only the standard library and nlohmann/json: copy it into a renderer. It
// reads what FORMATS.md describes and shares no code with the rest of Patina.
//
//   using patina::Decoder;
//   Decoder material;
//   std::string problem;
//   if (Decoder::Load("out/cobblestone", &material, &problem) != Decoder::LoadStatus::kOk) return;
//   std::vector<float> values(material.channels().size());
//   material.Physical(0.25, 0.75, 1.5, values.data());
//
// A loaded decoder is immutable: all its const members may be called from many threads at once.
// Load does not throw.
//
// Results are the same to the bit for every compiler, vectoriser and path (single samples and whole
// mips), as long as the compiler neither fuses multiplications with additions nor reorders:
// -ffp-contract=off and no -ffast-math.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace patina {
namespace decoder_detail {

// ---- BC6H (Direct3D 11 functional specification) ----

struct Bc6hMode {
  int mode_bits;
  bool two_regions;
  bool deltas;  // endpoints 1..3 are stored relative to endpoint 0
  int bits;     // of endpoint 0, and of all once deltas are added
  int delta_bits[3];
  // Stored bits after the mode bits: colour, endpoint, [high:low]; [10:15] stores bit 15 first.
  const char* layout;
};

inline const std::array<Bc6hMode, 14>& Bc6hModes() {
  // clang-format off
  static const std::array<Bc6hMode, 14> modes = {{
      {0x00, true, true, 10, {5, 5, 5},
       "g2[4]b2[4]b3[4]r0[9:0]g0[9:0]b0[9:0]r1[4:0]g3[4]g2[3:0]g1[4:0]b3[0]g3[3:0]b1[4:0]b3[1]"
       "b2[3:0]r2[4:0]b3[2]r3[4:0]b3[3]"},
      {0x01, true, true, 7, {6, 6, 6},
       "g2[5]g3[4]g3[5]r0[6:0]b3[0]b3[1]b2[4]g0[6:0]b2[5]b3[2]g2[4]b0[6:0]b3[3]b3[5]b3[4]r1[5:0]"
       "g2[3:0]g1[5:0]g3[3:0]b1[5:0]b2[3:0]r2[5:0]r3[5:0]"},
      {0x02, true, true, 11, {5, 4, 4},
       "r0[9:0]g0[9:0]b0[9:0]r1[4:0]r0[10]g2[3:0]g1[3:0]g0[10]b3[0]g3[3:0]b1[3:0]b0[10]b3[1]"
       "b2[3:0]r2[4:0]b3[2]r3[4:0]b3[3]"},
      {0x06, true, true, 11, {4, 5, 4},
       "r0[9:0]g0[9:0]b0[9:0]r1[3:0]r0[10]g3[4]g2[3:0]g1[4:0]g0[10]g3[3:0]b1[3:0]b0[10]b3[1]"
       "b2[3:0]r2[3:0]b3[0]b3[2]r3[3:0]g2[4]b3[3]"},
      {0x0A, true, true, 11, {4, 4, 5},
       "r0[9:0]g0[9:0]b0[9:0]r1[3:0]r0[10]b2[4]g2[3:0]g1[3:0]g0[10]b3[0]g3[3:0]b1[4:0]b0[10]"
       "b2[3:0]r2[3:0]b3[1]b3[2]r3[3:0]b3[4]b3[3]"},
      {0x0E, true, true, 9, {5, 5, 5},
       "r0[8:0]b2[4]g0[8:0]g2[4]b0[8:0]b3[4]r1[4:0]g3[4]g2[3:0]g1[4:0]b3[0]g3[3:0]b1[4:0]b3[1]"
       "b2[3:0]r2[4:0]b3[2]r3[4:0]b3[3]"},
      {0x12, true, true, 8, {6, 5, 5},
       "r0[7:0]g3[4]b2[4]g0[7:0]b3[2]g2[4]b0[7:0]b3[3]b3[4]r1[5:0]g2[3:0]g1[4:0]b3[0]g3[3:0]"
       "b1[4:0]b3[1]b2[3:0]r2[5:0]r3[5:0]"},
      {0x16, true, true, 8, {5, 6, 5},
       "r0[7:0]b3[0]b2[4]g0[7:0]g2[5]g2[4]b0[7:0]g3[5]b3[4]r1[4:0]g3[4]g2[3:0]g1[5:0]g3[3:0]"
       "b1[4:0]b3[1]b2[3:0]r2[4:0]b3[2]r3[4:0]b3[3]"},
      {0x1A, true, true, 8, {5, 5, 6},
       "r0[7:0]b3[1]b2[4]g0[7:0]b2[5]g2[4]b0[7:0]b3[5]b3[4]r1[4:0]g3[4]g2[3:0]g1[4:0]b3[0]"
       "g3[3:0]b1[5:0]b2[3:0]r2[4:0]b3[2]r3[4:0]b3[3]"},
      {0x1E, true, false, 6, {6, 6, 6},
       "r0[5:0]g3[4]b3[0]b3[1]b2[4]g0[5:0]g2[5]b2[5]b3[2]g2[4]b0[5:0]g3[5]b3[3]b3[5]b3[4]r1[5:0]"
       "g2[3:0]g1[5:0]g3[3:0]b1[5:0]b2[3:0]r2[5:0]r3[5:0]"},
      {0x03, false, false, 10, {10, 10, 10}, "r0[9:0]g0[9:0]b0[9:0]r1[9:0]g1[9:0]b1[9:0]"},
      {0x07, false, true, 11, {9, 9, 9},
       "r0[9:0]g0[9:0]b0[9:0]r1[8:0]r0[10]g1[8:0]g0[10]b1[8:0]b0[10]"},
      {0x0B, false, true, 12, {8, 8, 8},
       "r0[9:0]g0[9:0]b0[9:0]r1[7:0]r0[10:11]g1[7:0]g0[10:11]b1[7:0]b0[10:11]"},
      {0x0F, false, true, 16, {4, 4, 4},
       "r0[9:0]g0[9:0]b0[9:0]r1[3:0]r0[10:15]g1[3:0]g0[10:15]b1[3:0]b0[10:15]"},
  }};
  // clang-format on
  return modes;
}

// One stored bit of an endpoint code.
struct Bc6hBit {
  uint8_t slot;  // endpoint * 3 + colour
  uint8_t bit;
};

// The layouts of Bc6hModes, one entry for each bit after the mode bits.
inline const std::array<std::vector<Bc6hBit>, 14>& Bc6hBits() {
  static const std::array<std::vector<Bc6hBit>, 14> all = [] {
    std::array<std::vector<Bc6hBit>, 14> result;
    for (size_t mode = 0; mode < result.size(); ++mode) {
      for (const char* text = Bc6hModes()[mode].layout; *text != '\0'; ++text) {
        const int color = text[0] == 'r' ? 0 : text[0] == 'g' ? 1 : 2;
        const auto slot = static_cast<uint8_t>((text[1] - '0') * 3 + color);
        int bounds[2] = {0, -1};
        int bound = 0;
        for (text += 3; *text != ']'; ++text) {
          if (*text == ':') {
            bounds[++bound] = 0;
          } else {
            bounds[bound] = bounds[bound] * 10 + (*text - '0');
          }
        }
        const int last = bound == 0 ? bounds[0] : bounds[1];
        const int step =
            bounds[0] <= last ? 1 : -1;  // the run is stored from its second number to its first
        for (int bit = last; bit != bounds[0] - step; bit -= step) {
          result[mode].push_back({slot, static_cast<uint8_t>(bit)});
        }
      }
    }
    return result;
  }();
  return all;
}

class BitReader {
 public:
  explicit BitReader(const uint8_t* bytes) : bytes_(bytes) {}
  int Next() {
    const int bit = (bytes_[position_ >> 3] >> (position_ & 7)) & 1;
    ++position_;
    return bit;
  }
  int Next(int count) {
    int value = 0;
    for (int i = 0; i < count; ++i) value |= Next() << i;
    return value;
  }

 private:
  const uint8_t* bytes_;
  int position_ = 0;
};

inline int Extend(int value, int bits) {
  const int sign = 1 << (bits - 1);
  return ((value & ((sign << 1) - 1)) ^ sign) - sign;
}

inline int Bc6hUnquantize(int code, int bits, bool is_signed) {
  if (!is_signed) {
    if (bits >= 15 || code == 0) return code;
    return code == (1 << bits) - 1 ? 0xFFFF : ((code << 16) + 0x8000) >> bits;
  }
  if (bits >= 16 || code == 0) return code;
  const int magnitude = std::abs(code);
  const int scaled =
      magnitude >= (1 << (bits - 1)) - 1 ? 0x7FFF : ((magnitude << 15) + 0x4000) >> (bits - 1);
  return code < 0 ? -scaled : scaled;
}

inline uint16_t Bc6hFinish(int value, bool is_signed) {
  if (!is_signed) return static_cast<uint16_t>((value * 31) >> 6);
  const int magnitude = (std::abs(value) * 31) >> 5;
  return static_cast<uint16_t>(value < 0 && magnitude != 0 ? 0x8000 | magnitude : magnitude);
}

// Decodes a block to the bits of halves, row-major; the reserved modes give zeros.
inline void DecodeBc6h(const uint8_t* block, bool is_signed, uint16_t texels[16][3]) {
  static constexpr uint16_t kPartitions[32] = {
      0xCCCC, 0x8888, 0xEEEE, 0xECC8, 0xC880, 0xFEEC, 0xFEC8, 0xEC80, 0xC800, 0xFFEC, 0xFE80,
      0xE800, 0xFFE8, 0xFF00, 0xFFF0, 0xF000, 0xF710, 0x008E, 0x7100, 0x08CE, 0x008C, 0x7310,
      0x3100, 0x8CCE, 0x088C, 0x3110, 0x6666, 0x366C, 0x17E8, 0x0FF0, 0x718E, 0x399C};
  static constexpr uint8_t kAnchors[32] = {15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15,
                                           15, 15, 15, 15, 15, 15, 2,  8,  2,  2,  8,
                                           8,  15, 2,  8,  2,  2,  8,  8,  2,  2};
  static constexpr int kWeights3[8] = {0, 9, 18, 27, 37, 46, 55, 64};
  static constexpr int kWeights4[16] = {0,  4,  9,  13, 17, 21, 26, 30,
                                        34, 38, 43, 47, 51, 55, 60, 64};

  BitReader reader(block);
  int mode_bits = reader.Next(2);
  if (mode_bits > 1) mode_bits |= reader.Next(3) << 2;
  const auto& modes = Bc6hModes();
  const auto found = std::find_if(modes.begin(), modes.end(), [&](const Bc6hMode& mode) {
    return mode.mode_bits == mode_bits;
  });
  if (found == modes.end()) {
    for (int t = 0; t < 16; ++t) texels[t][0] = texels[t][1] = texels[t][2] = 0;
    return;
  }
  const Bc6hMode& mode = *found;
  int codes[12] = {};
  for (const Bc6hBit& stored : Bc6hBits()[static_cast<size_t>(found - modes.begin())]) {
    codes[stored.slot] |= reader.Next() << stored.bit;
  }
  for (int slot = 0; slot < 12; ++slot) {
    if (slot >= 3 && mode.deltas) {
      codes[slot] = (codes[slot % 3] + Extend(codes[slot], mode.delta_bits[slot % 3])) &
                    ((1 << mode.bits) - 1);
    }
  }
  int ends[12];
  for (int slot = 0; slot < 12; ++slot) {
    const int code = is_signed ? Extend(codes[slot], mode.bits) : codes[slot];
    ends[slot] = Bc6hUnquantize(code, mode.bits, is_signed);
  }
  const int partition = mode.two_regions ? reader.Next(5) : 0;
  const int mask = mode.two_regions ? kPartitions[partition] : 0;
  const int anchor = mode.two_regions ? kAnchors[partition] : 0;
  const int index_bits = mode.two_regions ? 3 : 4;
  for (int t = 0; t < 16; ++t) {
    const int index = reader.Next(t == 0 || t == anchor ? index_bits - 1 : index_bits);
    const int weight = mode.two_regions ? kWeights3[index] : kWeights4[index];
    const int* a = ends + ((mask >> t) & 1) * 6;
    for (int c = 0; c < 3; ++c) {
      texels[t][c] = Bc6hFinish((a[c] * (64 - weight) + a[c + 3] * weight + 32) >> 6, is_signed);
    }
  }
}

// ---- Bytes ----

inline float HalfToFloat(uint16_t half) {
  const int exponent = (half >> 10) & 31;
  const int mantissa = half & 0x3FF;
  const float magnitude = exponent == 0
                              ? std::ldexp(static_cast<float>(mantissa), -24)
                              : std::ldexp(static_cast<float>(1024 + mantissa), exponent - 25);
  return (half & 0x8000) != 0 ? -magnitude : magnitude;
}

// The values of all halves, by their bits.
inline const std::vector<float>& HalfValues() {
  static const std::vector<float> values = [] {
    std::vector<float> table(65536);
    for (size_t half = 0; half < table.size(); ++half)
      table[half] = HalfToFloat(static_cast<uint16_t>(half));
    return table;
  }();
  return values;
}

inline bool HalfIsFinite(uint16_t half) { return (half & 0x7C00) != 0x7C00; }

inline uint32_t Load32(const std::string& bytes, size_t offset) {
  uint32_t value = 0;
  for (int i = 3; i >= 0; --i)
    value = value << 8 | static_cast<uint8_t>(bytes[offset + static_cast<size_t>(i)]);
  return value;
}

// CRC-32 of zlib and PNG, taking bytes [skip, skip + 4) for zeros.
inline uint32_t Crc32(const std::string& bytes, size_t skip) {
  uint32_t crc = 0xFFFFFFFFu;
  for (size_t i = 0; i < bytes.size(); ++i) {
    crc ^= i >= skip && i < skip + 4 ? 0u : static_cast<uint8_t>(bytes[i]);
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? (crc >> 1) ^ 0xEDB88320u : crc >> 1;
  }
  return ~crc;
}

inline int LevelSide(int side, int level) { return std::max(1, level < 31 ? side >> level : 0); }

// ---- Sampling ----

// A linear interpolation between two texels of a row or column: a * (1 - f) + b * f.
struct Tap {
  int a;
  int b;
  float f;
};

// `coordinate` is u or v; texel centres lie at half integers of coordinate * side.
inline Tap MakeTap(double coordinate, int side, bool wrap) {
  if (!std::isfinite(coordinate)) coordinate = 0;
  coordinate =
      wrap ? coordinate - std::floor(coordinate) : std::min(1.0, std::max(0.0, coordinate));
  const double position = coordinate * side - 0.5;
  const double low = std::floor(position);
  const int a = static_cast<int>(low);
  const auto address = [&](int texel) {
    return wrap ? (texel + side) % side : std::min(side - 1, std::max(0, texel));
  };
  return {address(a), address(a + 1), static_cast<float>(position - low)};
}

inline float Mix(float a, float b, float f) { return a * (1.0f - f) + b * f; }

// Four floats: a register where the compiler has a word for it. Same results either way.
struct Float4 {
#if defined(__GNUC__)
  typedef float Lanes __attribute__((vector_size(16)));
  Lanes v;
  static Float4 All(float value) { return {Lanes{value, value, value, value}}; }
  void AddProduct(Float4 a, Float4 b) { v = v + a.v * b.v; }
#else
  float v[4];
  static Float4 All(float value) { return {{value, value, value, value}}; }
  void AddProduct(Float4 a, Float4 b) {
    for (int lane = 0; lane < 4; ++lane) v[lane] = v[lane] + a.v[lane] * b.v[lane];
  }
#endif
  static Float4 Load(const float* from) {
    Float4 result;
    std::memcpy(&result.v, from, sizeof result.v);
    return result;
  }
  void Store(float* to) const { std::memcpy(to, &v, sizeof v); }
};

struct TextureLevel {
  int width = 0;
  int height = 0;
  std::vector<float> texels;  // [channel][y][x]

  const float* Row(int channel, int y) const {
    return texels.data() +
           (static_cast<size_t>(channel) * static_cast<size_t>(height) + static_cast<size_t>(y)) *
               static_cast<size_t>(width);
  }
};

struct Texture {
  int lod_bias = 0;
  std::vector<TextureLevel> levels;
};

// ---- JSON without exceptions ----

// A member of an object, or null.
inline const nlohmann::json& Member(const nlohmann::json& object, const char* key) {
  static const nlohmann::json none;
  if (!object.is_object()) return none;
  const auto found = object.find(key);
  return found == object.end() ? none : *found;
}

inline std::string Text(const nlohmann::json& value) {
  return value.is_string() ? value.get_ref<const std::string&>() : std::string();
}

// An integer within bounds, or `min - 1`.
inline int Integer(const nlohmann::json& value, int min, int max) {
  if (!value.is_number_integer()) return min - 1;
  if (value.is_number_unsigned() && value.get<uint64_t>() > static_cast<uint64_t>(INT32_MAX))
    return min - 1;
  const auto number = value.get<int64_t>();
  return number < min || number > max ? min - 1 : static_cast<int>(number);
}

// A number that is finite as a float, or NaN.
inline float Real(const nlohmann::json& value) {
  if (!value.is_number()) return std::nanf("");
  const auto number = static_cast<float>(value.get<double>());
  return std::isfinite(number) ? number : std::nanf("");
}

}  // namespace decoder_detail

class Decoder {
 public:
  enum class LoadStatus {
    kOk,
    kNotFound,     // a file is missing or cannot be read
    kCorrupt,      // a file is not what its format says
    kUnsupported,  // a newer version, or a feature this decoder does not have
    kNoMemory
  };

  // How a coded value relates to the physical one.
  enum class Encoding {
    kLinear,     // physical = coded * scale
    kSrgb,       // physical = linear value of an sRGB-coded one, of the working space
    kSignedLog,  // physical = scale * sign(coded) * (2^|coded| - 1), of the working space
    kNormalXy  // physical = 2 * coded - 1: x or y of a unit normal in tangent space, OpenGL (Y up);
               // see NormalZ
  };

  struct Channel {
    std::string map;        // "albedo", "normal", "roughness", ...
    std::string component;  // "r", "g", "b", "x", "y" or ""
    Encoding encoding = Encoding::kLinear;
    float scale = 1;  // of kLinear and kSignedLog
    float min = 0;    // coded values are clamped to [min, max]
    float max = 1;
    int output = -1;     // of the network, which equal channels share, or -1: constant
    float constant = 0;  // coded
  };

  static constexpr int kMaxTextures = 16;
  static constexpr int kMaxHidden = 256;
  static constexpr int kMaxOutputs = 256;
  static constexpr int kMaxSide = 65536;

  // Reads a container: `path` is a revision's directory or the directory of an asset with a
  // `current` revision. On failure `decoder` is unchanged and `message` names the file and the
  // reason. The checksum of the weights is checked, the SHA-256 sums of the manifest are not.
  static LoadStatus Load(const std::string& path, Decoder* decoder, std::string* message) {
    Decoder loaded;
    Failure failure;
#if defined(__cpp_exceptions)
    // Only the standard library throws below, and only for lack of memory.
    try {
#endif
      loaded.LoadAll(path, &failure);
#if defined(__cpp_exceptions)
    } catch (const std::exception& error) {
      failure.Set(LoadStatus::kNoMemory, path + ": " + error.what());
    }
#endif
    if (failure.status == LoadStatus::kOk) *decoder = std::move(loaded);
    *message = failure.message;
    return failure.status;
  }

  int width() const { return width_; }  // of mip 0, texels
  int height() const { return height_; }
  int levels() const { return levels_; }  // of the chain down to 1x1
  int outputs() const { return outputs_; }
  bool wraps() const { return wrap_; }
  // Primaries of physical colours: "lin_rec709" or "acescg".
  const std::string& working_space() const { return working_space_; }
  const std::vector<Channel>& channels() const { return channels_; }
  int MipWidth(int level) const { return decoder_detail::LevelSide(width_, level); }
  int MipHeight(int level) const { return decoder_detail::LevelSide(height_, level); }

  // Coded values of all channels at texture coordinates u, v (any finite numbers; 0..1 spans the
  // texture, v downwards) and level of detail s in mips of the source (0: full resolution).
  // out[channels().size()].
  void Coded(double u, double v, double s, float* out) const {
    float inputs[3 * kMaxTextures];
    float outputs[kMaxOutputs];
    for (size_t i = 0; i < textures_.size(); ++i)
      SampleTexture(textures_[i], u, v, s, inputs + 3 * i);
    Evaluate<1>(inputs, outputs);
    for (size_t c = 0; c < channels_.size(); ++c) {
      out[c] = channels_[c].output < 0 ? channels_[c].constant : outputs[channels_[c].output];
    }
  }

  // Physical values, in the order of channels(): see Encoding.
  void Physical(double u, double v, double s, float* out) const {
    Coded(u, v, s, out);
    for (size_t c = 0; c < channels_.size(); ++c) out[c] = ToPhysical(channels_[c], out[c]);
  }

  static float ToPhysical(const Channel& channel, float coded) {
    switch (channel.encoding) {
      case Encoding::kSrgb:
        return coded <= 0.04045f ? coded / 12.92f : std::pow((coded + 0.055f) / 1.055f, 2.4f);
      case Encoding::kNormalXy:
        return 2.0f * coded - 1.0f;
      case Encoding::kSignedLog:
        return std::copysign(channel.scale * (std::exp2(std::fabs(coded)) - 1.0f), coded);
      case Encoding::kLinear:
        break;
    }
    return coded * channel.scale;
  }

  // The third component of a normal from the physical values of the first two.
  static float NormalZ(float x, float y) { return std::sqrt(std::max(0.0f, 1.0f - x * x - y * y)); }

  // Coded values of the network's outputs on the texel centres of rows [y_begin, y_end) of a mip,
  // the same to the bit as Coded at ((x + 0.5) / MipWidth, (y + 0.5) / MipHeight, level): out[o *
  // plane + (y - y_begin) * MipWidth(level) + x]. 0 <= level < levels(); plane >= rows *
  // MipWidth(level).
  void DecodeRows(int level, int y_begin, int y_end, float* out, size_t plane) const {
    using namespace decoder_detail;
    if (textures_.empty()) return;
    const int mip_width = MipWidth(level);
    const int mip_height = MipHeight(level);
    std::vector<RowSampler> samplers;
    for (const Texture& texture : textures_) {
      const int top = static_cast<int>(texture.levels.size()) - 1;
      const int texture_level = std::min(top, std::max(0, level + texture.lod_bias));
      samplers.emplace_back(texture.levels[static_cast<size_t>(texture_level)], mip_width, wrap_);
    }
    alignas(64) float inputs[3 * kMaxTextures * kLanes];
    alignas(64) float outputs[kMaxOutputs * kLanes];
    for (int y = y_begin; y < y_end; ++y) {
      for (RowSampler& sampler : samplers) sampler.SetRow((y + 0.5) / mip_height, wrap_);
      float* row = out + static_cast<size_t>(y - y_begin) * static_cast<size_t>(mip_width);
      for (int x = 0; x < mip_width; x += kLanes) {
        for (size_t i = 0; i < samplers.size(); ++i) samplers[i].Sample(x, inputs + i * 3 * kLanes);
        Evaluate<kLanes>(inputs, outputs);
        const size_t bytes = static_cast<size_t>(std::min(kLanes, mip_width - x)) * sizeof(float);
        for (int o = 0; o < outputs_; ++o) {
          std::memcpy(row + static_cast<size_t>(o) * plane + x, outputs + o * kLanes, bytes);
        }
      }
    }
  }

  // Coded values of all channels, constants included, on the texel centres of a mip:
  // [channel][y][x].
  std::vector<float> DecodeMip(int level) const {
    const size_t plane =
        static_cast<size_t>(MipWidth(level)) * static_cast<size_t>(MipHeight(level));
    std::vector<float> learned(plane * static_cast<size_t>(outputs_));
    DecodeRows(level, 0, MipHeight(level), learned.data(), plane);
    std::vector<float> all(plane * channels_.size());
    for (size_t c = 0; c < channels_.size(); ++c) {
      float* out = all.data() + c * plane;
      if (channels_[c].output < 0) {
        std::fill(out, out + plane, channels_[c].constant);
      } else {
        std::memcpy(out, learned.data() + static_cast<size_t>(channels_[c].output) * plane,
                    plane * sizeof(float));
      }
    }
    return all;
  }

 private:
  friend class SvbrdfDecoder;  // whose neural texture is one of this kind

  static constexpr int kLanes = 16;

  struct Failure {
    LoadStatus status = LoadStatus::kOk;
    std::string message;
    // Keeps the first. Returns false, so that a check can end with it.
    bool Set(LoadStatus new_status, const std::string& text) {
      if (status == LoadStatus::kOk) {
        status = new_status;
        message = text;
      }
      return false;
    }
  };

  // One texture level along a row of a mip: rows are mixed once, then texels.
  class RowSampler {
   public:
    RowSampler(const decoder_detail::TextureLevel& level, int mip_width, bool wrap)
        : level_(&level) {
      // Padded so that the last batch reads no further than it may.
      const int padded = (mip_width + kLanes - 1) / kLanes * kLanes;
      same_width_ = level.width == mip_width;
      for (int x = 0; x < padded; ++x) {
        const auto tap = decoder_detail::MakeTap((std::min(x, mip_width - 1) + 0.5) / mip_width,
                                                 level.width, wrap);
        a_.push_back(tap.a);
        b_.push_back(tap.b);
        f_.push_back(tap.f);
        g_.push_back(1.0f - tap.f);
        same_width_ = same_width_ && tap.f == 0.0f;
      }
      for (auto& row : rows_)
        row.resize(static_cast<size_t>(std::max(level.width, same_width_ ? padded : 0)));
    }

    void SetRow(double v, bool wrap) {
      const auto tap = decoder_detail::MakeTap(v, level_->height, wrap);
      const float f = tap.f;
      const float g = 1.0f - f;
      for (int c = 0; c < 3; ++c) {
        const float* a = level_->Row(c, tap.a);
        const float* b = level_->Row(c, tap.b);
        float* row = rows_[static_cast<size_t>(c)].data();
        for (int x = 0; x < level_->width; ++x) row[x] = a[x] * g + b[x] * f;
      }
    }

    // inputs[channel * kLanes + lane] for mip texels x .. x + kLanes - 1
    void Sample(int x, float* inputs) const {
      for (size_t c = 0; c < 3; ++c) {
        const float* row = rows_[c].data();
        float* to = inputs + c * kLanes;
        if (same_width_) {
          std::memcpy(to, row + x, kLanes * sizeof(float));
          continue;
        }
        const int* a = a_.data() + x;
        const int* b = b_.data() + x;
        const float* f = f_.data() + x;
        const float* g = g_.data() + x;
        float from_a[kLanes];
        float from_b[kLanes];
        for (int lane = 0; lane < kLanes; ++lane) {
          from_a[lane] = row[a[lane]];
          from_b[lane] = row[b[lane]];
        }
        for (int lane = 0; lane < kLanes; ++lane)
          to[lane] = from_a[lane] * g[lane] + from_b[lane] * f[lane];
      }
    }

   private:
    const decoder_detail::TextureLevel* level_;
    bool same_width_ = false;  // texel x of the level lies on texel x of the mip
    std::vector<int> a_, b_;
    std::vector<float> f_, g_;
    std::array<std::vector<float>, 3> rows_;
  };

  // Trilinear: bilinear in the two nearest levels, then between them.
  void SampleTexture(const decoder_detail::Texture& texture, double u, double v, double s,
                     float* rgb) const {
    const double top = static_cast<double>(texture.levels.size()) - 1;
    if (!std::isfinite(s)) s = 0;
    const double level = std::min(top, std::max(0.0, s + texture.lod_bias));
    const double low = std::floor(level);
    const auto f = static_cast<float>(level - low);
    SampleLevel(texture.levels[static_cast<size_t>(low)], u, v, rgb);
    if (f == 0.0f) return;
    float above[3];
    SampleLevel(texture.levels[static_cast<size_t>(low) + 1], u, v, above);
    for (int c = 0; c < 3; ++c) rgb[c] = decoder_detail::Mix(rgb[c], above[c], f);
  }

  void SampleLevel(const decoder_detail::TextureLevel& level, double u, double v,
                   float* rgb) const {
    using decoder_detail::Mix;
    const auto x = decoder_detail::MakeTap(u, level.width, wrap_);
    const auto y = decoder_detail::MakeTap(v, level.height, wrap_);
    for (int c = 0; c < 3; ++c) {
      const float* a = level.Row(c, y.a);
      const float* b = level.Row(c, y.b);
      rgb[c] = Mix(Mix(a[x.a], b[x.a], y.f), Mix(a[x.b], b[x.b], y.f), x.f);
    }
  }

  // The network for N samples (1 or kLanes), [feature][sample] in and out, and the clamp to the
  // channels' ranges. Every sum runs in the order of its index, from the bias.
  template <int N>
  void Evaluate(const float* inputs, float* outputs) const {
    alignas(64) float hidden[kMaxHidden * N];
    Layer(w1_.data(), b1_.data(), inputs, inputs_, hidden, hidden_, Samples<N>());
    for (int i = 0; i < hidden_ * N; ++i) hidden[i] = hidden[i] < 0.0f ? 0.0f : hidden[i];
    Layer(w2_.data(), b2_.data(), hidden, hidden_, outputs, outputs_, Samples<N>());
    for (int o = 0; o < outputs_; ++o) {
      const float low = output_min_[static_cast<size_t>(o)];
      const float high = output_max_[static_cast<size_t>(o)];
      float* y = outputs + o * N;
      for (int lane = 0; lane < N; ++lane)
        y[lane] = y[lane] < low ? low : y[lane] > high ? high : y[lane];
    }
  }

  template <int N>
  struct Samples {};

  // y[o][lane] = biases[o] + sum_i weights[o][i] * x[i][lane]
  static void Layer(const float* weights, const float* biases, const float* x, int inputs, float* y,
                    int outputs, Samples<1>) {
    for (int o = 0; o < outputs; ++o) {
      float sum = biases[o];
      for (int i = 0; i < inputs; ++i) sum += weights[o * inputs + i] * x[i];
      y[o] = sum;
    }
  }

  // Two outputs at a time, so that each load of x serves twice; the last one alone if their number
  // is odd.
  static void Layer(const float* weights, const float* biases, const float* x, int inputs, float* y,
                    int outputs, Samples<kLanes>) {
    using decoder_detail::Float4;
    for (int o = 0; o < outputs; o += 2) {
      const int second = std::min(o + 1, outputs - 1);
      const float* wa = weights + o * inputs;
      const float* wb = weights + second * inputs;
      Float4 a0 = Float4::All(biases[o]), a1 = a0, a2 = a0, a3 = a0;
      Float4 b0 = Float4::All(biases[second]), b1 = b0, b2 = b0, b3 = b0;
      for (int i = 0; i < inputs; ++i) {
        const float* from = x + i * kLanes;
        const Float4 x0 = Float4::Load(from), x1 = Float4::Load(from + 4);
        const Float4 x2 = Float4::Load(from + 8), x3 = Float4::Load(from + 12);
        const Float4 a = Float4::All(wa[i]), b = Float4::All(wb[i]);
        a0.AddProduct(a, x0), a1.AddProduct(a, x1), a2.AddProduct(a, x2), a3.AddProduct(a, x3);
        b0.AddProduct(b, x0), b1.AddProduct(b, x1), b2.AddProduct(b, x2), b3.AddProduct(b, x3);
      }
      float* to = y + second * kLanes;
      b0.Store(to), b1.Store(to + 4), b2.Store(to + 8), b3.Store(to + 12);
      to = y + o * kLanes;
      a0.Store(to), a1.Store(to + 4), a2.Store(to + 8), a3.Store(to + 12);
    }
  }

  static bool ReadFile(const std::string& path, uint64_t max_bytes, std::string* bytes,
                       Failure* failure) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    const std::streamoff size = file ? static_cast<std::streamoff>(file.tellg()) : -1;
    if (size < 0) return failure->Set(LoadStatus::kNotFound, path + ": cannot be read");
    if (static_cast<uint64_t>(size) > max_bytes) {
      return failure->Set(LoadStatus::kCorrupt, path + ": " + std::to_string(size) +
                                                    " bytes, expected at most " +
                                                    std::to_string(max_bytes));
    }
    bytes->resize(static_cast<size_t>(size));
    file.seekg(0);
    file.read(&(*bytes)[0], size);
    if (file.gcount() != size)
      return failure->Set(LoadStatus::kNotFound, path + ": cannot be read");
    return true;
  }

  bool LoadAll(const std::string& path, Failure* failure) {
    std::string directory = path;
    if (!std::ifstream(directory + "/manifest.json")) directory += "/current";
    const std::string manifest_path = directory + "/manifest.json";
    std::string text;
    if (!ReadFile(manifest_path, uint64_t{8} << 20, &text, failure)) return false;
    const nlohmann::json manifest = nlohmann::json::parse(text, nullptr, false);
    std::string network_payload;
    const nlohmann::json* features = nullptr;
    if (!ReadManifest(manifest, manifest_path, &network_payload, &features, failure)) return false;
    if (!network_payload.empty() && !ReadWeights(directory + "/" + network_payload, failure))
      return false;
    for (const nlohmann::json& feature : *features) {
      if (!ReadTexture(feature, directory, manifest_path, false, failure)) return false;
    }
    return true;
  }

  // A name without a path in it.
  static bool IsPlainName(const std::string& name) {
    return !name.empty() && name[0] != '.' && name.find_first_of("/\\") == std::string::npos &&
           name.find('\0') == std::string::npos;
  }

  bool ReadManifest(const nlohmann::json& manifest, const std::string& path,
                    std::string* network_payload, const nlohmann::json** features,
                    Failure* failure) {
    using namespace decoder_detail;
    const auto corrupt = [&](const std::string& text) {
      return failure->Set(LoadStatus::kCorrupt, path + ": " + text);
    };
    const auto unsupported = [&](const std::string& text) {
      return failure->Set(LoadStatus::kUnsupported, path + ": " + text);
    };
    if (!manifest.is_object()) return corrupt("not a JSON object");
    if (Text(Member(manifest, "format")) != "patina-container")
      return corrupt("/format is not \"patina-container\"");
    const int version = Integer(Member(manifest, "format_version"), 1, INT32_MAX);
    if (version < 1) return corrupt("/format_version is not a positive integer");
    if (version > 2) return unsupported("/format_version is newer than this decoder");
    if (Text(Member(manifest, "kind")) != "material")
      return unsupported("/kind is not \"material\"");
    const nlohmann::json& source = Member(manifest, "source");
    width_ = Integer(Member(source, "width"), 1, kMaxSide);
    height_ = Integer(Member(source, "height"), 1, kMaxSide);
    if (width_ < 1 || height_ < 1) return corrupt("/source has no legal width and height");
    levels_ = 1;
    for (int side = std::max(width_, height_); side > 1; side >>= 1) ++levels_;
    const std::string address = Text(Member(source, "address"));
    if (address != "wrap" && address != "clamp")
      return unsupported("/source/address is neither wrap nor clamp");
    wrap_ = address == "wrap";
    working_space_ = Text(Member(Member(manifest, "color"), "working_space"));
    if (working_space_ != "lin_rec709" && working_space_ != "acescg")
      return unsupported("/color/working_space is neither lin_rec709 nor acescg");

    *features = &Member(manifest, "features");
    if (!(*features)->is_array() || (*features)->size() > static_cast<size_t>(kMaxTextures)) {
      return corrupt("/features is not an array of at most 16 textures");
    }
    const nlohmann::json& network = Member(manifest, "network");
    if (network.is_object()) {
      inputs_ = Integer(Member(network, "inputs"), 1, 3 * kMaxTextures);
      hidden_ = Integer(Member(network, "hidden"), 1, kMaxHidden);
      outputs_ = Integer(Member(network, "outputs"), 1, kMaxOutputs);
      *network_payload = Text(Member(network, "payload"));
      if (hidden_ < 1 || outputs_ < 1 || !IsPlainName(*network_payload))
        return corrupt("/network is not legal");
      if (Text(Member(network, "activation")) != "relu")
        return unsupported("/network/activation is not relu");
    }
    if (inputs_ != 3 * static_cast<int>((*features)->size())) {
      return corrupt("/network/inputs is not three for each feature texture");
    }
    return ReadChannels(Member(manifest, "channels"), path, failure);
  }

  bool ReadChannels(const nlohmann::json& channels, const std::string& path, Failure* failure) {
    using namespace decoder_detail;
    output_min_.assign(static_cast<size_t>(outputs_), 0.0f);
    output_max_.assign(static_cast<size_t>(outputs_), 0.0f);
    std::vector<bool> used(static_cast<size_t>(outputs_), false);
    if (!channels.is_array() || channels.empty()) {
      return failure->Set(LoadStatus::kCorrupt,
                          path + ": /channels is not an array with an element");
    }
    for (const nlohmann::json& entry : channels) {
      const std::string place = path + ": /channels/" + std::to_string(channels_.size());
      Channel channel;
      channel.map = Text(Member(entry, "map"));
      channel.component = Text(Member(entry, "component"));
      const std::string encoding = Text(Member(entry, "encoding"));
      if (encoding != "linear" && encoding != "srgb" && encoding != "normal_xy" &&
          encoding != "signed_log") {
        return failure->Set(LoadStatus::kUnsupported, place + "/encoding is not known");
      }
      channel.encoding = encoding == "srgb"         ? Encoding::kSrgb
                         : encoding == "normal_xy"  ? Encoding::kNormalXy
                         : encoding == "signed_log" ? Encoding::kSignedLog
                                                    : Encoding::kLinear;
      const nlohmann::json& scale = Member(entry, "scale");
      if (!scale.is_null()) channel.scale = Real(scale);
      if (!(channel.scale > 0))
        return failure->Set(LoadStatus::kCorrupt, place + "/scale is not legal");
      const nlohmann::json& range = Member(entry, "range");
      if (!range.is_array() || range.size() != 2)
        return failure->Set(LoadStatus::kCorrupt, place + "/range is missing");
      channel.min = Real(range[0]);
      channel.max = Real(range[1]);
      if (!(channel.min <= channel.max))
        return failure->Set(LoadStatus::kCorrupt, place + "/range is not legal");
      const nlohmann::json& output = Member(entry, "output");
      if (output.is_null()) {
        channel.constant = Real(Member(entry, "constant"));
        if (std::isnan(channel.constant))
          return failure->Set(LoadStatus::kCorrupt, place + "/constant is not legal");
      } else {
        channel.output = Integer(output, 0, outputs_ - 1);
        const auto index = static_cast<size_t>(channel.output);
        if (channel.output < 0)
          return failure->Set(LoadStatus::kCorrupt, place + "/output is not legal");
        // Equal channels share an output, which is clamped once.
        if (used[index] && (output_min_[index] != channel.min || output_max_[index] != channel.max))
          return failure->Set(LoadStatus::kCorrupt, place + "/range is not legal");
        used[index] = true;
        output_min_[index] = channel.min;
        output_max_[index] = channel.max;
      }
      channels_.push_back(std::move(channel));
    }
    if (std::find(used.begin(), used.end(), false) != used.end()) {
      return failure->Set(LoadStatus::kCorrupt,
                          path + ": an output of the network belongs to no channel");
    }
    return true;
  }

  // A feature texture: DDS with DX10 header, 148 bytes, then the levels, largest first, as blocks
  // or, where that is legal, halves.
  bool ReadTexture(const nlohmann::json& feature, const std::string& directory,
                   const std::string& manifest_path, bool halves_are_legal, Failure* failure) {
    using namespace decoder_detail;
    const std::string place = manifest_path + ": /features/" + std::to_string(textures_.size());
    const int width = Integer(Member(feature, "width"), 1, kMaxSide);
    const int height = Integer(Member(feature, "height"), 1, kMaxSide);
    const int levels = Integer(Member(feature, "levels"), 1, 17);
    const int lod_bias = Integer(Member(feature, "lod_bias"), -31, 0);
    const std::string name = Text(Member(feature, "payload"));
    const std::string format = Text(Member(feature, "format"));
    if (width < 1 || height < 1 || levels < 1 || lod_bias < -31 || !IsPlainName(name)) {
      return failure->Set(LoadStatus::kCorrupt, place + " is not legal");
    }
    const bool is_halves = halves_are_legal && format == "RGBA16F";
    if (format != "BC6H_UF16" && format != "BC6H_SF16" && !is_halves) {
      return failure->Set(LoadStatus::kUnsupported,
                          place + "/format is neither BC6H_UF16 nor BC6H_SF16" +
                              (halves_are_legal ? " nor RGBA16F" : ""));
    }
    const bool is_signed = format == "BC6H_SF16";
    // Along a side of a level: texels of 8 bytes, or blocks of 16.
    const auto units = [&](int side) {
      return static_cast<size_t>(is_halves ? side : (side + 3) / 4);
    };
    uint64_t file_bytes = 148;
    for (int level = 0; level < levels; ++level) {
      file_bytes += uint64_t{is_halves ? 8u : 16u} * units(LevelSide(width, level)) *
                    units(LevelSide(height, level));
    }
    const std::string path = directory + "/" + name;
    std::string bytes;
    if (!ReadFile(path, file_bytes, &bytes, failure)) return false;
    if (bytes.size() != file_bytes) {
      return failure->Set(LoadStatus::kCorrupt, path + ": " + std::to_string(bytes.size()) +
                                                    " bytes, expected " +
                                                    std::to_string(file_bytes));
    }
    const auto is = [&](size_t offset, uint32_t value) { return Load32(bytes, offset) == value; };
    if (!is(0, 0x20534444) || !is(4, 124) || !is(76, 32) || !is(84, 0x30315844) ||
        !is(128, is_halves ? 10 : is_signed ? 96 : 95) || !is(132, 3) || !is(140, 1) ||
        !is(12, static_cast<uint32_t>(height)) || !is(16, static_cast<uint32_t>(width)) ||
        !is(28, static_cast<uint32_t>(levels))) {
      return failure->Set(LoadStatus::kCorrupt,
                          path + ": the DDS header does not match the manifest");
    }
    Texture texture;
    texture.lod_bias = lod_bias;
    const auto* from = reinterpret_cast<const uint8_t*>(bytes.data()) + 148;
    for (int index = 0; index < levels; ++index) {
      TextureLevel level;
      level.width = LevelSide(width, index);
      level.height = LevelSide(height, index);
      level.texels.resize(3 * static_cast<size_t>(level.width) * static_cast<size_t>(level.height));
      if (!(is_halves ? FillFromHalves(from, &level) : FillFromBlocks(from, is_signed, &level)))
        return failure->Set(LoadStatus::kCorrupt, path + ": a texel is not finite");
      from += size_t{is_halves ? 8u : 16u} * units(level.width) * units(level.height);
      texture.levels.push_back(std::move(level));
    }
    textures_.push_back(std::move(texture));
    return true;
  }

  // The texels of a level from their bytes; false if one is not finite.
  static bool FillFromBlocks(const uint8_t* block, bool is_signed,
                             decoder_detail::TextureLevel* level) {
    for (int by = 0; by < level->height; by += 4) {
      for (int bx = 0; bx < level->width; bx += 4, block += 16) {
        uint16_t texels[16][3];
        decoder_detail::DecodeBc6h(block, is_signed, texels);
        for (int y = by; y < std::min(by + 4, level->height); ++y) {
          for (int x = bx; x < std::min(bx + 4, level->width); ++x) {
            if (!SetTexel(x, y, texels[(y - by) * 4 + (x - bx)], level)) return false;
          }
        }
      }
    }
    return true;
  }

  // Red, green, blue, and an alpha that means nothing.
  static bool FillFromHalves(const uint8_t* bytes, decoder_detail::TextureLevel* level) {
    for (int y = 0; y < level->height; ++y) {
      for (int x = 0; x < level->width; ++x, bytes += 8) {
        uint16_t rgb[3];
        for (int c = 0; c < 3; ++c)
          rgb[c] = static_cast<uint16_t>(bytes[2 * c] | bytes[2 * c + 1] << 8);
        if (!SetTexel(x, y, rgb, level)) return false;
      }
    }
    return true;
  }

  static bool SetTexel(int x, int y, const uint16_t rgb[3], decoder_detail::TextureLevel* level) {
    const size_t width = static_cast<size_t>(level->width);
    const size_t plane = width * static_cast<size_t>(level->height);
    float* to = level->texels.data() + static_cast<size_t>(y) * width + static_cast<size_t>(x);
    const std::vector<float>& values = decoder_detail::HalfValues();
    for (size_t c = 0; c < 3; ++c) {
      if (!decoder_detail::HalfIsFinite(rgb[c])) return false;
      to[c * plane] = values[rgb[c]];
    }
    return true;
  }

  // A weight buffer of version 1: 64-byte header, 64-byte table entries, tensors of halves.
  bool ReadWeights(const std::string& path, Failure* failure) {
    using namespace decoder_detail;
    std::string bytes;
    if (!ReadFile(path, uint64_t{1} << 24, &bytes, failure)) return false;
    const auto corrupt = [&](const std::string& text) {
      return failure->Set(LoadStatus::kCorrupt, path + ": " + text);
    };
    if (bytes.size() < 64 || bytes.compare(0, 8, "PATINAWT") != 0)
      return corrupt("not a weight buffer");
    if (Load32(bytes, 8) > 1)
      return failure->Set(LoadStatus::kUnsupported, path + ": newer than this decoder");
    const size_t count = Load32(bytes, 12);
    if (Load32(bytes, 8) != 1 || count != 4 || bytes.size() < 64 + 64 * count ||
        Load32(bytes, 16) != bytes.size() || Load32(bytes, 20) != 0) {
      return corrupt("the header is not legal");
    }
    if (Load32(bytes, 24) != Crc32(bytes, 24)) return corrupt("the checksum is wrong");
    const auto tensor = [&](const std::string& name, int rows, int columns,
                            std::vector<float>* values) {
      for (size_t i = 0; i < count; ++i) {
        const size_t entry = 64 + 64 * i;
        // The name with its closing zero.
        if (bytes.compare(entry, name.size() + 1, name.c_str(), name.size() + 1) != 0) continue;
        const uint32_t rank = columns == 0 ? 1 : 2;
        const size_t elements =
            static_cast<size_t>(rows) * static_cast<size_t>(std::max(1, columns));
        const uint64_t offset =
            Load32(bytes, entry + 56) | static_cast<uint64_t>(Load32(bytes, entry + 60)) << 32;
        if (Load32(bytes, entry + 32) != 1 || Load32(bytes, entry + 36) != rank ||
            Load32(bytes, entry + 40) != static_cast<uint32_t>(rows) ||
            (rank == 2 && Load32(bytes, entry + 44) != static_cast<uint32_t>(columns)) ||
            offset > bytes.size() || bytes.size() - offset < 2 * elements) {
          return corrupt("tensor " + name + " does not match the manifest");
        }
        for (size_t e = 0; e < elements; ++e) {
          const size_t at = static_cast<size_t>(offset) + 2 * e;
          const auto half = static_cast<uint16_t>(static_cast<uint8_t>(bytes[at]) |
                                                  static_cast<uint8_t>(bytes[at + 1]) << 8);
          if (!decoder_detail::HalfIsFinite(half)) return corrupt("tensor " + name + " holds a non-finite weight");
          values->push_back(HalfValues()[half]);
        }
        return true;
      }
      return corrupt("there is no tensor " + name);
    };
    return tensor("layer0.weight", hidden_, inputs_, &w1_) &&
           tensor("layer0.bias", hidden_, 0, &b1_) &&
           tensor("layer1.weight", outputs_, hidden_, &w2_) &&
           tensor("layer1.bias", outputs_, 0, &b2_);
  }

  int width_ = 0;
  int height_ = 0;
  int levels_ = 0;
  std::string working_space_ = "lin_rec709";
  bool wrap_ = true;
  int inputs_ = 0;
  int hidden_ = 0;
  int outputs_ = 0;
  std::vector<Channel> channels_;
  std::vector<decoder_detail::Texture> textures_;
  std::vector<float> w1_, b1_;  // [hidden][inputs], [hidden]
  std::vector<float> w2_, b2_;  // [outputs][hidden], [outputs]
  std::vector<float> output_min_, output_max_;
};

}  // namespace patina
