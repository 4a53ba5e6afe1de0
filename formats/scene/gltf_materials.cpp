// What the materials of a glTF file are made of: texture slots, factors and parameters of the core
// and of the KHR_materials extensions, in one pass over each material.
#include <algorithm>
#include <map>
#include <utility>

#include "formats/base/names.h"
#include "formats/scene/gltf_file.h"
#include "formats/scene/scene_reading.h"

namespace patina::scene_detail {
namespace {

constexpr int kRepeat = 10497, kClampToEdge = 33071, kMirroredRepeat = 33648;
constexpr int kNearest = 9728, kNearestMipmapNearest = 9984, kNearestMipmapLinear = 9986;
constexpr int kMaxIndex = 1 << 24;

// A role and the channels of a texture that hold it.
struct Part {
  const char* role;
  const char* channels;
};

bool IsColorRole(const std::string& role) {
  for (const char* color :
       {"albedo", "emissive", "sheen_color", "specular_color", "translucency_color"}) {
    if (role == color) return true;
  }
  return false;
}

bool IsZero(const std::vector<double>& value) {
  return std::all_of(value.begin(), value.end(), [](double v) { return v == 0; });
}

class MaterialReader {
 public:
  MaterialReader(const GltfFile& gltf, const std::vector<SceneImage>& images,
                 const nlohmann::json& entry, int index)
      : gltf_(gltf), images_(images), view_(&entry, &problem_) {
    material_.look.index = index;
    material_.pointer = "/materials/" + std::to_string(index);
  }

  SceneMaterial Run() {
    if (const JsonView name = view_.Optional("name")) material_.look.material = name.String();
    if (const JsonView sided = view_.Optional("doubleSided"))
      material_.look.double_sided = sided.Bool();
    ReadAlpha();
    ReadCore();
    const JsonView extensions = view_.Optional("extensions");
    if (extensions) ReadExtensions(extensions);
    Settle();
    if (!problem_.text.empty()) {
      constexpr std::string_view kRoot = "document root";  // here: the material
      if (problem_.text.rfind(kRoot, 0) == 0) problem_.text.erase(0, kRoot.size());
      Refuse(ErrorCode::kCorruptData, material_.pointer + problem_.text);
    }
    return std::move(material_);
  }

 private:
  void Refuse(ErrorCode code, const std::string& message) {
    if (!material_.problem) material_.problem = Error{code, gltf_.path + ": " + message};
  }

  // ---- values ----

  std::vector<double> Vector(const JsonView& object, const char* key,
                             std::vector<double> otherwise) {
    const JsonView value = object.Optional(key);
    if (!value) return otherwise;
    std::vector<double> read;
    value.ForEach(otherwise.size(), [&](const JsonView& v) { read.push_back(FiniteNumber(v)); });
    if (read.size() != otherwise.size() && problem_.text.empty()) {
      problem_.text =
          std::string("/") + key + ": needs " + std::to_string(otherwise.size()) + " numbers";
      return otherwise;
    }
    return read;
  }

  static double FiniteNumber(const JsonView& value) {
    value.Float();  // reports what no float can hold
    return value.Number();
  }

  void Factor(const std::string& role, std::vector<double> value) {
    for (const double v : value) {
      if (v < 0)
        Refuse(ErrorCode::kCorruptData,
               material_.pointer + ": the factor of " + role + " is negative; export it again");
    }
    factors_[role] = std::move(value);
    order_.push_back(role);
  }

  void Parameter(const std::string& name, std::vector<double> value) {
    material_.look.parameters.push_back({name, std::move(value)});
  }

  // ---- textures ----

