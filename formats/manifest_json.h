// Parts of manifest.json that other files repeat.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "formats/json_view.h"
#include "formats/manifest.h"

namespace patina {

// A double that prints with the digits of the float and reads back as the same float.
double FloatAsWritten(float value);

nlohmann::ordered_json EffectsToJson(const std::vector<ManifestEffect>& effects);

// The channels of a material that are numbers, as scene manifests list them.
nlohmann::ordered_json ConstantsToJson(const std::vector<ManifestChannel>& channels);

// The member "effects"; of older manifests what "left_out" said in its place.
std::vector<ManifestEffect> EffectsFromJson(const JsonView& manifest);

// Errors, with a JSON pointer: kInvalidArgument.
Status CheckEffects(const std::vector<ManifestEffect>& effects);

}  // namespace patina
