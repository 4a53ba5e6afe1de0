#include "formats/scene/gltf_file.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/base/strict_json.h"
#include "formats/scene/scene_reading.h"

namespace patina::scene_detail {
namespace {

namespace fs = std::filesystem;

constexpr int kDeepestJson = 64;
constexpr size_t kMaxBuffers = 16384;
constexpr size_t kMaxBufferViews = 1000000;
constexpr size_t kMagicBytes = 16;

// Required extensions that may stand in a file we read: those that are understood, and those that
// concern geometry, lights or playback alone. Texture formats are the business of each image.
const std::set<std::string>& KnownExtensions() {
  static const std::set<std::string> known = {
      "KHR_materials_anisotropy",
      "KHR_materials_clearcoat",
      "KHR_materials_diffuse_transmission",
      "KHR_materials_dispersion",
      "KHR_materials_emissive_strength",
      "KHR_materials_ior",
      "KHR_materials_iridescence",
      "KHR_materials_sheen",
      "KHR_materials_specular",
      "KHR_materials_transmission",
      "KHR_materials_unlit",
      "KHR_materials_volume",
      "KHR_texture_transform",
      "KHR_texture_basisu",
      "EXT_texture_webp",
      "EXT_texture_avif",
      "MSFT_texture_dds",
      "KHR_materials_variants",
      "KHR_mesh_quantization",
      "KHR_draco_mesh_compression",
      "KHR_lights_punctual",
      "KHR_animation_pointer",
      "KHR_node_visibility",
      "KHR_xmp_json_ld",
      "EXT_mesh_gpu_instancing",
      "EXT_lights_image_based",
  };
  return known;
}

uint32_t Load32(const unsigned char* bytes) {
  return static_cast<uint32_t>(bytes[0]) | static_cast<uint32_t>(bytes[1]) << 8 |
         static_cast<uint32_t>(bytes[2]) << 16 | static_cast<uint32_t>(bytes[3]) << 24;
}

tl::unexpected<Error> BadGlb(const std::string& path, uint64_t offset, const std::string& what) {
  return Fail(ErrorCode::kCorruptData,
              path + ": byte " + std::to_string(offset) + ": " + what + "; export the file again");
}

bool ReadAt(std::ifstream& file, uint64_t offset, void* bytes, size_t size) {
  file.clear();
  file.seekg(static_cast<std::streamoff>(offset));
  file.read(static_cast<char*>(bytes), static_cast<std::streamsize>(size));
  return static_cast<bool>(file);
}

// Finds the chunks of a .glb and returns the text of the first.
Result<std::string> ReadGlb(const std::string& path, uint64_t size, GltfFile* gltf) {
  constexpr uint32_t kJson = 0x4E4F534A, kBin = 0x004E4942;
  std::ifstream file(path, std::ios::binary);
  unsigned char header[12];
  if (!ReadAt(file, 0, header, sizeof header)) return BadGlb(path, 0, "the header is cut off");
  if (Load32(header + 4) != 2) {
    return Fail(ErrorCode::kUnsupported, path + ": byte 4: glTF version " +
                                             std::to_string(Load32(header + 4)) +
                                             ", and only 2 is read; export the file as glTF 2.0");
  }
  if (Load32(header + 8) != size) {
    return BadGlb(path, 8,
                  "the file says that it has " + std::to_string(Load32(header + 8)) +
                      " bytes, and has " + std::to_string(size));
  }
  std::string text;
  uint64_t at = sizeof header;
  for (int chunk = 0; at < size; ++chunk) {
    unsigned char head[8];
    if (size - at < sizeof head || !ReadAt(file, at, head, sizeof head))
      return BadGlb(path, at, "the header of a chunk is cut off");
    const uint64_t length = Load32(head);
    const uint32_t type = Load32(head + 4);
    if (length > size - at - sizeof head) {
      return BadGlb(path, at,
                    "a chunk of " + std::to_string(length) + " bytes, but only " +
                        std::to_string(size - at - sizeof head) + " follow");
    }
    at += sizeof head;
    if (chunk == 0) {
      if (type != kJson) return BadGlb(path, at - 4, "the first chunk is not JSON");
      if (length > kMaxSceneJsonBytes) {
        return Fail(ErrorCode::kOutOfRange,
                    path + ": " + std::to_string(length) + " bytes of JSON, more than " +
                        std::to_string(kMaxSceneJsonBytes) + "; split the scene");
      }
      text.resize(static_cast<size_t>(length));
      if (!ReadAt(file, at, text.data(), text.size()))
        return BadGlb(path, at, "the JSON is cut off");
    } else if (type == kBin && !gltf->has_bin) {
      gltf->has_bin = true;
      gltf->bin_offset = at;
      gltf->bin_size = length;
    }
    at += length;
  }
  if (text.empty()) return BadGlb(path, sizeof header, "there is no JSON");
  return text;
}

Status CheckAsset(const GltfFile& gltf) {
  JsonProblem problem;
  const JsonView root(&gltf.json, &problem);
  const JsonView asset = root.Field("asset");
  const std::string version = asset.Field("version").String();
  std::string least;
  if (const JsonView min_version = asset.Optional("minVersion")) least = min_version.String();
  if (!problem.text.empty()) return Fail(ErrorCode::kCorruptData, gltf.path + ": " + problem.text);
  for (const auto& [key, text] : {std::pair{"version", version}, {"minVersion", least}}) {
    if (text.empty() && std::string(key) == "minVersion") continue;
    if (text.rfind("2.", 0) == 0) continue;
    return Fail(ErrorCode::kUnsupported, gltf.path + ": /asset/" + key + ": glTF " +
                                             QuoteForMessage(text) +
                                             ", and only 2.x is read; export the file as glTF 2.0");
  }
  Status status;
  int index = 0;
  if (const JsonView required = root.Optional("extensionsRequired")) {
    required.ForEach(1000, [&](const JsonView& entry) {
      const std::string name = entry.String();
      if (status && problem.text.empty() && KnownExtensions().count(name) == 0) {
        status = Fail(ErrorCode::kUnsupported,
                      gltf.path + ": /extensionsRequired/" + std::to_string(index) + ": " +
                          QuoteForMessage(name) +
                          " is required and not known here; export the file without it");
      }
      ++index;
    });
  }
  if (!problem.text.empty()) return Fail(ErrorCode::kCorruptData, gltf.path + ": " + problem.text);
  return status;
}

// "%20" and the like; false if it is not complete.
bool DecodePercent(const std::string& uri, std::string* path) {
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      *path += uri[i];
      continue;
    }
    const auto hex = [&](size_t at) {
      const char c = at < uri.size() ? uri[at] : '?';
      if (c >= '0' && c <= '9') return c - '0';
      if (c >= 'a' && c <= 'f') return c - 'a' + 10;
      return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
    };
    if (hex(i + 1) < 0 || hex(i + 2) < 0) return false;
    *path += static_cast<char>(hex(i + 1) * 16 + hex(i + 2));
    i += 2;
  }
  return true;
}

