// Numbers for people: short, with a unit, and a word where there is no number.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace patina {

inline constexpr const char* kNoValue = "\xE2\x80\x93";  // an en dash

std::string FixedText(double value, int digits);  // "12.50"; kNoValue for NaN, "∞" for infinity
// With so many significant digits, without an exponent where it can be helped: "0.00047", "1.2e-7".
std::string ShortText(double value, int significant);
std::string MeasureText(const std::optional<double>& value, int digits);  // kNoValue if absent
std::string BytesText(uint64_t bytes);                                    // "1.86 MB", "349.7 kB"
std::string CountText(double count);                                      // "136.9 M", "4 k", "812"
std::string SecondsText(double seconds);           // "0.34 s", "32 s", "3 min 50 s", "2 h 5 min"
std::string SignedText(double value, int digits);  // "+0.30", "−1.20" (a true minus)

}  // namespace patina
