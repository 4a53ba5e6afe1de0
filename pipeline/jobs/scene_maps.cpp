#include "pipeline/jobs/scene_maps.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <set>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/scene/scene_json.h"
#include "pipeline/image/image_io.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

int ComponentsOf(const MapRole& role) {
  return role.kind == MapKind::kColor ? 3 : role.kind == MapKind::kVector2 ? 2 : 1;
}

// Turns one material into maps.
class MapMaker {
 public:
  MapMaker(const Job& job, const SceneChoice& choice, const std::string& scratch_folder)
      : job_(job),
        scene_(choice.scene),
        material_(choice.material()),
        scratch_folder_(scratch_folder) {}

  Result<JobMaps> Run() {
    result_.set.name = job_.asset;
    result_.set.folder = FolderOfFile(job_.scene);
    result_.address = material_.clamp ? AddressMode::kClamp : AddressMode::kWrap;
    if (job_.address_given) result_.address = job_.address;
    result_.opacity_cutoff.reset();
    if (material_.look.alpha_mode == "mask")
      result_.opacity_cutoff = static_cast<float>(material_.look.alpha_cutoff);
    result_.lod_range = material_.lod_range;
    result_.density = material_.density;
    result_.scene = material_.look;
    for (const SceneMap& map : material_.maps) {
      const MapRole* role = nullptr;
      PATINA_TRY(FindRole(map.role, &role));
      if (EffectIsOn(job_.effects, map.prune)) {
        PATINA_TRY(LeaveOut(map, *role));
      } else {
        PATINA_TRY(AddMap(map, *role));
      }
    }
    for (const SceneValue& constant : material_.constants) PATINA_TRY(AddConstant(constant));
    for (const SceneLeftOut& left_out : material_.left_out)
      result_.left_out.push_back({left_out.what, EffectState::kLeftOut, left_out.reason, 1});
    std::stable_sort(result_.set.maps.begin(), result_.set.maps.end(),
                     [](const MapSource& a, const MapSource& b) {
                       return MapRoleIndex(a.role) < MapRoleIndex(b.role);
                     });
    for (SceneBinding& binding : result_.scene->bindings) {
      std::erase_if(binding.maps, [&](const std::string& role) {
        return std::none_of(result_.set.maps.begin(), result_.set.maps.end(),
                            [&](const MapSource& map) { return map.role == role; });
      });
    }
    // A constant in place of a texture is final.
    std::erase_if(result_.scene->factors, [&](const SceneValue& factor) {
      return without_alpha_.count(factor.map) == 0 &&
             std::none_of(result_.set.maps.begin(), result_.set.maps.end(),
                          [&](const MapSource& map) { return map.role == factor.map; });
    });
    PATINA_TRY(CheckFactors());
    result_.warnings = scene_.warnings;
    result_.warnings.insert(result_.warnings.end(), material_.warnings.begin(),
                            material_.warnings.end());
    if (job_.kind == JobKind::kMaterial) WarnOfCoordinates();
    if (result_.set.maps.empty() && result_.constants.empty()) {
      return Fail(ErrorCode::kInvalidArgument,
                  Where() + "nothing is left of it to bake; use one of its maps");
    }
    return std::move(result_);
  }

 private:
  std::string Where() const { return job_.scene + ": " + material_.pointer + ": "; }

  void WarnOfCoordinates() {
    std::vector<std::pair<int, UvTransform>> coordinates;
    for (const SceneBinding& binding : material_.look.bindings) {
      const auto here = std::pair(binding.tex_coord, binding.transform);
      if (std::find(coordinates.begin(), coordinates.end(), here) == coordinates.end())
        coordinates.push_back(here);
    }
    if (coordinates.size() < 2) return;
    result_.warnings.push_back(
        "Its textures have " + std::to_string(coordinates.size()) +
        " different coordinates or transforms; decode once for each, as `bindings` say.");
  }

  Status FindRole(const std::string& name, const MapRole** role) const {
    *role = FindMapRole(name);
    if (*role != nullptr) return {};
    std::string roles;
    for (const MapRole& known : MapRoles())
      roles += (roles.empty() ? "" : ", ") + std::string(known.name);
    return Fail(ErrorCode::kInvalidArgument,
                Where() + QuoteForMessage(name) + " is not a role of a map; roles: " + roles);
  }

  Status LeaveOut(const SceneMap& map, const MapRole& role) {
    if (!map.stand_in.empty()) return AddConstant({map.role, map.stand_in});
    result_.left_out.push_back({map.role, EffectState::kLeftOut, map.unused,
                                role.kind == MapKind::kNormal ? 2 : ComponentsOf(role)});
    return {};
  }

