// Scene files of our own, *.patina.json: schemas/scene.schema.json.
#include <algorithm>
#include <filesystem>
#include <map>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/base/strict_json.h"
#include "formats/json_view.h"
#include "formats/scene/scene_reading.h"

namespace patina::scene_detail {
namespace {

using Json = nlohmann::json;

constexpr int kDeepestJson = 16;
constexpr int kSceneFileVersion = 1;
constexpr size_t kMaxMaps = 64;

// Reads one material; what is wrong with it stands in it.
class MaterialReader {
 public:
  MaterialReader(const std::string& path, const std::string& folder, const Json& json, int index,
                 Scene* scene)
      : path_(path), folder_(folder), json_(json), view_(&json, &problem_), scene_(scene) {
    material_.look.index = index;
    material_.pointer = "/materials/" + std::to_string(index);
  }

  SceneMaterial Run() {
    Complain(UnknownMember(json_, "",
                           {"name", "maps", "constants", "uses", "alpha_mode", "alpha_cutoff",
                            "double_sided", "unlit", "address", "lod_range", "texel_density"}));
    material_.look.material = view_.Field("name").String(255);
    if (view_ && material_.look.material.empty()) Complain("/name: is empty");
    if (const JsonView maps = view_.Optional("maps")) {
      size_t index = 0;
      maps.ForEach(kMaxMaps, [&](const JsonView& map) {
        ReadMap(map, json_["maps"][index], "/maps/" + std::to_string(index));
        ++index;
      });
    }
    if (const JsonView constants = view_.Optional("constants")) ReadConstants(constants);
    if (material_.maps.empty() && material_.constants.empty() && problem_.text.empty())
      Complain(": has neither \"maps\" nor \"constants\"; give one");
    ReadLook();
    ReadRange();
    ReadUses();
    Prune();
    if (!problem_.text.empty()) {
      constexpr std::string_view kRoot = "document root";  // here: the material
      if (problem_.text.rfind(kRoot, 0) == 0) problem_.text.erase(0, kRoot.size());
      material_.problem =
          Error{ErrorCode::kInvalidArgument, path_ + ": " + material_.pointer + problem_.text +
                                                 " (see schemas/scene.schema.json)"};
    } else if (file_problem_) {
      material_.problem = file_problem_;
    }
    return std::move(material_);
  }

 private:
  void Complain(const std::string& text) {
    if (problem_.text.empty()) problem_.text = text;
  }

  std::string Choice(const JsonView& object, const char* key,
                     std::initializer_list<const char*> choices, const std::string& pointer = "") {
    const JsonView value = object.Optional(key);
    if (!value) return *choices.begin();
    const std::string text = value.String();
    std::string list;
    for (const char* choice : choices) {
      if (text == choice) return text;
      list += (list.empty() ? "" : ", ") + std::string(choice);
    }
    Complain(pointer + "/" + key + ": " + QuoteForMessage(text) + " is not one of: " + list);
    return *choices.begin();
  }

  void ReadMap(const JsonView& view, const Json& json, const std::string& at) {
    Complain(UnknownMember(json, at,
                           {"role", "file", "channels", "color_space", "convention", "invert"}));
    SceneMap map;
    map.role = view.Field("role").String(64);
    const std::string file = view.Field("file").String();
    if (view && map.role.empty()) Complain(at + "/role: is empty");
    if (const JsonView channels = view.Optional("channels")) {
      map.channels = channels.String();
      if (map.channels.empty() || map.channels.size() > 4 ||
          map.channels.find_first_not_of("rgba") != std::string::npos)
        Complain(at + "/channels: must be 1 to 4 of the letters r, g, b and a");
    }
    map.color_space = Choice(view, "color_space", {"auto", "srgb", "linear", "raw"}, at);
    map.convention = Choice(view, "convention", {"auto", "opengl", "directx"}, at);
    if (const JsonView invert = view.Optional("invert")) map.invert = invert.Bool();
    if (!problem_.text.empty()) return;
    for (const SceneMap& other : material_.maps) {
      if (other.role == map.role)
        Complain(at + "/role: " + QuoteForMessage(map.role) + " is given twice; keep one");
    }
    map.image = ImageOf(file, at);
    SceneBinding binding;
    binding.slot = "maps/" + std::to_string(material_.maps.size());
    binding.maps = {map.role};
    material_.look.bindings.push_back(std::move(binding));
    material_.maps.push_back(std::move(map));
  }

