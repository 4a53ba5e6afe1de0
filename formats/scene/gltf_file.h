// The parts of a glTF file that materials need: its JSON, buffers and images.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "formats/json_view.h"
#include "formats/scene/scene.h"

namespace patina::scene_detail {

struct GltfFile {
  nlohmann::json json;
  std::string path, folder;
  bool has_bin = false;  // the second chunk of a .glb
  uint64_t bin_offset = 0, bin_size = 0;
};

// Checks container, version and required extensions. Errors: those of ReadScene.
Result<GltfFile> OpenGltf(const std::string& path);

// The images of the file, each with what is wrong with it. Errors: kCorruptData and kOutOfRange of
// the list itself.
Result<std::vector<SceneImage>> ListGltfImages(const GltfFile& file);

}  // namespace patina::scene_detail
