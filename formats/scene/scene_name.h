// What a scene's file is called as an asset.
#pragma once

#include <string>

namespace patina {

// Scene::name of a file: its own without folder and extensions, as an asset name.
std::string SceneNameOf(const std::string& path);

}  // namespace patina
