#include "pipeline/report/quantity.h"

#include <cmath>
#include <cstdio>

namespace patina {
namespace {

constexpr const char* kInfinity = "\xE2\x88\x9E";
constexpr const char* kMinus = "\xE2\x88\x92";

std::string Print(const char* format, int digits, double value) {
  char text[352];  // the largest double in full
  std::snprintf(text, sizeof text, format, digits, value);
  return text;
}

}  // namespace

std::string FixedText(double value, int digits) {
  if (std::isnan(value)) return kNoValue;
  if (std::isinf(value)) return (value < 0 ? kMinus : "") + std::string(kInfinity);
  return Print("%.*f", digits, value);
}

std::string ShortText(double value, int significant) {
  if (!std::isfinite(value)) return FixedText(value, 0);
  const double size = std::fabs(value);
  if (size != 0 && (size < 1e-6 || size >= 1e9)) return Print("%.*g", significant, value);
  const int whole = size > 0 ? static_cast<int>(std::floor(std::log10(size))) + 1 : 1;
  const int digits = significant > whole ? significant - whole : 0;
  std::string text = Print("%.*f", digits, value);
  if (text.find('.') != std::string::npos) {
    while (text.back() == '0') text.pop_back();
    if (text.back() == '.') text.pop_back();
  }
  return text;
}

std::string MeasureText(const std::optional<double>& value, int digits) {
  return value ? FixedText(*value, digits) : kNoValue;
}

std::string BytesText(uint64_t bytes) {
  const auto value = static_cast<double>(bytes);
  if (bytes < 1000) return std::to_string(bytes) + " B";
  if (value < 999.95e3) return Print("%.*f", 1, value / 1e3) + " kB";
  if (value < 999.995e6) return Print("%.*f", 2, value / 1e6) + " MB";
  return Print("%.*f", 2, value / 1e9) + " GB";
}

std::string CountText(double count) {
  if (!std::isfinite(count)) return FixedText(count, 0);
  if (count < 1e3) return ShortText(count, 3);
  if (count < 999.5e3) return ShortText(count / 1e3, 4) + " k";
  if (count < 999.5e6) return ShortText(count / 1e6, 4) + " M";
  return ShortText(count / 1e9, 4) + " G";
}

std::string SecondsText(double seconds) {
  if (!std::isfinite(seconds)) return FixedText(seconds, 0);
  if (seconds < 9.995) return Print("%.*f", 2, seconds) + " s";
  if (seconds < 99.95) return Print("%.*f", 1, seconds) + " s";
  const auto whole = static_cast<long long>(std::llround(std::fmin(seconds, 1e15)));
  if (whole < 3600) return std::to_string(whole / 60) + " min " + std::to_string(whole % 60) + " s";
  return std::to_string(whole / 3600) + " h " + std::to_string(whole % 3600 / 60) + " min";
}

std::string SignedText(double value, int digits) {
  if (!std::isfinite(value)) return FixedText(value, digits);
  const std::string size = Print("%.*f", digits, std::fabs(value));
  const bool zero = size.find_first_not_of("0.") == std::string::npos;
  return (zero ? "\xC2\xB1" : value < 0 ? kMinus : "+") + size;
}

}  // namespace patina