  // Reads a textureInfo, if it is there, and adds its maps. Returns it, for what else it holds.
  JsonView Texture(const JsonView& object, const char* owner, const char* key,
                   std::initializer_list<Part> parts) {
    const JsonView info = object.Optional(key);
    if (!info) return info;
    SceneBinding binding;
    binding.slot = std::string(owner).empty() ? key : std::string(owner) + "." + key;
    const int texture = info.Field("index").Int(0, kMaxIndex);
    if (const JsonView coord = info.Optional("texCoord"))
      binding.tex_coord = coord.Int(0, kMaxTexCoord);
    if (const JsonView extensions = info.Optional("extensions")) {
      if (const JsonView transform = extensions.Optional("KHR_texture_transform"))
        ReadTransform(transform, &binding);
    }
    const int image = ResolveTexture(texture, binding.slot, &binding);
    for (const Part& part : parts) {
      binding.maps.push_back(part.role);
      SceneMap map;
      map.role = part.role;
      map.image = image;
      map.channels = part.channels;
      map.color_space = IsColorRole(part.role) ? "srgb" : "raw";
      map.convention = "opengl";
      material_.maps.push_back(std::move(map));
    }
    material_.look.bindings.push_back(std::move(binding));
    return info;
  }

  void ReadTransform(const JsonView& transform, SceneBinding* binding) {
    const std::vector<double> offset = Vector(transform, "offset", {0, 0});
    const std::vector<double> scale = Vector(transform, "scale", {1, 1});
    std::copy(offset.begin(), offset.end(), binding->transform.offset.begin());
    std::copy(scale.begin(), scale.end(), binding->transform.scale.begin());
    if (const JsonView rotation = transform.Optional("rotation"))
      binding->transform.rotation = FiniteNumber(rotation);
    if (const JsonView coord = transform.Optional("texCoord"))
      binding->tex_coord = coord.Int(0, kMaxTexCoord);
  }

  const nlohmann::json* Element(const char* list, int index) const {
    const auto found = gltf_.json.find(list);
    if (found == gltf_.json.end() || !found->is_array()) return nullptr;
    return static_cast<size_t>(index) < found->size() ? &(*found)[static_cast<size_t>(index)]
                                                      : nullptr;
  }

  // The image of a texture, or -1 and the problem of the material.
  int ResolveTexture(int index, const std::string& slot, SceneBinding* binding) {
    if (!problem_.text.empty()) return -1;
    const std::string from = material_.pointer + ": " + slot + ": ";
    const std::string at = "/textures/" + std::to_string(index);
    const nlohmann::json* texture = Element("textures", index);
    if (texture == nullptr) {
      Refuse(ErrorCode::kCorruptData, from + "there is no " + at + "; export the file again");
      return -1;
    }
    JsonProblem problem;
    const JsonView view(texture, &problem);
    const JsonView source = view.Optional("source");
    const int image = source ? source.Int(0, kMaxIndex) : -1;
    if (const JsonView sampler = view.Optional("sampler"))
      ReadSampler(sampler.Int(0, kMaxIndex), from, slot, binding);
    std::string other;
    if (const JsonView extensions = view.Optional("extensions")) {
      for (const char* name :
           {"KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds"}) {
        if (extensions.Optional(name)) other = name;
      }
    }
    if (!problem.text.empty()) {
      Refuse(ErrorCode::kCorruptData, from + at + problem.text);
      return -1;
    }
    if (image < 0) {
      const std::string what = other == "KHR_texture_basisu"
                                   ? "is a KTX2 texture, which is not read"
                               : other.empty() ? "has no \"source\""
                                               : "is a texture of " + other + ", which is not read";
      Refuse(other.empty() ? ErrorCode::kCorruptData : ErrorCode::kUnsupported,
             from + at + ": " + what + "; give a PNG or JPEG as its \"source\"");
      return -1;
    }
    if (static_cast<size_t>(image) >= images_.size()) {
      Refuse(ErrorCode::kCorruptData, from + at + "/source: there is no /images/" +
                                          std::to_string(image) + "; export the file again");
      return -1;
    }
    const SceneImage& found = images_[static_cast<size_t>(image)];
    if (found.problem) Refuse(found.problem->code, from + found.problem->message);
    if (!found.warning.empty()) WarnOnce(found.warning);
    return image;
  }

