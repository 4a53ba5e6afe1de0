// glTF files for tests.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "formats/scene/scene.h"
#include "tests/formats/test_support.h"

namespace patina::test {

using Json = nlohmann::json;

// What readers take for a PNG or a JPEG: its first bytes.
inline std::string PngBytes() { return std::string("\x89PNG\r\n\x1a\n", 8) + "rest of a picture"; }
inline std::string JpegBytes() { return "\xFF\xD8\xFF\xE0 rest of a picture"; }

inline void WriteBytes(const std::string& path, const std::string& bytes) {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  std::ofstream(path, std::ios::binary) << bytes;
}

inline std::string Word(uint32_t value) {
  std::string bytes;
  for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i));
  return bytes;
}

// The bytes of a .glb; chunks are padded as the format wants.
inline std::string Glb(const Json& json, std::string bin = "") {
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  bin.resize((bin.size() + 3) / 4 * 4, '\0');
  std::string body = Word(static_cast<uint32_t>(text.size())) + "JSON" + text;
  if (!bin.empty()) body += Word(static_cast<uint32_t>(bin.size())) + std::string("BIN\0", 4) + bin;
  return "glTF" + Word(2) + Word(static_cast<uint32_t>(12 + body.size())) + body;
}

// One material "wall" with one texture from the file a.png.
inline Json OneMaterial() {
  return Json::parse(R"({
    "asset": {"version": "2.0"},
    "materials": [{"name": "wall", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    "textures": [{"source": 0, "sampler": 0}],
    "samplers": [{"wrapS": 10497}],
    "images": [{"uri": "a.png"}]
  })");
}

// A folder with a.png, into which scenes are written.
class SceneFolder {
 public:
  SceneFolder() { WriteBytes(folder_ / "a.png", PngBytes()); }
  const TemporaryDirectory& folder() const { return folder_; }
  Result<Scene> Read(const Json& json, const std::string& name = "s.gltf") const {
    return ReadText(json.dump(), name);
  }
  Result<Scene> ReadText(const std::string& text, const std::string& name = "s.gltf") const {
    WriteBytes(folder_ / name, text);
    return ReadScene(folder_ / name);
  }

 private:
  TemporaryDirectory folder_;
};

inline const SceneMap* FindMap(const SceneMaterial& material, const std::string& role) {
  for (const SceneMap& map : material.maps) {
    if (map.role == role) return &map;
  }
  return nullptr;
}

inline std::vector<double> ValueOf(const std::vector<SceneValue>& values, const std::string& name) {
  for (const SceneValue& value : values) {
    if (value.map == name) return value.value;
  }
  return {};
}

}  // namespace patina::test
