// JSON of people and programs that nobody vouches for, where the library is too kind.
#pragma once

#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "formats/base/result.h"

namespace patina {

// Refuses what the library lets through: a key that stands twice in one object, of which it would
// keep one, and nesting deeper than `deepest`, which would exhaust the stack when printed. Errors:
// kInvalidArgument; the message does not name the source.
Result<nlohmann::json> ParseStrictJson(std::string_view text, int deepest);

// A key as a part of a JSON pointer (RFC 6901).
std::string EscapePointer(std::string_view key);

// The first member of an object that is none of `keys`, as a problem with its JSON pointer and the
// keys there are; empty if there is none, or `object` is no object. pointer: of the object.
std::string UnknownMember(const nlohmann::json& object, const std::string& pointer,
                          std::initializer_list<std::string_view> keys);

}  // namespace patina