  void ReadSampler(int index, const std::string& from, const std::string& slot,
                   SceneBinding* binding) {
    const nlohmann::json* sampler = Element("samplers", index);
    const std::string at = "/samplers/" + std::to_string(index);
    if (sampler == nullptr)
      return Refuse(ErrorCode::kCorruptData, from + "there is no " + at + "; export it again");
    JsonProblem problem;
    const JsonView view(sampler, &problem);
    const auto wrap = [&](const char* key) {
      const JsonView value = view.Optional(key);
      const int mode = value ? value.Int(0, 65535) : kRepeat;
      if (mode == kClampToEdge) return SceneWrap::kClamp;
      if (mode == kMirroredRepeat) return SceneWrap::kMirror;
      if (mode != kRepeat && problem.text.empty())
        problem.text = std::string("/") + key + ": " + std::to_string(mode) + " is no wrap mode";
      return SceneWrap::kRepeat;
    };
    binding->wrap_s = wrap("wrapS");
    binding->wrap_t = wrap("wrapT");
    for (const char* key : {"magFilter", "minFilter"}) {
      const JsonView value = view.Optional(key);
      const int filter = value ? value.Int(0, 65535) : 0;
      if (filter == kNearest || filter == kNearestMipmapNearest || filter == kNearestMipmapLinear)
        WarnOnce(slot + ": its sampler takes the nearest texel; the container is filtered.");
    }
    if (!problem.text.empty()) Refuse(ErrorCode::kCorruptData, from + at + problem.text);
  }

  void WarnOnce(const std::string& warning) {
    auto& warnings = material_.warnings;
    if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end())
      warnings.push_back(warning);
  }

  // ---- the core ----

  void ReadAlpha() {
    if (const JsonView mode = view_.Optional("alphaMode")) {
      const std::string name = mode.String();
      if (name == "MASK") {
        material_.look.alpha_mode = "mask";
      } else if (name == "BLEND") {
        material_.look.alpha_mode = "blend";
      } else if (name != "OPAQUE" && problem_.text.empty()) {
        problem_.text =
            "/alphaMode: " + QuoteForMessage(name) + " is none of OPAQUE, MASK and BLEND";
      }
    }
    material_.look.alpha_cutoff = 0.5;
    if (const JsonView cutoff = view_.Optional("alphaCutoff"))
      material_.look.alpha_cutoff = FiniteNumber(cutoff);
  }

  void ReadCore() {
    static const nlohmann::json kEmpty = nlohmann::json::object();
    const JsonView given = view_.Optional("pbrMetallicRoughness");
    const JsonView pbr = given ? given : JsonView(&kEmpty, &problem_);
    const std::vector<double> base = Vector(pbr, "baseColorFactor", {1, 1, 1, 1});
    Factor("albedo", {base[0], base[1], base[2]});
    Factor("opacity", {base[3]});
    Factor("metalness", {Number(pbr, "metallicFactor", 1)});
    Factor("roughness", {Number(pbr, "roughnessFactor", 1)});
    constexpr const char* kPbr = "pbrMetallicRoughness";
    Texture(pbr, kPbr, "baseColorTexture", {{"albedo", "rgb"}, {"opacity", "a"}});
    Texture(pbr, kPbr, "metallicRoughnessTexture", {{"roughness", "g"}, {"metalness", "b"}});
    if (const JsonView normal = Texture(view_, "", "normalTexture", {{"normal", "rgb"}})) {
      const double scale = Number(normal, "scale", 1);
      if (scale != 1) Parameter("normal_scale", {scale});
    }
    if (const JsonView occlusion = Texture(view_, "", "occlusionTexture", {{"ao", "r"}})) {
      const double strength = Number(occlusion, "strength", 1);
      if (strength != 1) Parameter("occlusion_strength", {strength});
      if (strength == 0) Drop({"ao"}, ScenePrune::kUnused, "occlusionTexture.strength is 0");
    }
    Texture(view_, "", "emissiveTexture", {{"emissive", "rgb"}});
    Factor("emissive", Vector(view_, "emissiveFactor", {0, 0, 0}));
  }