bool IsDataUri(const std::string& uri) { return uri.rfind("data:", 0) == 0; }

// A stretch of bytes of a file, or bytes of their own.
struct Bytes {
  std::string path;
  uint64_t offset = 0, size = 0;
  std::vector<uint8_t> own;
};

class ImageLister {
 public:
  explicit ImageLister(const GltfFile& gltf) : gltf_(gltf), root_(&gltf.json, &problem_) {}

  Result<std::vector<SceneImage>> Run() {
    std::vector<SceneImage> images;
    const JsonView list = root_.Optional("images");
    if (!list) return images;
    list.ForEach(kMaxSceneImages, [&](const JsonView& entry) {
      SceneImage image;
      image.pointer = "/images/" + std::to_string(images.size());
      if (auto status = Read(entry, &image); !status) image.problem = status.error();
      if (!problem_.text.empty()) image.problem = Error{ErrorCode::kCorruptData, problem_.text};
      problem_.text.clear();
      if (image.problem) {
        std::string& text = image.problem->message;
        if (text.find("/images/") != 0) text = image.pointer + ": " + text;
      }
      images.push_back(std::move(image));
    });
    // The list itself is no list, or too long.
    if (!problem_.text.empty())
      return Fail(ErrorCode::kCorruptData, gltf_.path + ": " + problem_.text);
    return images;
  }

 private:
  Status Read(const JsonView& entry, SceneImage* image) {
    std::string mime, uri;
    if (const JsonView view = entry.Optional("mimeType")) mime = view.String();
    const JsonView uri_view = entry.Optional("uri");
    const JsonView buffer_view = entry.Optional("bufferView");
    if (static_cast<bool>(uri_view) == static_cast<bool>(buffer_view)) {
      return Fail(ErrorCode::kCorruptData,
                  "needs either \"uri\" or \"bufferView\"; export the file again");
    }
    if (mime == "image/ktx2")
      return Fail(ErrorCode::kUnsupported,
                  "a KTX2 texture, which is not read; give the PNG or JPEG it was made from");
    if (!mime.empty() && mime != "image/png" && mime != "image/jpeg") {
      return Fail(ErrorCode::kUnsupported, "mimeType " + QuoteForMessage(mime) +
                                               " is neither image/png nor image/jpeg; give one");
    }
    if (uri_view) {
      uri = uri_view.String(size_t{2} * kMaxSceneImageBytes);
      PATINA_TRY(FromUri(uri, image));
    } else {
      PATINA_TRY(FromBufferView(buffer_view.Int(0, static_cast<int>(kMaxBufferViews)), image));
    }
    if (!problem_.text.empty()) return {};
    return CheckMagic(mime, image);
  }

