// OUT/<scene>.scene.json: where each material of a scene is, and how it is put together.
#pragma once

#include <map>
#include <string>

#include "formats/base/result.h"

namespace patina {

// Writes the manifest of a scene from what is published in `out` now, and returns its path.
// problems: by asset, why the last bake of a material failed; others that cannot be baked have the
// reader's reason. Runs that end at the same time do not overwrite each other's view: the file is
// written under a lock. Errors: those of ReadScene, kIo, kResourceExhausted.
Result<std::string> WriteSceneManifest(const std::string& scene_path, const std::string& out,
                                       const std::map<std::string, std::string>& problems);

}  // namespace patina