  double Number(const JsonView& object, const char* key, double otherwise) {
    const JsonView value = object.Optional(key);
    return value ? FiniteNumber(value) : otherwise;
  }

  // ---- extensions ----

  void ReadExtensions(const JsonView& extensions) {
    ReadCoat(extensions);
    ReadSheen(extensions);
    ReadAnisotropy(extensions);
    ReadIridescence(extensions);
    ReadTransmission(extensions);
    ReadSpecular(extensions);
    if (const JsonView strength = extensions.Optional("KHR_materials_emissive_strength")) {
      for (double& v : factors_["emissive"]) v *= Number(strength, "emissiveStrength", 1);
    }
    if (const JsonView ior = extensions.Optional("KHR_materials_ior"))
      Parameter("ior", {Number(ior, "ior", 1.5)});
    if (const JsonView dispersion = extensions.Optional("KHR_materials_dispersion"))
      Parameter("dispersion", {Number(dispersion, "dispersion", 0)});
    material_.look.unlit = static_cast<bool>(extensions.Optional("KHR_materials_unlit"));
    if (extensions.Optional("KHR_materials_pbrSpecularGlossiness")) {
      WarnOnce(
          "KHR_materials_pbrSpecularGlossiness is not read: the material is baked by its metallic "
          "and roughness values.");
    }
  }

  void ReadCoat(const JsonView& extensions) {
    constexpr const char* kName = "KHR_materials_clearcoat";
    const JsonView coat = extensions.Optional(kName);
    if (!coat) return;
    Factor("clearcoat", {Number(coat, "clearcoatFactor", 0)});
    Factor("clearcoat_roughness", {Number(coat, "clearcoatRoughnessFactor", 0)});
    Texture(coat, kName, "clearcoatTexture", {{"clearcoat", "r"}});
    Texture(coat, kName, "clearcoatRoughnessTexture", {{"clearcoat_roughness", "g"}});
    if (const JsonView normal =
            Texture(coat, kName, "clearcoatNormalTexture", {{"clearcoat_normal", "rgb"}})) {
      const double scale = Number(normal, "scale", 1);
      if (scale != 1) Parameter("clearcoat_normal_scale", {scale});
    }
    DropIfZero("clearcoat", {"clearcoat", "clearcoat_roughness", "clearcoat_normal"},
               "clearcoatFactor is 0");
  }

  void ReadSheen(const JsonView& extensions) {
    constexpr const char* kName = "KHR_materials_sheen";
    const JsonView sheen = extensions.Optional(kName);
    if (!sheen) return;
    Factor("sheen_color", Vector(sheen, "sheenColorFactor", {0, 0, 0}));
    Factor("sheen_roughness", {Number(sheen, "sheenRoughnessFactor", 0)});
    Texture(sheen, kName, "sheenColorTexture", {{"sheen_color", "rgb"}});
    Texture(sheen, kName, "sheenRoughnessTexture", {{"sheen_roughness", "a"}});
    DropIfZero("sheen_color", {"sheen_color", "sheen_roughness"}, "sheenColorFactor is 0");
  }

  void ReadAnisotropy(const JsonView& extensions) {
    constexpr const char* kName = "KHR_materials_anisotropy";
    const JsonView anisotropy = extensions.Optional(kName);
    if (!anisotropy) return;
    Factor("anisotropy", {Number(anisotropy, "anisotropyStrength", 0)});
    const double rotation = Number(anisotropy, "anisotropyRotation", 0);
    Texture(anisotropy, kName, "anisotropyTexture",
            {{"anisotropy_direction", "rg"}, {"anisotropy", "b"}});
    const bool off =
        DropIfZero("anisotropy", {"anisotropy", "anisotropy_direction"}, "anisotropyStrength is 0");
    if (rotation != 0 && !off) Parameter("anisotropy_rotation", {rotation});
  }

