#include "pipeline/jobs/pbr_maps.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "formats/scene/scene_json.h"
#include "pipeline/jobs/scene_job.h"
#include "pipeline/jobs/scene_maps.h"

namespace patina {
namespace {

// What reflects in a way that the model lacks: how roles begin, and the extension that has them.
constexpr std::pair<std::string_view, const char*> kOtherLobes[] = {
    {"clearcoat", "KHR_materials_clearcoat"},
    {"sheen", "KHR_materials_sheen"},
    {"anisotropy", "KHR_materials_anisotropy"},
    {"iridescence", "KHR_materials_iridescence"},
    {"transmission", "KHR_materials_transmission"},
    {"translucency", "KHR_materials_diffuse_transmission"},
    {"subsurface", "subsurface scattering"},
    {"specular_color", "specularColorFactor of KHR_materials_specular"}};

bool IsOfModel(const std::string& role) {
  for (const char* known : {"albedo", "normal", "roughness", "metalness", "specular"}) {
    if (role == known) return true;
  }
  return false;
}

const char* OtherLobe(const std::string& role) {
  for (const auto& [begin, extension] : kOtherLobes) {
    if (std::string_view(role).substr(0, begin.size()) == begin) return extension;
  }
  return nullptr;
}

// Takes the maps of one material apart.
class ScenePbrMaps {
 public:
  ScenePbrMaps(const Job& job, const SceneMaterial& material, JobMaps maps)
      : where_(job.scene + ": " + material.pointer + ": "), maps_(std::move(maps)) {}

  Result<PbrMaps> Run() {
    result_.address = maps_.address.value_or(AddressMode::kWrap);
    result_.warnings = maps_.warnings;
    result_.set = maps_.set;
    result_.set.maps.clear();
    result_.scene = maps_.scene;
    if (result_.scene->unlit) return Unsupported("it is unlit (KHR_materials_unlit)");
    for (const MapSource& map : maps_.set.maps) {
      PATINA_TRY(Take(map.role));
      if (IsOfModel(map.role)) result_.set.maps.push_back(map);
    }
    for (const ConstantMap& constant : maps_.constants) {
      const bool white = std::all_of(constant.value.begin(), constant.value.end(),
                                     [](float value) { return value == 1; });
      if (constant.role == "specular_color" && white) continue;
      PATINA_TRY(Take(constant.role));
      if (IsOfModel(constant.role)) result_.settings.constants.push_back(constant);
    }
    if (result_.set.maps.empty()) {
      return Fail(ErrorCode::kInvalidArgument,
                  where_ +
                      "it has no texture that its reflectance follows from, and reflects the same "
                      "everywhere; bake it as a material, which holds such numbers as they are");
    }
    TakeNumbers();
    PATINA_TRY(TakeBindings());
    DescribeScene();
    return std::move(result_);
  }

 private:
  tl::unexpected<Error> Unsupported(const std::string& why) const {
    return Fail(ErrorCode::kUnsupported,
                where_ + why +
                    ", which the metallic-roughness model of --as svbrdf lacks; bake it as a "
                    "material, or take that out of the scene");
  }

  Status Take(const std::string& role) {
    if (const char* lobe = OtherLobe(role))
      return Unsupported("its " + role + " (" + lobe + ") changes how it reflects");
    if (!IsOfModel(role)) result_.settings.left_out.push_back(role);
    return {};
  }

  void TakeNumbers() {
    SceneLook& look = *result_.scene;
    for (const SceneValue& factor : look.factors) {
      if (IsOfModel(factor.map)) result_.settings.factors.push_back(factor);
    }
    for (const SceneValue& parameter : look.parameters) {
      const double value = parameter.value[0];
      if (parameter.map == "normal_scale")
        result_.settings.normal_scale = static_cast<float>(value);
      if (parameter.map == "ior") {
        // KHR_materials_ior: 0 stands for a mirror.
        const double root = value == 0 ? 1 : (value - 1) / (value + 1);
        result_.settings.dielectric_f0 = static_cast<float>(root * root);
      }
    }
    look.factors.clear();
    look.parameters.clear();
  }

  // Texture coordinates of a container are those of its textures, all of one transform.
  Status TakeBindings() {
    std::vector<SceneBinding>& bindings = result_.scene->bindings;
    for (SceneBinding& binding : bindings)
      std::erase_if(binding.maps, [](const std::string& role) { return !IsOfModel(role); });
    std::erase_if(bindings, [](const SceneBinding& binding) { return binding.maps.empty(); });
    for (const SceneBinding& binding : bindings) {
      const SceneBinding& first = bindings[0];
      if (binding.tex_coord == first.tex_coord && binding.transform == first.transform) continue;
      return Fail(ErrorCode::kUnsupported,
                  where_ + first.slot + " and " + binding.slot +
                      " have different coordinates or transforms, and reflectance is learned at "
                      "one; give them the same, or bake it as a material");
    }
    return {};
  }

  void DescribeScene() {
    std::string& text = result_.scene_text;
    const auto add = [&text](const std::string& name, float value) {
      text += " " + name + " " + std::to_string(std::bit_cast<uint32_t>(value));
    };
    text = "scene " + SceneLookToJson(*result_.scene)
                          .dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
    text += result_.address == AddressMode::kClamp ? " clamp" : " wrap";
    const svbrdf::PbrSettings& settings = result_.settings;
    for (const ConstantMap& constant : settings.constants) {
      for (const float value : constant.value) add(constant.role, value);
    }
    for (const SceneValue& factor : settings.factors) {
      for (const double value : factor.value)
        add("factor of " + factor.map, static_cast<float>(value));
    }
    add("normal_scale", settings.normal_scale);
    add("f0", settings.dielectric_f0);
    for (const std::string& role : settings.left_out) text += " without " + role;
    text += "\n";
  }

  const std::string where_;
  const JobMaps maps_;
  PbrMaps result_;
};

}  // namespace

Result<PbrMaps> ReadPbrMaps(const Job& job, const std::string& scratch_folder) {
  if (job.scene.empty()) {
    PbrMaps maps;
    PATINA_ASSIGN(maps.set, MapsOfJob(job));
    maps.address = job.address;
    return maps;
  }
  PATINA_ASSIGN(const SceneChoice choice, SceneOfJob(job));
  PATINA_ASSIGN(JobMaps maps, MapsOfScene(job, choice, scratch_folder));
  return ScenePbrMaps(job, choice.material(), std::move(maps)).Run();
}

}  // namespace patina
