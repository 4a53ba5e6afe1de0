#include "formats/scene/scene.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/scene/scene_name.h"
#include "formats/scene/scene_reading.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

bool EndsWithAnyCase(const std::string& name, std::string_view end) {
  if (name.size() <= end.size()) return false;
  return std::equal(
      end.begin(), end.end(), name.end() - static_cast<std::ptrdiff_t>(end.size()),
      [](char a, char b) { return a == std::tolower(static_cast<unsigned char>(b)); });
}

std::string LegalName(std::string name) {
  for (char& c : name) {
    const bool legal = (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') ||
                       c == '_' || c == '-' || c == '.';
    if (!legal) c = '_';
  }
  constexpr size_t kLongest = 80;  // room for a number behind it
  if (name.size() > kLongest) name.resize(kLongest);
  while (!name.empty() && (name[0] == '-' || name[0] == '.')) name.erase(0, 1);
  return name;
}

}  // namespace

namespace scene_detail {

Result<std::string> PathInFolder(const std::string& folder, const std::string& relative) {
  const std::string shown = QuoteForMessage(relative);
  // "http:", "file:", "c:": a scheme, or a drive.
  const size_t colon = relative.find(':');
  if (colon != std::string::npos && relative.find('/') > colon) {
    return Fail(ErrorCode::kInvalidArgument,
                shown + " is not a file beside the scene; put the file into the scene's folder");
  }
  if (auto status = CheckRelativePath(relative, shown); !status) {
    return Fail(ErrorCode::kInvalidArgument,
                shown + " leaves the scene's folder or is no path; put the file into the folder");
  }
  const fs::path path = fs::path(folder.empty() ? "." : folder) / relative;
  std::error_code error;
  const fs::path real = fs::canonical(path, error);
  if (error) {
    return Fail(ErrorCode::kNotFound, "there is no file " + path.string() +
                                          "; put it there, or take it out of the scene");
  }
  const fs::path root = fs::canonical(folder.empty() ? "." : folder, error);
  const auto mismatch = std::mismatch(root.begin(), root.end(), real.begin(), real.end());
  if (error || mismatch.first != root.end()) {
    return Fail(ErrorCode::kInvalidArgument,
                shown + " is a link that leads out of the scene's folder; copy the file into it");
  }
  if (!fs::is_regular_file(real, error))
    return Fail(ErrorCode::kInvalidArgument, path.string() + " is not a file");
  return path.string();
}

Result<std::vector<uint8_t>> DecodeDataUri(std::string_view uri) {
  const size_t comma = uri.find(',');
  const std::string_view head = uri.substr(0, std::min(comma, uri.size()));
  constexpr std::string_view kMark = ";base64";
  if (comma == std::string_view::npos || head.size() < kMark.size() ||
      head.substr(head.size() - kMark.size()) != kMark) {
    return Fail(ErrorCode::kCorruptData, "a data URI without \";base64,\"; embed it as base64");
  }
  std::vector<uint8_t> bytes;
  bytes.reserve((uri.size() - comma) / 4 * 3);
  uint32_t bits = 0;
  int count = 0;
  size_t padding = 0;
  for (const char c : uri.substr(comma + 1)) {
    int value = -1;
    if (c >= 'A' && c <= 'Z') value = c - 'A';
    if (c >= 'a' && c <= 'z') value = c - 'a' + 26;
    if (c >= '0' && c <= '9') value = c - '0' + 52;
    if (c == '+') value = 62;
    if (c == '/') value = 63;
    if (c == '=') {
      ++padding;
      continue;
    }
    if (value < 0 || padding > 0)
      return Fail(ErrorCode::kCorruptData, "the data URI is not base64; write it again");
    bits = bits << 6 | static_cast<uint32_t>(value);
    if (++count == 4) {
      for (int shift = 16; shift >= 0; shift -= 8)
        bytes.push_back(static_cast<uint8_t>(bits >> shift));
      bits = 0;
      count = 0;
    }
  }
  const bool complete = padding == 0 || static_cast<size_t>(count) + padding == 4;
  if (count == 1 || !complete)
    return Fail(ErrorCode::kCorruptData, "the base64 of the data URI is cut off; write it again");
  if (count >= 2) bytes.push_back(static_cast<uint8_t>(bits >> (count == 2 ? 4 : 10)));
  if (count == 3) bytes.push_back(static_cast<uint8_t>(bits >> 2));
  return bytes;
}

std::string ImageExtensionOf(const uint8_t* bytes, size_t size) {
  const auto begins = [&](const char* magic, size_t length) {
    return size >= length && std::memcmp(bytes, magic, length) == 0;
  };
  if (begins("\x89PNG\r\n\x1a\n", 8)) return ".png";
  if (begins("\xFF\xD8\xFF", 3)) return ".jpg";
  return "";
}

std::string NotAnImageText(const uint8_t* bytes, size_t size) {
  const auto begins = [&](const char* magic, size_t length) {
    return size >= length && std::memcmp(bytes, magic, length) == 0;
  };
  if (begins("\xABKTX 20\xBB", 8))
    return "a KTX2 texture, which is not read; give the PNG or JPEG it was made from";
  if (begins("RIFF", 4) && size >= 12 && std::memcmp(bytes + 8, "WEBP", 4) == 0)
    return "a WebP image, which is not read; give it as PNG or JPEG";
  if (begins("DDS ", 4)) return "a DDS texture, which glTF does not allow here; give PNG or JPEG";
  return "neither PNG nor JPEG, by its first bytes; glTF allows no others";
}

void NameAssets(const std::string& scene_name, std::vector<SceneMaterial>* materials) {
  std::map<std::string, int> uses;
  for (SceneMaterial& material : *materials) {
    std::string name = LegalName(material.look.material);
    if (name.find_first_not_of('_') == std::string::npos)
      name = "material" + std::to_string(material.look.index);
    material.asset = LegalName(scene_name + "_" + name);
    ++uses[material.asset];
  }
  std::set<std::string> taken;
  for (SceneMaterial& material : *materials) {
    std::string name = material.asset;
    if (uses[material.asset] > 1) name += "_" + std::to_string(material.look.index);
    while (!taken.insert(name).second) name += "_";
    material.asset = name;
  }
}

}  // namespace scene_detail

