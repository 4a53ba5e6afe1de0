// Scene files in: what the materials of a glTF 2.0 file or of a scene file of our own are made of.
//
// Geometry, cameras and animation are passed over. A problem of one material does not hide the
// others: it stands in that material. Nothing is read from outside the folder of the scene's file,
// links that lead out of it included.
//
// Based on: glTF 2.0 specification (ISO/IEC 12113:2022) and the KHR_materials_* and
// KHR_texture_transform extensions.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "formats/base/result.h"

namespace patina {

inline constexpr uint64_t kMaxSceneJsonBytes = uint64_t{32} << 20;
inline constexpr uint64_t kMaxSceneFileBytes = uint64_t{4} << 30;  // of a .glb, images included
inline constexpr uint64_t kMaxSceneImageBytes = uint64_t{1} << 30;
inline constexpr size_t kMaxSceneMaterials = 4096;
inline constexpr size_t kMaxSceneImages = 16384;
inline constexpr int kMaxTexCoord = 15;

// KHR_texture_transform: what is done to a texture coordinate before the texture is read:
// translation * rotation * scale, rotation counter-clockwise in radians.
struct UvTransform {
  std::array<double, 2> offset = {0, 0};
  double rotation = 0;
  std::array<double, 2> scale = {1, 1};
  bool operator==(const UvTransform&) const = default;
};

enum class SceneWrap { kRepeat, kClamp, kMirror };
const char* SceneWrapName(SceneWrap wrap);  // "repeat", "clamp", "mirror"

// One texture slot of a material.
struct SceneBinding {
  std::string slot;               // "pbrMetallicRoughness.baseColorTexture", ...
  std::vector<std::string> maps;  // the roles that its channels have
  int tex_coord = 0;
  UvTransform transform;
  SceneWrap wrap_s = SceneWrap::kRepeat, wrap_t = SceneWrap::kRepeat;
};

// Which rule leaves a map out; see EffectSwitches of the job.
enum class ScenePrune { kNone, kAlpha, kUnlit, kUnused };

// One map of a material: a role, and the channels of an image.
struct SceneMap {
  std::string role;
  int image = -1;
  std::string channels;              // letters of "rgba", or empty: the image's first ones
  std::string color_space = "auto";  // "auto", "srgb", "linear", "raw"
  std::string convention = "auto";   // "auto", "opengl", "directx"
  bool invert = false;
  ScenePrune prune = ScenePrune::kNone;
  std::string unused;            // why the scene does not call for it
  std::vector<double> stand_in;  // what the map amounts to if it is left out; empty: nothing
};

// A value of a map: of one without a texture, or to be multiplied with the decoded one.
struct SceneValue {
  std::string map;
  std::vector<double> value;  // physical (linear); one or three numbers
  bool operator==(const SceneValue&) const = default;
};

// What the scene does not call for and has no texture, for the report.
struct SceneLeftOut {
  std::string what;
  std::string reason;
};

// Pixels of the screen that a metre of the surface takes, at most and at least, and how large the
// unit square of texture coordinates is: which mips are looked at.
struct TexelDensity {
  double uv_size_m = 1;
  double min_pixels_per_m = 0;
  double max_pixels_per_m = 0;
  bool operator==(const TexelDensity&) const = default;
};

// How a material looks that no texture can say. Reaches manifests.
struct SceneLook {
  std::string file;  // of the scene, without its folder
  std::string material;
  int index = 0;
  std::string alpha_mode = "opaque";  // "opaque", "mask", "blend"
  double alpha_cutoff = 0.5;
  bool double_sided = false;
  bool unlit = false;
  // Physical value of a map = decoded value * factor; maps that are not listed have 1.
  std::vector<SceneValue> factors;
  // What is no factor of a map: "normal_scale", "occlusion_strength", "ior", "dispersion", ...
  std::vector<SceneValue> parameters;
  std::vector<SceneBinding> bindings;
};

struct SceneMaterial {
  SceneLook look;
  std::string pointer;  // JSON pointer of the material
  std::string asset;    // a legal asset name, unique in the scene
  std::vector<SceneMap> maps;
  std::vector<SceneValue> constants;  // of maps without a texture
  std::vector<SceneLeftOut> left_out;
  bool clamp = false;  // address mode of the container: clamp, else wrap
  std::optional<std::array<int, 2>> lod_range;
  std::optional<TexelDensity> density;
  std::vector<std::string> warnings;  // complete sentences
  std::optional<Error> problem;       // why it cannot be baked
};

// An image of a scene: a file, or a part of one.
struct SceneImage {
  std::string pointer;
  std::string path;  // of the file, or of the file that holds it; empty if in `bytes`
  std::string name;  // for manifests: relative to the scene's folder, or "scene.glb/images/0.png"
  bool embedded = false;
  uint64_t offset = 0, size = 0;  // in `path`, if embedded
  std::vector<uint8_t> bytes;     // of a data URI
  std::string warning;            // a complete sentence, for those who use it
  std::optional<Error> problem;
};

struct Scene {
  std::string path;
  std::string name;  // the file's name without extensions, as an asset name
  std::vector<SceneImage> images;
  std::vector<SceneMaterial> materials;
  std::vector<std::string> warnings;
};

// Whether the name is that of a scene: *.gltf, *.glb (in any case), *.patina.json.
bool IsSceneFileName(const std::string& name);

// Errors, with file and JSON pointer, of the scene as a whole: kNotFound, kIo, kOutOfRange (sizes
// and counts above the limits), kCorruptData (not JSON or not a .glb, wrong types), kUnsupported
// (not glTF 2.x, a required extension that is not known, a newer scene file).
Result<Scene> ReadScene(const std::string& path);

// The file of an image. Errors: the image's problem, kIo, kCorruptData.
Result<std::vector<uint8_t>> ReadSceneImage(const SceneImage& image);

}  // namespace patina