  Status FromUri(const std::string& uri, SceneImage* image) {
    if (IsDataUri(uri)) {
      PATINA_ASSIGN(image->bytes, DecodeDataUri(uri));
      image->embedded = true;
      image->size = image->bytes.size();
      return {};
    }
    std::string relative;
    if (!DecodePercent(uri, &relative))
      return Fail(ErrorCode::kCorruptData, QuoteForMessage(uri) + " is no URI; write % as %25");
    auto path = PathInFolder(gltf_.folder, relative);
    if (!path && path.error().code == ErrorCode::kNotFound) {
      // Scenes are often passed on with their textures beside them and the old paths inside.
      const std::string name = fs::path(relative).filename().string();
      auto beside = name == relative ? path : PathInFolder(gltf_.folder, name);
      if (beside) {
        image->warning = relative + " is not there; " + name + " beside the scene is used.";
        path = std::move(beside);
        relative = name;
      }
    }
    if (!path) return Fail(path.error());
    image->path = std::move(*path);
    image->name = fs::path(relative).lexically_normal().generic_string();
    return {};
  }

  Status FromBufferView(int index, SceneImage* image) {
    const nlohmann::json* entry = Element("bufferViews", index);
    const std::string at = "/bufferViews/" + std::to_string(index);
    if (entry == nullptr)
      return Fail(ErrorCode::kCorruptData, "there is no " + at + "; export the file again");
    JsonProblem problem;
    const JsonView view(entry, &problem);
    const int buffer = view.Field("buffer").Int(0, static_cast<int>(kMaxBuffers));
    const uint64_t size = view.Field("byteLength").Unsigned();
    const JsonView offset_view = view.Optional("byteOffset");
    const uint64_t offset = offset_view ? offset_view.Unsigned() : 0;
    if (!problem.text.empty())
      return Fail(ErrorCode::kCorruptData, at + ": " + problem.text + "; export the file again");
    PATINA_ASSIGN(const Bytes* bytes, Buffer(buffer));
    if (size == 0 || offset > bytes->size || size > bytes->size - offset) {
      return Fail(ErrorCode::kCorruptData, at + ": bytes " + std::to_string(offset) + " to " +
                                               std::to_string(offset + size) + " of a buffer of " +
                                               std::to_string(bytes->size) +
                                               " bytes; export the file again");
    }
    if (size > kMaxSceneImageBytes) {
      return Fail(ErrorCode::kOutOfRange, at + ": an image of " + std::to_string(size) +
                                              " bytes, more than " +
                                              std::to_string(kMaxSceneImageBytes));
    }
    image->embedded = true;
    image->size = size;
    if (bytes->path.empty()) {
      const auto begin = bytes->own.begin() + static_cast<std::ptrdiff_t>(offset);
      image->bytes.assign(begin, begin + static_cast<std::ptrdiff_t>(size));
    } else {
      image->path = bytes->path;
      image->offset = bytes->offset + offset;
    }
    return {};
  }

  const nlohmann::json* Element(const char* list, int index) const {
    const auto found = gltf_.json.find(list);
    if (found == gltf_.json.end() || !found->is_array()) return nullptr;
    return static_cast<size_t>(index) < found->size() ? &(*found)[static_cast<size_t>(index)]
                                                      : nullptr;
  }

