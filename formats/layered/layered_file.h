// Files *.layers.json: schemas/layered.schema.json.
#pragma once

#include <string>
#include <string_view>

#include "formats/base/result.h"
#include "formats/layered/layered_stack.h"

namespace patina::layered {

inline constexpr std::string_view kLayersSuffix = ".layers.json";
inline constexpr size_t kMaxLayersBytes = 1 << 20;

// Whether a file's name ends in .layers.json, whatever the case of the letters.
bool IsLayersFileName(std::string_view path);

// Whether there can be such a material. Errors: kInvalidArgument, with the JSON pointer that the
// value has in a file, the value and the remedy.
Status CheckStack(const Stack& stack);

// Errors: kInvalidArgument (not JSON, a key that is unknown or stands twice, a value of the wrong
// type, a material that cannot be, a map: see varying_stack.h), beginning with
// "<source_name>: <JSON pointer>: ".
Result<Stack> ParseStack(std::string_view text, const std::string& source_name);

// Errors: those of ReadTextFile and of ParseStack.
Result<Stack> ReadStack(const std::string& path);

// The text of a file that ParseStack reads as this stack.
std::string FormatStack(const Stack& stack);

}  // namespace patina::layered
