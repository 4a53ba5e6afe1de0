// What the readers of scenes share.
#pragma once

#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "formats/scene/scene.h"

namespace patina::scene_detail {

// What a file may be called that an image comes from: a relative path below `folder`.
// Errors, without a pointer: kInvalidArgument (absolute, with "..", a URL, leads out of the folder
// through a link), kNotFound.
Result<std::string> PathInFolder(const std::string& folder, const std::string& relative);

// The bytes that a data URI stands for. Errors: kCorruptData.
Result<std::vector<uint8_t>> DecodeDataUri(std::string_view uri);

// ".png", ".jpg" by the first bytes of an image; empty for anything else.
std::string ImageExtensionOf(const uint8_t* bytes, size_t size);
// Why bytes that begin like these cannot be an image of a scene: "a KTX2 texture, ...".
std::string NotAnImageText(const uint8_t* bytes, size_t size);

// Makes asset names of the materials' names: legal, and each once.
void NameAssets(const std::string& scene_name, std::vector<SceneMaterial>* materials);

Result<Scene> ReadGltf(const std::string& path);
Result<Scene> ReadSceneFile(const std::string& path);

}  // namespace patina::scene_detail
