#include "pipeline/image/file_tags.h"

#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <string_view>
#include <vector>

namespace patina {
namespace {

constexpr const char* kNoTriangle = "its primaries span no triangle";

uint32_t Big32(const uint8_t* bytes) {
  return static_cast<uint32_t>(bytes[0]) << 24 | static_cast<uint32_t>(bytes[1]) << 16 |
         static_cast<uint32_t>(bytes[2]) << 8 | bytes[3];
}
uint16_t Big16(const uint8_t* bytes) { return static_cast<uint16_t>(bytes[0] << 8 | bytes[1]); }
double Fixed16(const uint8_t* bytes) { return static_cast<int32_t>(Big32(bytes)) / 65536.0; }

// What programs write for 1/2.2.
constexpr uint32_t kLowSrgbGamma = 45450;
constexpr uint32_t kHighSrgbGamma = 45460;

// Reads an ICC profile; every access is checked against its size.
class IccReader {
 public:
  explicit IccReader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  ColorTag Read() {
    ColorTag tag;
    tag.origin = "ICC profile";
    if (bytes_.size() < kHeader + 4 || Text(36) != "acsp") return Refuse("it is damaged");
    tags_ = Big32(bytes_.data() + kHeader);
    if (tags_ > kMostTags || kHeader + 4 + size_t{12} * tags_ > bytes_.size())
      return Refuse("it is damaged");
    name_ = Description();
    if (!name_.empty()) tag.origin += " \"" + name_ + "\"";
    const std::string space = Text(16);
    if (space == "GRAY") {
      const auto curve = Curve("kTRC");
      if (!curve) return Refuse("its curve cannot be read");
      tag.curve = *curve;
      return tag;
    }
    if (space != "RGB ") return Refuse("it is for \"" + space + "\", not for RGB");
    const auto red = Colorant("rXYZ"), green = Colorant("gXYZ"), blue = Colorant("bXYZ");
    if (!red || !green || !blue) return Refuse("it has no matrix");
    const auto curve = Curve("rTRC");
    if (!curve) return Refuse("its curve cannot be read");
    if (Curve("gTRC") != curve || Curve("bTRC") != curve) return Refuse("its three curves differ");
    tag.curve = *curve;
    std::array<double, 3> white{};
    for (size_t i = 0; i < 3; ++i) white[i] = (*red)[i] + (*green)[i] + (*blue)[i];
    tag.primaries = {Chroma(*red), Chroma(*green), Chroma(*blue), Chroma(white)};
    if (!RgbToXyz(tag.primaries)) return Refuse(kNoTriangle);
    return tag;
  }

 private:
  static constexpr size_t kHeader = 128;
  static constexpr uint32_t kMostTags = 1024;
  static constexpr size_t kLongestName = 80;

  ColorTag Refuse(const std::string& why) const {
    ColorTag tag;
    tag.problem = "its ICC profile" + (name_.empty() ? "" : " \"" + name_ + "\"") +
                  " is not followed: " + why;
    return tag;
  }

  std::string Text(size_t at) const {
    std::string text;
    for (size_t i = 0; i < 4; ++i) {
      const uint8_t c = bytes_[at + i];
      text += c >= 0x20 && c < 0x7F ? static_cast<char>(c) : '?';
    }
    return text;
  }

  // The data of a tag; empty if it is not there or not in the file.
  std::span<const uint8_t> Find(std::string_view signature) const {
    for (uint32_t i = 0; i < tags_; ++i) {
      const uint8_t* entry = bytes_.data() + kHeader + 4 + size_t{12} * i;
      if (std::memcmp(entry, signature.data(), 4) != 0) continue;
      const uint64_t offset = Big32(entry + 4), size = Big32(entry + 8);
      if (offset + size > bytes_.size()) return {};
      return bytes_.subspan(offset, size);
    }
    return {};
  }

  static bool IsType(std::span<const uint8_t> data, const char* type, size_t least) {
    return data.size() >= least && std::memcmp(data.data(), type, 4) == 0;
  }

  std::string Description() const {
    const std::span<const uint8_t> data = Find("desc");
    std::string name;
    const auto add = [&name](unsigned c) {
      if (c == 0 || name.size() >= kLongestName) return false;
      name += c >= 0x20 && c < 0x7F ? static_cast<char>(c) : '?';
      return true;
    };
    if (IsType(data, "desc", 12)) {
      for (size_t i = 12; i < data.size() && add(data[i]); ++i) {
      }
    } else if (IsType(data, "mluc", 28)) {
      const uint64_t size = Big32(data.data() + 20), offset = Big32(data.data() + 24);
      for (uint64_t i = 0; i + 1 < size && offset + i + 1 < data.size(); i += 2) {
        if (!add(Big16(data.data() + offset + i))) break;
      }
    }
    return name;
  }

  std::optional<std::array<double, 3>> Colorant(const char* signature) const {
    const std::span<const uint8_t> data = Find(signature);
    if (!IsType(data, "XYZ ", 20)) return std::nullopt;
    return std::array<double, 3>{Fixed16(data.data() + 8), Fixed16(data.data() + 12),
                                 Fixed16(data.data() + 16)};
  }

  static Chromaticity Chroma(const std::array<double, 3>& xyz) {
    const double sum = xyz[0] + xyz[1] + xyz[2];
    return {xyz[0] / sum, xyz[1] / sum};
  }

  std::optional<TransferCurve> Curve(const char* signature) const {
    const std::span<const uint8_t> data = Find(signature);
    if (IsType(data, "curv", 12)) return TableCurve(data);
    if (IsType(data, "para", 12)) return ParametricCurve(data);
    return std::nullopt;
  }