  // The bytes of a buffer, opened once.
  Result<const Bytes*> Buffer(int index) {
    const auto known = buffers_.find(index);
    if (known != buffers_.end()) return &known->second;
    const std::string at = "/buffers/" + std::to_string(index);
    const nlohmann::json* entry = Element("buffers", index);
    if (entry == nullptr)
      return Fail(ErrorCode::kCorruptData, "there is no " + at + "; export the file again");
    JsonProblem problem;
    const JsonView view(entry, &problem);
    const uint64_t length = view.Field("byteLength").Unsigned();
    const JsonView uri_view = view.Optional("uri");
    const std::string uri = uri_view ? uri_view.String(size_t{2} * kMaxSceneImageBytes) : "";
    if (!problem.text.empty()) return Fail(ErrorCode::kCorruptData, at + ": " + problem.text);
    Bytes bytes;
    uint64_t there = 0;
    if (!uri_view) {
      if (index != 0 || !gltf_.has_bin)
        return Fail(ErrorCode::kCorruptData, at + ": has no \"uri\" and there is no binary chunk");
      bytes.path = gltf_.path;
      bytes.offset = gltf_.bin_offset;
      there = gltf_.bin_size;
    } else if (IsDataUri(uri)) {
      auto own = DecodeDataUri(uri);
      if (!own) return Fail(own.error(), at);
      bytes.own = std::move(*own);
      there = bytes.own.size();
    } else {
      std::string relative;
      if (!DecodePercent(uri, &relative))
        return Fail(ErrorCode::kCorruptData, at + ": " + QuoteForMessage(uri) + " is no URI");
      auto path = PathInFolder(gltf_.folder, relative);
      if (!path) return Fail(path.error(), at);
      bytes.path = std::move(*path);
      std::error_code error;
      there = fs::file_size(bytes.path, error);
      if (error) return Fail(ErrorCode::kIo, at + ": cannot read " + bytes.path);
    }
    if (length > there) {
      return Fail(ErrorCode::kCorruptData, at + "/byteLength: " + std::to_string(length) +
                                               " bytes, but there are " + std::to_string(there) +
                                               "; export the file again");
    }
    bytes.size = length;
    return &buffers_.emplace(index, std::move(bytes)).first->second;
  }

  // What the first bytes are, against what the file says they are.
  Status CheckMagic(const std::string& mime, SceneImage* image) {
    uint8_t head[kMagicBytes] = {};
    size_t size = 0;
    if (image->path.empty()) {
      size = std::min(sizeof head, image->bytes.size());
      std::copy_n(image->bytes.begin(), size, head);
    } else {
      std::ifstream file(image->path, std::ios::binary);
      file.seekg(static_cast<std::streamoff>(image->offset));
      file.read(reinterpret_cast<char*>(head), sizeof head);
      size = static_cast<size_t>(file.gcount());
      if (image->embedded) size = std::min<size_t>(size, image->size);
    }
    const std::string extension = ImageExtensionOf(head, size);
    const std::string where = image->embedded ? "" : image->path + ": ";
    if (extension.empty()) return Fail(ErrorCode::kUnsupported, where + NotAnImageText(head, size));
    const bool png = extension == ".png";
    if (!mime.empty() && (mime == "image/png") != png) {
      return Fail(ErrorCode::kCorruptData, where + "mimeType says " + mime +
                                               ", but the image is a " + (png ? "PNG" : "JPEG") +
                                               "; correct the one or the other");
    }
    if (image->embedded) {
      image->name = fs::path(gltf_.path).filename().string() + image->pointer + extension;
    }
    return {};
  }

  const GltfFile& gltf_;
  JsonProblem problem_;
  JsonView root_;
  std::map<int, Bytes> buffers_;
};

}  // namespace

Result<GltfFile> OpenGltf(const std::string& path) {
  GltfFile gltf;
  gltf.path = path;
  const size_t slash = path.find_last_of('/');
  gltf.folder = slash == std::string::npos ? "" : slash == 0 ? "/" : path.substr(0, slash);
  std::error_code error;
  if (!fs::exists(path, error)) return Fail(ErrorCode::kNotFound, "there is no file " + path);
  if (!fs::is_regular_file(path, error))
    return Fail(ErrorCode::kInvalidArgument, path + " is not a file");
  const uint64_t size = fs::file_size(path, error);
  if (error) return Fail(ErrorCode::kIo, "cannot read " + path + ": " + error.message());
  std::ifstream file(path, std::ios::binary);
  char magic[4] = {};
  file.read(magic, sizeof magic);
  if (file.bad() || !file.is_open()) return Fail(ErrorCode::kIo, "cannot read " + path);
  std::string text;
  if (std::string_view(magic, sizeof magic) == "glTF") {
    if (size > kMaxSceneFileBytes) {
      return Fail(ErrorCode::kOutOfRange, path + ": " + std::to_string(size) +
                                              " bytes, more than a .glb can have; split the scene");
    }
    PATINA_ASSIGN(text, ReadGlb(path, size, &gltf));
  } else {
    PATINA_ASSIGN(text, ReadTextFile(path, kMaxSceneJsonBytes));
  }
  auto json = ParseStrictJson(text, kDeepestJson);
  if (!json)
    return Fail(ErrorCode::kCorruptData, path + ": " + json.error().message + "; export it again");
  gltf.json = std::move(*json);
  PATINA_TRY(CheckAsset(gltf));
  return gltf;
}

Result<std::vector<SceneImage>> ListGltfImages(const GltfFile& file) {
  return ImageLister(file).Run();
}

}  // namespace patina::scene_detail
