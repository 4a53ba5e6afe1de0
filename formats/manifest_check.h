// The rules of a manifest beyond the types of its fields.
#pragma once

#include "formats/base/result.h"
#include "formats/manifest.h"

namespace patina {

// Errors, with the JSON pointer first: kUnsupported for a kind, address mode, encoding, texture
// format or activation that this version cannot decode; kInvalidArgument for every other broken
// rule (FORMATS.md lists them).
Status CheckManifest(const Manifest& manifest);

}  // namespace patina
