// Names that become files and folders.
#pragma once

#include <string>
#include <string_view>

#include "formats/base/result.h"

namespace patina {

inline constexpr size_t kMaxNameBytes = 128;

// Accepts a name that is safe as one file or folder on its own: valid UTF-8, 1..128 bytes, not
// hidden (no leading '.'), no '/', '\', control characters, and no space at either end. `what`
// ("asset name") begins the message. Errors: kInvalidArgument.
Status CheckPlainName(std::string_view name, const std::string& what);

// Accepts '/'-separated plain names below some folder: no leading '/', no empty, "." or ".." part;
// at most 4096 bytes of UTF-8. Errors: kInvalidArgument.
Status CheckRelativePath(std::string_view path, const std::string& what);

bool IsUtf8(std::string_view text);

// For messages: in double quotes, at most 80 bytes, control and non-UTF-8 bytes as '?'.
std::string QuoteForMessage(std::string_view text);

}  // namespace patina