  // The image of that file, each file once.
  int ImageOf(const std::string& file, const std::string& at) {
    auto& images = scene_->images;
    const std::string name = std::filesystem::path(file).lexically_normal().generic_string();
    size_t index = 0;
    while (index < images.size() && images[index].name != name) ++index;
    if (index == images.size()) {
      SceneImage image;
      image.pointer = material_.pointer + at + "/file";
      image.name = name;
      auto path = PathInFolder(folder_, file);
      if (path) {
        image.path = std::move(*path);
      } else {
        image.problem = path.error();
      }
      images.push_back(std::move(image));
    }
    if (const auto& problem = images[index].problem; problem && !file_problem_) {
      file_problem_ = Error{problem->code,
                            path_ + ": " + material_.pointer + at + "/file: " + problem->message};
    }
    return static_cast<int>(index);
  }

  void ReadConstants(const JsonView& view) {
    const Json& json = json_["constants"];
    if (!json.is_object()) return Complain("/constants: must be an object of values by role");
    for (const auto& [role, entry] : json.items()) {
      SceneValue value;
      value.map = role;
      const JsonView number = view.Optional(role.c_str());
      if (entry.is_array()) {
        number.ForEach(3, [&](const JsonView& v) { value.value.push_back(v.Float()); });
        if (value.value.size() != 3) Complain("/constants/" + role + ": must have three numbers");
      } else {
        value.value.push_back(number.Float());
      }
      for (const SceneMap& map : material_.maps) {
        if (map.role == role)
          Complain("/constants/" + role + ": this map is in \"maps\", too; keep one");
      }
      material_.constants.push_back(std::move(value));
    }
  }

  void ReadLook() {
    SceneLook& look = material_.look;
    const bool cut_out = std::any_of(material_.maps.begin(), material_.maps.end(),
                                     [](const SceneMap& map) { return map.role == "opacity"; });
    look.alpha_mode = view_.Optional("alpha_mode")
                          ? Choice(view_, "alpha_mode", {"opaque", "mask", "blend"})
                      : cut_out ? "mask"
                                : "opaque";
    if (const JsonView cutoff = view_.Optional("alpha_cutoff")) {
      look.alpha_cutoff = cutoff.Number();
      if (!(look.alpha_cutoff >= 0 && look.alpha_cutoff <= 1))
        Complain("/alpha_cutoff: must be between 0 and 1");
    }
    if (const JsonView sided = view_.Optional("double_sided")) look.double_sided = sided.Bool();
    if (const JsonView unlit = view_.Optional("unlit")) look.unlit = unlit.Bool();
    material_.clamp = Choice(view_, "address", {"wrap", "clamp"}) == "clamp";
    for (SceneBinding& binding : look.bindings)
      binding.wrap_s = binding.wrap_t = material_.clamp ? SceneWrap::kClamp : SceneWrap::kRepeat;
  }

  void ReadRange() {
    const JsonView range = view_.Optional("lod_range");
    const JsonView density = view_.Optional("texel_density");
    if (range && density)
      return Complain("/texel_density: stands beside \"lod_range\", which says the same; keep one");
    if (range) {
      std::vector<int> mips;
      range.ForEach(2, [&](const JsonView& mip) { mips.push_back(mip.Int(0, 31)); });
      if (mips.size() != 2 || mips[0] > mips[1])
        return Complain("/lod_range: must be two whole numbers, the smaller one first");
      material_.lod_range = {mips[0], mips[1]};
    }
    if (density) {
      Complain(
          UnknownMember(json_["texel_density"], "/texel_density", {"uv_size_m", "pixels_per_m"}));
      TexelDensity read;
      read.uv_size_m = density.Field("uv_size_m").Number();
      std::vector<double> pixels;
      density.Field("pixels_per_m").ForEach(2, [&](const JsonView& v) {
        pixels.push_back(v.Number());
      });
      if (!(read.uv_size_m > 0 && read.uv_size_m <= 1e6))
        return Complain("/texel_density/uv_size_m: must be above 0 and at most 1000000");
      if (pixels.size() != 2 || !(pixels[0] > 0) || !(pixels[1] >= pixels[0]) || pixels[1] > 1e9)
        return Complain(
            "/texel_density/pixels_per_m: must be two numbers above 0, the smaller first");
      read.min_pixels_per_m = pixels[0];
      read.max_pixels_per_m = pixels[1];
      material_.density = read;
    }
  }