  Status AddMap(const SceneMap& map, const MapRole& role) {
    const SceneImage& image = scene_.images[static_cast<size_t>(map.image)];
    MapSource source;
    source.role = map.role;
    source.file = image.name;
    source.channels = map.channels;
    source.color_space = map.color_space;
    // The readers have let no other names through.
    source.convention = ParseNormalConvention(map.convention).value_or(NormalConvention::kAuto);
    source.convention_from_name = source.convention == NormalConvention::kAuto;
    source.invert = map.invert;
    auto path = PathOf(map.image, image);
    if (!path) return Fail(path.error());
    source.path = *path;
    auto info = ReadImageInfo(source.path);
    if (!info) return Fail(info.error(), Where() + map.role);
    if (source.channels == "a" && !info->has_alpha()) {
      // glTF: an image without alpha has 1 there.
      result_.set.notes.push_back(
          {MapNote::Kind::kIgnored, source.file, "no " + map.role + ": the image has no alpha"});
      without_alpha_.insert(map.role);
      return AddConstant({map.role, {1}});
    }
    const size_t given = source.channels.size();
    const bool fits = given == 0 || (role.kind == MapKind::kScalar && given == 1) ||
                      (role.kind == MapKind::kVector2 && given == 2) ||
                      (role.kind == MapKind::kNormal && (given == 2 || given == 3)) ||
                      (role.kind == MapKind::kColor && (given == 1 || given == 3));
    if (!fits) {
      return Fail(ErrorCode::kInvalidArgument,
                  Where() + map.role + ": channels " + QuoteForMessage(source.channels) +
                      " do not fit; give one for a scalar, two or three for a normal, three for a "
                      "colour");
    }
    const std::string from = given == 0 ? "" : " from " + source.channels;
    result_.set.notes.push_back({MapNote::Kind::kFound, source.file, map.role + from + " (scene)"});
    result_.set.maps.push_back(std::move(source));
    return {};
  }

  // The file of an image; one inside another file is written out, once.
  Result<std::string> PathOf(int index, const SceneImage& image) {
    if (image.problem) return Fail(*image.problem);
    if (!image.embedded) return image.path;
    std::string& path = written_[index];
    if (!path.empty()) return path;
    PATINA_ASSIGN(const std::vector<uint8_t> bytes, ReadSceneImage(image));
    std::error_code error;
    fs::create_directories(scratch_folder_, error);
    path =
        scratch_folder_ + "/" + std::to_string(index) + fs::path(image.name).extension().string();
    PATINA_TRY(WriteFileDurably(path, std::span<const uint8_t>(bytes)));
    return path;
  }

  Status AddConstant(const SceneValue& constant) {
    const MapRole* role = nullptr;
    PATINA_TRY(FindRole(constant.map, &role));
    const auto components = static_cast<size_t>(ComponentsOf(*role));
    if (role->kind == MapKind::kNormal || constant.value.size() != components) {
      return Fail(ErrorCode::kInvalidArgument,
                  Where() + constant.map + ": a constant of " +
                      std::to_string(constant.value.size()) + " numbers does not fit; " +
                      (role->kind == MapKind::kNormal ? "a normal needs a map"
                                                      : "give " + std::to_string(components)));
    }
    ConstantMap map;
    map.role = constant.map;
    std::vector<double> value = constant.value;
    if (role->kind == MapKind::kColor && InOtherSpace()) {
      const auto matrix = ConversionMatrix(kRec709Primaries, PrimariesOf(job_.working_space));
      for (size_t i = 0; i < 3; ++i) {
        value[i] = 0;
        for (size_t j = 0; j < 3; ++j) value[i] += (*matrix)[3 * i + j] * constant.value[j];
      }
    }
    map.value.assign(value.begin(), value.end());
    result_.constants.push_back(std::move(map));
    return {};
  }

  // A scene's own colours are linear Rec.709.
  bool InOtherSpace() const { return job_.working_space != WorkingSpace::kLinearRec709; }

  // A factor of a texture acts on each of red, green and blue, which are others after a conversion.
  Status CheckFactors() const {
    if (!InOtherSpace()) return {};
    for (const SceneValue& factor : result_.scene->factors) {
      const bool grey = std::adjacent_find(factor.value.begin(), factor.value.end(),
                                           std::not_equal_to<>()) == factor.value.end();
      if (grey) continue;
      return Fail(ErrorCode::kUnsupported,
                  Where() + "the factor of " + factor.map +
                      " has a colour; it acts on linear Rec.709 and cannot follow the texture to " +
                      WorkingSpaceName(job_.working_space) +
                      "; bake this material with --working-space lin_rec709");
    }
    return {};
  }

  const Job& job_;
  const Scene& scene_;
  const SceneMaterial& material_;
  const std::string& scratch_folder_;
  JobMaps result_;
  std::map<int, std::string> written_;
  std::set<std::string> without_alpha_;  // roles whose image has none: 1, times the factor
};

}  // namespace

Result<JobMaps> MapsOfScene(const Job& job, const SceneChoice& choice,
                            const std::string& scratch_folder) {
  return MapMaker(job, choice, scratch_folder).Run();
}

}  // namespace patina
