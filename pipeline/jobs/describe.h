// A container in words.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/container.h"

namespace patina {

// What a container holds and how good it is, for a person: several lines.
std::string ContainerText(const Container& container);

// For machines, on one line: {"container": directory, "bytes": that an engine loads, "manifest":
// {...}}, the manifest as the file has it. Errors: kNotFound, kIo, kCorruptData.
Result<std::string> ContainerJson(const Container& container);

}  // namespace patina