  void ReadUses() {
    const JsonView view = view_.Optional("uses");
    if (!view) return;
    std::vector<std::string> uses;
    view.ForEach(kMaxMaps, [&](const JsonView& role) { uses.push_back(role.String(64)); });
    const auto used = [&](const std::string& role) {
      return std::find(uses.begin(), uses.end(), role) != uses.end();
    };
    for (size_t i = 0; i < uses.size(); ++i) {
      const bool there = std::any_of(material_.maps.begin(), material_.maps.end(),
                                     [&](const SceneMap& map) { return map.role == uses[i]; }) ||
                         std::any_of(material_.constants.begin(), material_.constants.end(),
                                     [&](const SceneValue& value) { return value.map == uses[i]; });
      if (!there)
        Complain("/uses/" + std::to_string(i) + ": " + QuoteForMessage(uses[i]) +
                 " is neither in \"maps\" nor in \"constants\"");
    }
    constexpr const char* kReason = "it is not in \"uses\"";
    for (SceneMap& map : material_.maps) {
      if (used(map.role)) continue;
      map.prune = ScenePrune::kUnused;
      map.unused = kReason;
    }
    std::erase_if(material_.constants, [&](const SceneValue& value) {
      if (used(value.map)) return false;
      material_.left_out.push_back({value.map, kReason});
      return true;
    });
  }

  void Prune() {
    for (SceneMap& map : material_.maps) {
      if (map.prune != ScenePrune::kNone) continue;
      if (map.role == "opacity" && material_.look.alpha_mode == "opaque") {
        map.prune = ScenePrune::kAlpha;
        map.unused = "alpha_mode is opaque";
      } else if (material_.look.unlit && map.role != "albedo" && map.role != "opacity") {
        map.prune = ScenePrune::kUnlit;
        map.unused = "the material is unlit";
      }
    }
  }

  const std::string& path_;
  const std::string& folder_;
  const Json& json_;
  JsonProblem problem_;
  JsonView view_;
  Scene* scene_;
  SceneMaterial material_;
  std::optional<Error> file_problem_;
};

}  // namespace

Result<Scene> ReadSceneFile(const std::string& path) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, kMaxSceneJsonBytes));
  auto parsed = ParseStrictJson(text, kDeepestJson);
  if (!parsed) return Fail(parsed.error(), path);
  const Json& json = *parsed;
  JsonProblem problem;
  const JsonView root(&json, &problem);
  const int version = root.Field("version").Int(1, 1 << 30);
  const auto fail = [&](const std::string& what) {
    return Fail(ErrorCode::kInvalidArgument,
                path + ": " + what + " (see schemas/scene.schema.json)");
  };
  if (!problem.text.empty()) return fail(problem.text);
  if (version > kSceneFileVersion) {
    return Fail(ErrorCode::kUnsupported, path + ": /version: " + std::to_string(version) +
                                             " is newer than this program; use a newer patina");
  }
  for (const auto& [key, value] : json.items()) {
    if (key != "version" && key != "materials")
      return fail("/" + EscapePointer(key) +
                  ": is not a field of a scene; fields: version, materials");
  }
  const auto list = json.find("materials");
  if (list == json.end() || !list->is_array() || list->empty())
    return fail("/materials: must be an array with an element");
  if (list->size() > kMaxSceneMaterials) {
    return Fail(ErrorCode::kOutOfRange,
                path + ": /materials: " + std::to_string(list->size()) + " materials, more than " +
                    std::to_string(kMaxSceneMaterials) + "; split the scene");
  }
  const size_t slash = path.find_last_of('/');
  const std::string folder = slash == std::string::npos ? ""
                             : slash == 0               ? "/"
                                                        : path.substr(0, slash);
  Scene scene;
  for (size_t i = 0; i < list->size(); ++i) {
    scene.materials.push_back(
        MaterialReader(path, folder, (*list)[i], static_cast<int>(i), &scene).Run());
  }
  return scene;
}

}  // namespace patina::scene_detail