const char* SceneWrapName(SceneWrap wrap) {
  switch (wrap) {
    case SceneWrap::kRepeat:
      return "repeat";
    case SceneWrap::kClamp:
      return "clamp";
    case SceneWrap::kMirror:
      return "mirror";
  }
  return "repeat";
}

bool IsSceneFileName(const std::string& name) {
  return EndsWithAnyCase(name, ".gltf") || EndsWithAnyCase(name, ".glb") ||
         EndsWithAnyCase(name, ".patina.json");
}

std::string SceneNameOf(const std::string& path) {
  std::string name = fs::path(path).filename().string();
  for (const std::string_view end : {".gltf", ".glb", ".patina.json"}) {
    if (EndsWithAnyCase(name, end)) {
      name.resize(name.size() - end.size());
      break;
    }
  }
  name = LegalName(name);
  return name.empty() ? "scene" : name;
}

Result<Scene> ReadScene(const std::string& path) {
  Result<Scene> scene = EndsWithAnyCase(path, ".patina.json") ? scene_detail::ReadSceneFile(path)
                                                              : scene_detail::ReadGltf(path);
  if (!scene) return scene;
  scene->path = path;
  scene->name = SceneNameOf(path);
  const std::string file = fs::path(path).filename().string();
  for (SceneMaterial& material : scene->materials) material.look.file = file;
  scene_detail::NameAssets(scene->name, &scene->materials);
  return scene;
}

Result<std::vector<uint8_t>> ReadSceneImage(const SceneImage& image) {
  if (image.problem) return Fail(*image.problem);
  if (image.path.empty()) return image.bytes;
  if (!image.embedded) return ReadFile(image.path, kMaxSceneImageBytes);
  std::ifstream file(image.path, std::ios::binary);
  std::vector<uint8_t> bytes(static_cast<size_t>(image.size));
  file.seekg(static_cast<std::streamoff>(image.offset));
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file) {
    return Fail(ErrorCode::kIo, image.path + ": " + image.pointer +
                                    ": cannot read its bytes; the file changed or is cut off");
  }
  return bytes;
}

}  // namespace patina
