// A SceneLook as the member "scene" of manifests; FORMATS.md describes it.
#pragma once

#include <nlohmann/json.hpp>

#include "formats/json_view.h"
#include "formats/scene/scene.h"

namespace patina {

nlohmann::ordered_json SceneLookToJson(const SceneLook& look);
SceneLook SceneLookFromJson(const JsonView& json);

// Whether a manifest can hold it. Errors, with a JSON pointer: kInvalidArgument.
Status CheckSceneLook(const SceneLook& look);

}  // namespace patina