  void ReadIridescence(const JsonView& extensions) {
    constexpr const char* kName = "KHR_materials_iridescence";
    const JsonView film = extensions.Optional(kName);
    if (!film) return;
    Factor("iridescence", {Number(film, "iridescenceFactor", 0)});
    Texture(film, kName, "iridescenceTexture", {{"iridescence", "r"}});
    Texture(film, kName, "iridescenceThicknessTexture", {{"iridescence_thickness", "g"}});
    if (DropIfZero("iridescence", {"iridescence", "iridescence_thickness"},
                   "iridescenceFactor is 0"))
      return;
    Parameter("iridescence_ior", {Number(film, "iridescenceIor", 1.3)});
    Parameter("iridescence_thickness_nm", {Number(film, "iridescenceThicknessMinimum", 100),
                                           Number(film, "iridescenceThicknessMaximum", 400)});
  }

  void ReadTransmission(const JsonView& extensions) {
    constexpr const char* kName = "KHR_materials_transmission";
    constexpr const char* kDiffuse = "KHR_materials_diffuse_transmission";
    constexpr const char* kVolume = "KHR_materials_volume";
    if (const JsonView transmission = extensions.Optional(kName)) {
      Factor("transmission", {Number(transmission, "transmissionFactor", 0)});
      Texture(transmission, kName, "transmissionTexture", {{"transmission", "r"}});
      DropIfZero("transmission", {"transmission"}, "transmissionFactor is 0");
    }
    if (const JsonView diffuse = extensions.Optional(kDiffuse)) {
      Factor("translucency", {Number(diffuse, "diffuseTransmissionFactor", 0)});
      Factor("translucency_color", Vector(diffuse, "diffuseTransmissionColorFactor", {1, 1, 1}));
      Texture(diffuse, kDiffuse, "diffuseTransmissionTexture", {{"translucency", "a"}});
      Texture(diffuse, kDiffuse, "diffuseTransmissionColorTexture",
              {{"translucency_color", "rgb"}});
      DropIfZero("translucency", {"translucency", "translucency_color"},
                 "diffuseTransmissionFactor is 0");
    }
    if (const JsonView volume = extensions.Optional(kVolume)) {
      Factor("thickness", {Number(volume, "thicknessFactor", 0)});
      Texture(volume, kVolume, "thicknessTexture", {{"thickness", "g"}});
      const bool thin = DropIfZero("thickness", {"thickness"}, "thicknessFactor is 0");
      if (thin) return;
      if (volume.Optional("attenuationDistance"))
        Parameter("attenuation_distance", {Number(volume, "attenuationDistance", 0)});
      Parameter("attenuation_color", Vector(volume, "attenuationColor", {1, 1, 1}));
    }
  }

  void ReadSpecular(const JsonView& extensions) {
    constexpr const char* kName = "KHR_materials_specular";
    const JsonView specular = extensions.Optional(kName);
    if (!specular) return;
    Factor("specular", {Number(specular, "specularFactor", 1)});
    Factor("specular_color", Vector(specular, "specularColorFactor", {1, 1, 1}));
    Texture(specular, kName, "specularTexture", {{"specular", "a"}});
    Texture(specular, kName, "specularColorTexture", {{"specular_color", "rgb"}});
  }

  // ---- what the scene does not call for ----

  bool DropIfZero(const std::string& gate, std::initializer_list<const char*> roles,
                  const std::string& reason) {
    if (!IsZero(factors_[gate])) return false;
    Drop(roles, ScenePrune::kUnused, reason);
    return true;
  }

  void Drop(std::initializer_list<const char*> roles, ScenePrune prune, const std::string& reason) {
    for (const char* role : roles) dropped_.emplace(role, std::pair(prune, reason));
  }

