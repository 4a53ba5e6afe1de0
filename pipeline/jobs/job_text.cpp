// Jobs as text: as a job file, and what of them decides bytes.
#include <nlohmann/json.hpp>

#include "formats/layered/layered_file.h"
#include "pipeline/jobs/brdf_job.h"
#include "pipeline/jobs/job_aims.h"
#include "pipeline/jobs/svbrdf_job.h"

namespace patina {
namespace {

using Json = nlohmann::json;

std::string LastComponent(const std::string& path) {
  const size_t slash = path.find_last_of('/');
  return slash == std::string::npos ? path : path.substr(slash + 1);
}

// Fields of this kind that are not their defaults.
void EffectsToJson(const Job& job, nlohmann::ordered_json* json) {
  EffectSwitches switches = job.effects;
  for (const char* name : EffectNames()) {
    if (!*EffectSwitch(&switches, name)) (*json)["effects"][name] = false;
  }
  if (switches.constant_tolerance != kDefaultConstantTolerance)
    (*json)["constant_tolerance"] = switches.constant_tolerance;
  if (job.lod_range) (*json)["lod_range"] = *job.lod_range;
}

template <class T>
void SetIf(const char* key, const std::optional<T>& value, nlohmann::ordered_json* json) {
  if (value) (*json)["model"][key] = *value;
}

void MapsToJson(const Job& job, nlohmann::ordered_json* json) {
  if (!job.folder.empty()) (*json)["folder"] = job.folder;
  if (!job.set.empty()) (*json)["set"] = job.set;
  for (const JobMap& map : job.maps) {
    nlohmann::ordered_json entry;
    entry["role"] = map.role;
    entry["file"] = map.file;
    if (!map.channels.empty()) entry["channels"] = map.channels;
    if (map.color_space != "auto") entry["color_space"] = map.color_space;
    if (map.convention != "auto") entry["convention"] = map.convention;
    if (map.invert) entry["invert"] = true;
    (*json)["maps"].push_back(std::move(entry));
  }
}

void SceneToJson(const Job& job, nlohmann::ordered_json* json) {
  if (!job.scene.empty()) (*json)["scene"] = job.scene;
  if (!job.scene_material.empty()) (*json)["material"] = job.scene_material;
}

// How maps are read, where it is not the default.
void ReadingToJson(const Job& job, nlohmann::ordered_json* json) {
  const Job defaults;
  if (job.address != defaults.address || (job.address_given && !job.scene.empty()))
    (*json)["address"] = AddressModeName(job.address);
  if (job.normal_convention != defaults.normal_convention)
    (*json)["normal_convention"] = job.normal_convention;
  if (job.color_space != defaults.color_space) (*json)["color_space"] = job.color_space;
  if (!job.ocio.empty()) (*json)["ocio"] = job.ocio;
}

std::string BrdfJobToJson(const Job& job, nlohmann::ordered_json json) {
  const Job defaults;
  if (!job.file.empty()) json["file"] = job.file;
  MapsToJson(job, &json);
  SceneToJson(job, &json);
  json["out"] = job.out;
  ReadingToJson(job, &json);
  const JobModel& model = job.model;
  SetIf("nside", model.nside, &json);
  SetIf("primitive_size", model.primitive_size, &json);
  SetIf("index_bits", model.index_bits, &json);
  SetIf("hidden", model.hidden, &json);
  SetIf("hidden_layers", model.hidden_layers, &json);
  SetIf("textures", model.textures, &json);
  SetIf("texture_format", model.texture_format, &json);
  SetIf("interpolation", model.interpolation, &json);
  SetIf("angle_inputs", model.angle_inputs, &json);
  SetIf("canonical_order", model.canonical_order, &json);
  SetIf("index_training", model.index_training, &json);
  if (job.quality != defaults.quality) json["quality"] = QualityName(job.quality);
  if (job.recipe != defaults.recipe) json["recipe"] = RecipeName(job.recipe);
  if (job.seed != defaults.seed) json["seed"] = job.seed;
  if (job.threads != defaults.threads) json["threads"] = job.threads;
  if (!job.report) json["report"] = false;
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

nlohmann::ordered_json CanonicalMaps(const Job& job) {
  auto maps = nlohmann::ordered_json::array();
  for (const JobMap& map : job.maps) {
    maps.push_back({{"role", map.role},
                    {"file", LastComponent(map.file)},
                    {"channels", map.channels},
                    {"color_space", map.color_space},
                    {"convention", map.convention},
                    {"invert", map.invert}});
  }
  return maps;
}

std::string CanonicalSvbrdfJob(const Job& job, nlohmann::ordered_json json) {
  // Of an image set; of others the source, whose hash stands beside this, may have no azimuth.
  const svbrdf::SvbrdfShape shape = SvbrdfModelOfJob(job, 1, 1, AddressMode::kClamp, false);
  if (!svbrdf::IsImageSetFileName(job.file)) {
    json["maps"] = CanonicalMaps(job);
    json["address"] = AddressModeName(job.address);
    json["normal_convention"] = job.normal_convention;
    json["color_space"] = job.color_space;
    json["isotropic_canonical_order"] =
        SvbrdfModelOfJob(job, 1, 1, AddressMode::kClamp, true).model.grid.canonical_order;
  }
  json["model"] = {{"nside", shape.model.grid.nside},
                   {"primitive_size", shape.model.primitive_size},
                   {"index_bits", shape.model.index_bits},
                   {"hidden", shape.model.hidden},
                   {"hidden_layers", shape.model.hidden_layers},
                   {"interpolation", InterpolationName(shape.model.grid.interpolation)},
                   {"angle_inputs", shape.model.grid.angle_inputs},
                   {"canonical_order", shape.model.grid.canonical_order},
                   {"textures", shape.texture.textures}};
  if (TextureFormOfJob(job) == svbrdf::TextureForm::kHalves)
    json["model"]["texture_format"] = "fp16";
  json["quality"] = QualityName(job.quality);
  json["recipe"] = RecipeName(job.recipe);
  json["seed"] = job.seed;
  return json.dump(-1, ' ', true, Json::error_handler_t::replace);
}

std::string CanonicalBrdfJob(const Job& job, nlohmann::ordered_json json) {
  // Which of them it will be is the source's to say, whose hash stands beside this.
  for (const brdf::SourceKind kind :
       {brdf::SourceKind{true, false}, brdf::SourceKind{true, true}, brdf::SourceKind{false, false},
        brdf::SourceKind{false, true}}) {
    const brdf::ModelShape shape = ModelOfJob(job, kind);
    json["models"].push_back({{"nside", shape.grid.nside},
                              {"primitive_size", shape.primitive_size},
                              {"index_bits", shape.index_bits},
                              {"hidden", shape.hidden},
                              {"hidden_layers", shape.hidden_layers},
                              {"interpolation", InterpolationName(shape.grid.interpolation)},
                              {"angle_inputs", shape.grid.angle_inputs},
                              {"canonical_order", shape.grid.canonical_order}});
  }
  json["index_training"] = job.model.index_training.value_or("clusters");
  json["quality"] = QualityName(job.quality);
  json["recipe"] = RecipeName(job.recipe);
  json["seed"] = job.seed;
  return json.dump(-1, ' ', true, Json::error_handler_t::replace);
}

}  // namespace

std::string JobToJson(const Job& job) {
  const Job defaults;
  nlohmann::ordered_json json;
  json["version"] = kJobVersion;
  json["kind"] = JobKindName(job.kind);
  json["asset"] = job.asset;
  if (job.kind != JobKind::kMaterial) return BrdfJobToJson(job, std::move(json));
  MapsToJson(job, &json);
  SceneToJson(job, &json);
  json["out"] = job.out;
  if (job.choose_profile) {
    json["profile"] = "auto";
  } else if (job.profile != defaults.profile || HasAims(job)) {
    json["profile"] = ProfileName(job.profile);
  }
  if (job.quality != defaults.quality) json["quality"] = QualityName(job.quality);
  if (job.recipe != defaults.recipe) json["recipe"] = RecipeName(job.recipe);
  if (job.seed != defaults.seed) json["seed"] = job.seed;
  if (job.threads != defaults.threads) json["threads"] = job.threads;
  if (!job.report) json["report"] = false;
  if (job.target_psnr_db > 0) json["target_psnr_db"] = job.target_psnr_db;
  if (job.target_bpp > 0) json["target_bpp"] = job.target_bpp;
  if (job.size_budget_bytes > 0) json["size_budget_bytes"] = job.size_budget_bytes;
  if (job.time_budget_s > 0) json["time_budget_s"] = job.time_budget_s;
  if (job.samples > 0) json["samples"] = job.samples;
  if (job.min_psnr_db > 0) json["min_psnr_db"] = job.min_psnr_db;
  if (job.repair_nonfinite) json["repair_nonfinite"] = true;
  if (!job.toksvig) json["toksvig"] = false;
  if (job.working_space != defaults.working_space)
    json["working_space"] = WorkingSpaceName(job.working_space);
  ReadingToJson(job, &json);
  EffectsToJson(job, &json);
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string CanonicalJob(const Job& job) {
  nlohmann::ordered_json json;
  json["version"] = kJobVersion;
  json["kind"] = JobKindName(job.kind);
  json["asset"] = job.asset;
  if (job.kind == JobKind::kBrdf) return CanonicalBrdfJob(job, std::move(json));
  if (job.kind == JobKind::kSvbrdf) return CanonicalSvbrdfJob(job, std::move(json));
  json["maps"] = CanonicalMaps(job);
  json["profile"] = job.choose_profile ? "auto" : ProfileName(job.profile);
  json["quality"] = QualityName(job.quality);
  json["recipe"] = RecipeName(job.recipe);
  json["seed"] = job.seed;
  json["target_psnr_db"] = job.target_psnr_db;
  if (job.target_bpp > 0) json["target_bpp"] = job.target_bpp;
  if (job.size_budget_bytes > 0) json["size_budget_bytes"] = job.size_budget_bytes;
  json["time_budget_s"] = job.time_budget_s;
  json["samples"] = job.samples;
  json["address"] = AddressModeName(job.address);
  json["normal_convention"] = job.normal_convention;
  json["repair_nonfinite"] = job.repair_nonfinite;
  json["toksvig"] = job.toksvig;
  if (job.working_space != WorkingSpace::kLinearRec709)
    json["working_space"] = WorkingSpaceName(job.working_space);
  if (job.color_space != "auto") json["color_space"] = job.color_space;
  EffectsToJson(job, &json);
  return json.dump(-1, ' ', true, Json::error_handler_t::replace);
}

}  // namespace patina