  static std::optional<TransferCurve> TableCurve(std::span<const uint8_t> data) {
    const uint64_t count = Big32(data.data() + 8);
    if (12 + 2 * count > data.size()) return std::nullopt;
    if (count == 0) return TransferCurve();
    if (count == 1) {
      const double gamma = Big16(data.data() + 12) / 256.0;
      if (!(gamma > 0)) return std::nullopt;
      return PowerCurve(gamma);
    }
    TransferCurve curve;
    for (uint64_t i = 0; i < count; ++i)
      curve.table.push_back(static_cast<float>(Big16(data.data() + 12 + 2 * i) / 65535.0));
    return curve;
  }

  static std::optional<TransferCurve> ParametricCurve(std::span<const uint8_t> data) {
    constexpr std::array<size_t, 5> kNumbers{1, 3, 4, 5, 7};
    const uint16_t kind = Big16(data.data() + 8);
    if (kind >= kNumbers.size() || data.size() < 12 + 4 * kNumbers[kind]) return std::nullopt;
    std::array<double, 7> p{};
    for (size_t i = 0; i < kNumbers[kind]; ++i) p[i] = Fixed16(data.data() + 12 + 4 * i);
    TransferCurve curve = PowerCurve(p[0]);
    if (!(p[0] > 0)) return std::nullopt;
    if (kind == 0) return curve;
    curve.a = p[1];
    curve.b = p[2];
    if (!(curve.a > 0)) return std::nullopt;
    switch (kind) {
      case 1:  // 0 below -b/a
      case 2:  // c below -b/a
        curve.d = -curve.b / curve.a;
        curve.c = 0;
        curve.e = curve.f = kind == 2 ? p[3] : 0;
        break;
      default:
        curve.c = p[3];
        curve.d = p[4];
        curve.e = p[5];
        curve.f = p[6];
    }
    return curve;
  }

  std::span<const uint8_t> bytes_;
  uint32_t tags_ = 0;
  std::string name_;
};

}  // namespace

ColorTag TagFromPngChunks(const std::string& path) {
  constexpr int kMostChunks = 4096;
  std::ifstream file(path, std::ios::binary);
  std::array<uint8_t, 8> head{};
  const auto read = [&file](uint8_t* to, size_t count) {
    return static_cast<bool>(
        file.read(reinterpret_cast<char*>(to), static_cast<std::streamsize>(count)));
  };
  ColorTag tag;
  if (!read(head.data(), head.size()) || std::memcmp(head.data(), "\x89PNG\r\n\x1a\n", 8) != 0)
    return tag;
  std::optional<uint32_t> gamma;
  std::optional<Primaries> primaries;
  for (int i = 0; i < kMostChunks && read(head.data(), head.size()); ++i) {
    const uint32_t size = Big32(head.data());
    const std::string_view type(reinterpret_cast<const char*>(head.data() + 4), 4);
    if (type == "IDAT" || type == "IEND") break;
    std::array<uint8_t, 32> data{};
    const size_t wanted = type == "gAMA" ? 4 : type == "cHRM" ? 32 : 0;
    if (type == "sRGB") {
      tag.origin = "sRGB chunk";
      tag.curve = SrgbCurve();
      return tag;
    }
    if (wanted != 0 && size == wanted) {
      if (!read(data.data(), wanted)) break;
      if (type == "gAMA") {
        gamma = Big32(data.data());
      } else {
        const auto point = [&data](size_t at) {
          return Chromaticity{Big32(data.data() + at) / 1e5, Big32(data.data() + at + 4) / 1e5};
        };
        primaries = {point(8), point(16), point(24), point(0)};
      }
    }
    file.seekg(static_cast<std::streamoff>(size - (size == wanted ? wanted : 0)) + 4,
               std::ios::cur);
  }
  // Primaries alone do not say what the codes are.
  if (!gamma) return tag;
  // Beyond these a gamma is a mistake.
  if (*gamma < 10000 || *gamma > 1000000) {
    tag.problem = "its gAMA chunk is not followed: a gamma of " + std::to_string(*gamma) +
                  " / 100000 is none of an image";
    return tag;
  }
  tag.origin = primaries ? "gAMA and cHRM" : "gAMA";
  if (primaries) {
    if (!RgbToXyz(*primaries)) {
      ColorTag refused;
      refused.problem = std::string("its cHRM chunk is not followed: ") + kNoTriangle;
      return refused;
    }
    tag.primaries = *primaries;
  }
  constexpr double kSamePrimaries = 5e-3;
  const bool rec709 = AreSameSpace(tag.primaries, kRec709Primaries, kSamePrimaries);
  if (rec709) tag.primaries = kRec709Primaries;
  if (rec709 && *gamma >= kLowSrgbGamma && *gamma <= kHighSrgbGamma) {
    tag.curve = SrgbCurve();
  } else if (*gamma != 100000) {
    tag.curve = PowerCurve(1e5 / *gamma);
  }
  return tag;
}

ColorTag TagFromIccProfile(std::span<const uint8_t> profile) { return IccReader(profile).Read(); }

ColorTag TagFromChromaticities(std::span<const float, 8> values) {
  const auto point = [&values](size_t i) {
    return Chromaticity{static_cast<double>(values[i]), static_cast<double>(values[i + 1])};
  };
  ColorTag tag;
  tag.primaries = {point(0), point(2), point(4), point(6)};
  if (RgbToXyz(tag.primaries)) {
    tag.origin = "chromaticities";
    return tag;
  }
  ColorTag refused;
  refused.problem = std::string("its chromaticities are not followed: ") + kNoTriangle;
  return refused;
}

}  // namespace patina
