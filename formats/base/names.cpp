#include "formats/base/names.h"

#include <algorithm>
#include <cstdint>

namespace patina {
namespace {

// The length in bytes of the UTF-8 character at the start of `text`, or 0 if there is none.
size_t CharacterBytes(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  const uint8_t first = byte(0);
  if (first < 0x80) return 1;
  const size_t count = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < count) return 0;
  for (size_t i = 1; i < count; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
  }
  // Overlong forms, surrogates, and what is beyond U+10FFFF.
  if ((first == 0xE0 && byte(1) < 0xA0) || (first == 0xED && byte(1) > 0x9F) ||
      (first == 0xF0 && byte(1) < 0x90) || (first == 0xF4 && byte(1) > 0x8F)) {
    return 0;
  }
  return count;
}

bool HasControl(std::string_view text) {
  return std::any_of(text.begin(), text.end(), [](char c) {
    const auto byte = static_cast<uint8_t>(c);
    return byte < 0x20 || byte == 0x7F;
  });
}

}  // namespace

bool IsUtf8(std::string_view text) {
  while (!text.empty()) {
    const size_t bytes = CharacterBytes(text);
    if (bytes == 0) return false;
    text.remove_prefix(bytes);
  }
  return true;
}

std::string QuoteForMessage(std::string_view text) {
  constexpr size_t kLimit = 80;
  std::string quoted = "\"";
  while (!text.empty() && quoted.size() < kLimit) {
    const size_t bytes = CharacterBytes(text);
    if (bytes == 0 || HasControl(text.substr(0, 1))) {
      quoted += '?';
      text.remove_prefix(1);
    } else {
      quoted += text.substr(0, bytes);
      text.remove_prefix(bytes);
    }
  }
  return quoted + (text.empty() ? "\"" : "...\"");
}

Status CheckPlainName(std::string_view name, const std::string& what) {
  std::string problem;
  if (name.empty()) {
    problem = "is empty";
  } else if (name.size() > kMaxNameBytes) {
    problem =
        "has " + std::to_string(name.size()) + " bytes, more than " + std::to_string(kMaxNameBytes);
  } else if (!IsUtf8(name)) {
    problem = "is not UTF-8";
  } else if (name.front() == '.') {
    problem = "begins with a dot";
  } else if (name.find_first_of("/\\") != std::string_view::npos) {
    problem = "holds a path separator";
  } else if (HasControl(name)) {
    problem = "holds a control character";
  } else if (name.front() == ' ' || name.back() == ' ') {
    problem = "begins or ends with a space";
  } else {
    return {};
  }
  return Fail(ErrorCode::kInvalidArgument, what + " " + QuoteForMessage(name) + " " + problem);
}

Status CheckRelativePath(std::string_view path, const std::string& what) {
  constexpr size_t kMaxPathBytes = 4096;
  std::string problem;
  if (path.empty()) {
    problem = "is empty";
  } else if (path.size() > kMaxPathBytes) {
    problem = "is longer than " + std::to_string(kMaxPathBytes) + " bytes";
  } else if (!IsUtf8(path)) {
    problem = "is not UTF-8";
  } else if (HasControl(path)) {
    problem = "holds a control character";
  } else if (path.front() == '/') {
    problem = "is absolute";
  }
  for (size_t begin = 0; problem.empty() && begin <= path.size();) {
    const size_t end = std::min(path.find('/', begin), path.size());
    const std::string_view part = path.substr(begin, end - begin);
    if (part.empty() || part == "." || part == "..")
      problem = "has an empty part or a \".\" or \"..\" in it";
    begin = end + 1;
  }
  if (problem.empty()) return {};
  return Fail(ErrorCode::kInvalidArgument, what + " " + QuoteForMessage(path) + " " + problem);
}

}  // namespace patina
