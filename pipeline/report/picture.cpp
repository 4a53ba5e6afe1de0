#include "pipeline/report/picture.h"

#include <filesystem>

#include "formats/base/file_io.h"
#include "pipeline/image/image_io.h"

namespace patina {

Result<std::vector<uint8_t>> EncodePng(const std::string& scratch_path, int width, int height,
                                       int channels, const float* values) {
  PATINA_TRY(WriteImage(scratch_path, WriteFormat::kPng8, width, height, channels, values));
  auto bytes = ReadFile(scratch_path, uint64_t{1} << 30);
  std::error_code ignored;
  std::filesystem::remove(scratch_path, ignored);
  return bytes;
}

std::string Base64(std::span<const uint8_t> bytes) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const size_t left = bytes.size() - i;
    const uint32_t three = static_cast<uint32_t>(bytes[i]) << 16 |
                           (left > 1 ? static_cast<uint32_t>(bytes[i + 1]) << 8 : 0) |
                           (left > 2 ? static_cast<uint32_t>(bytes[i + 2]) : 0);
    text += kDigits[three >> 18];
    text += kDigits[three >> 12 & 63];
    text += left > 1 ? kDigits[three >> 6 & 63] : '=';
    text += left > 2 ? kDigits[three & 63] : '=';
  }
  return text;
}

std::string PngDataUri(std::span<const uint8_t> png) {
  return "data:image/png;base64," + Base64(png);
}

}  // namespace patina