  // From factors and textures to maps, factors to multiply, and constants.
  void Settle() {
    SceneLook& look = material_.look;
    if (look.alpha_mode == "opaque") Drop({"opacity"}, ScenePrune::kAlpha, "alphaMode is OPAQUE");
    if (look.unlit) {
      for (const SceneMap& map : material_.maps) {
        if (map.role != "albedo" && map.role != "opacity")
          Drop({map.role.c_str()}, ScenePrune::kUnlit, "the material is unlit");
      }
      for (const std::string& role : order_) {
        if (role != "albedo" && role != "opacity")
          Drop({role.c_str()}, ScenePrune::kUnlit, "the material is unlit");
      }
    }
    if (IsZero(factors_["emissive"]))
      Drop({"emissive"}, ScenePrune::kUnused, "emissiveFactor is 0");
    for (SceneMap& map : material_.maps) {
      const auto dropped = dropped_.find(map.role);
      const auto factor = factors_.find(map.role);
      if (dropped != dropped_.end()) {
        map.prune = dropped->second.first;
        map.unused = dropped->second.second;
      } else if (factor != factors_.end() && IsZero(factor->second)) {
        map.prune = ScenePrune::kUnused;
        map.unused = "its factor is 0";
        map.stand_in = factor->second;
      }
    }
    for (const std::string& role : order_) {
      const std::vector<double>& value = factors_[role];
      const bool textured = std::any_of(material_.maps.begin(), material_.maps.end(),
                                        [&](const SceneMap& map) { return map.role == role; });
      const auto dropped = dropped_.find(role);
      if (textured) {
        if (std::any_of(value.begin(), value.end(), [](double v) { return v != 1; }))
          look.factors.push_back({role, value});
      } else if (dropped == dropped_.end()) {
        material_.constants.push_back({role, value});
      } else if (!(role == "opacity" || role == "emissive")) {
        material_.left_out.push_back({role, dropped->second.second});
      }
    }
    ChooseAddress();
  }

  // One address mode for all textures. Where they differ, repeating is kept: a clamped texture
  // whose coordinates stay inside looks the same, a repeated one that is clamped does not.
  void ChooseAddress() {
    bool any_repeat = false, any_clamp = false, any_mirror = false;
    for (const SceneBinding& binding : material_.look.bindings) {
      for (const SceneWrap wrap : {binding.wrap_s, binding.wrap_t}) {
        any_repeat = any_repeat || wrap == SceneWrap::kRepeat;
        any_clamp = any_clamp || wrap == SceneWrap::kClamp;
        any_mirror = any_mirror || wrap == SceneWrap::kMirror;
      }
    }
    material_.clamp = any_clamp && !any_repeat && !any_mirror;
    if (any_mirror) {
      WarnOnce(
          "Mirrored textures are baked as repeated ones; mirror the coordinates when sampling.");
    }
    if (any_clamp && !material_.clamp) {
      WarnOnce("Its textures are clamped here and repeated there; the container repeats.");
    }
  }

  const GltfFile& gltf_;
  const std::vector<SceneImage>& images_;
  JsonProblem problem_;
  JsonView view_;
  SceneMaterial material_;
  std::map<std::string, std::vector<double>> factors_;
  std::vector<std::string> order_;
  std::map<std::string, std::pair<ScenePrune, std::string>> dropped_;
};

}  // namespace

Result<Scene> ReadGltf(const std::string& path) {
  PATINA_ASSIGN(const GltfFile gltf, OpenGltf(path));
  Scene scene;
  PATINA_ASSIGN(scene.images, ListGltfImages(gltf));
  const auto list = gltf.json.find("materials");
  if (list == gltf.json.end()) {
    return Fail(ErrorCode::kInvalidArgument,
                path + ": /materials: there are none; give materials to what is to be baked");
  }
  if (!list->is_array() || list->empty()) {
    return Fail(ErrorCode::kCorruptData, path + ": /materials: not an array with an element");
  }
  if (list->size() > kMaxSceneMaterials) {
    return Fail(ErrorCode::kOutOfRange,
                path + ": /materials: " + std::to_string(list->size()) + " materials, more than " +
                    std::to_string(kMaxSceneMaterials) + "; split the scene");
  }
  for (size_t i = 0; i < list->size(); ++i) {
    scene.materials.push_back(
        MaterialReader(gltf, scene.images, (*list)[i], static_cast<int>(i)).Run());
  }
  return scene;
}

}  // namespace patina::scene_detail
