#include "formats/manifest.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "formats/dds.h"
#include "formats/index_pack.h"
#include "formats/json_view.h"
#include "formats/manifest_check.h"
#include "formats/manifest_json.h"
#include "formats/scene/scene_json.h"

namespace patina {
namespace {

using nlohmann::ordered_json;

constexpr const char* kFormatName = "patina-container";

ordered_json NullIfInfinite(double value) {
  return std::isinf(value) ? ordered_json(nullptr) : ordered_json(value);
}

ordered_json SourceToJson(const ManifestSource& source) {
  ordered_json json;
  json["width"] = source.width;
  json["height"] = source.height;
  json["levels"] = source.levels;
  json["address"] = source.address;
  json["normal_convention"] = source.normal_convention;
  json["files"] = ordered_json::array();
  for (const ManifestSourceFile& file : source.files) {
    ordered_json entry;
    entry["path"] = file.path;
    entry["roles"] = file.roles;
    entry["sha256"] = file.sha256;
    entry["width"] = file.width;
    entry["height"] = file.height;
    entry["channels"] = file.channels;
    entry["type"] = file.type;
    entry["file_format"] = file.file_format;
    json["files"].push_back(std::move(entry));
  }
  return json;
}

ordered_json PayloadsToJson(const std::vector<ManifestPayload>& payloads) {
  ordered_json json = ordered_json::array();
  for (const ManifestPayload& payload : payloads) {
    ordered_json entry;
    entry["name"] = payload.name;
    entry["role"] = payload.role;
    entry["bytes"] = payload.bytes;
    entry["sha256"] = payload.sha256;
    json.push_back(std::move(entry));
  }
  return json;
}

ordered_json FeaturesToJson(const std::vector<ManifestFeature>& features) {
  ordered_json json = ordered_json::array();
  for (const ManifestFeature& feature : features) {
    ordered_json entry;
    entry["payload"] = feature.payload;
    entry["width"] = feature.width;
    entry["height"] = feature.height;
    entry["levels"] = feature.levels;
    entry["lod_bias"] = feature.lod_bias;
    entry["format"] = feature.format;
    json.push_back(std::move(entry));
  }
  return json;
}

ordered_json NetworkToJson(const ManifestNetwork& network) {
  ordered_json json;
  json["payload"] = network.payload;
  json["inputs"] = network.inputs;
  json["hidden"] = network.hidden;
  json["outputs"] = network.outputs;
  json["activation"] = network.activation;
  return json;
}

ordered_json ChannelsToJson(const std::vector<ManifestChannel>& channels) {
  ordered_json json = ordered_json::array();
  for (const ManifestChannel& channel : channels) {
    ordered_json entry;
    entry["map"] = channel.map;
    entry["component"] = channel.component;
    entry["encoding"] = channel.encoding;
    if (channel.scale != 1.0f) entry["scale"] = FloatAsWritten(channel.scale);
    entry["range"] = {FloatAsWritten(channel.range_min), FloatAsWritten(channel.range_max)};
    if (channel.output >= 0) {
      entry["output"] = channel.output;
    } else {
      entry["constant"] = FloatAsWritten(channel.constant);
    }
    json.push_back(std::move(entry));
  }
  return json;
}

ordered_json MapsToJson(const std::vector<ManifestMap>& maps) {
  ordered_json json = ordered_json::array();
  for (const ManifestMap& map : maps) {
    ordered_json entry;
    entry["role"] = map.role;
    entry["file"] = map.file;
    entry["file_channels"] = map.file_channels;
    entry["type"] = map.type;
    entry["inverted"] = map.inverted;
    entry["transfer"] = map.transfer;
    if (!map.color_space.empty()) entry["color_space"] = map.color_space;
    if (!map.color_rule.empty()) entry["color_rule"] = map.color_rule;
    json.push_back(std::move(entry));
  }
  return json;
}

ordered_json MeasuresToJson(const ManifestMeasures& measures) {
  ordered_json json = ordered_json::object();
  if (measures.psnr_db) json["psnr_db"] = NullIfInfinite(*measures.psnr_db);
  if (measures.ssim) json["ssim"] = *measures.ssim;
  if (measures.flip) json["flip"] = *measures.flip;
  if (measures.normal_deg) json["normal_deg"] = *measures.normal_deg;
  return json;
}

ordered_json QualityToJson(const ManifestQuality& quality) {
  ordered_json json;
  json["psnr_db"]["overall"] = NullIfInfinite(quality.psnr_overall_db);
  json["psnr_db"]["mip0"] = NullIfInfinite(quality.psnr_mip0_db);
  json["psnr_db"]["mean_mips"] = NullIfInfinite(quality.psnr_mean_mips_db);
  if (quality.ssim) json["ssim"] = *quality.ssim;
  if (quality.flip) json["flip"] = *quality.flip;
  json["maps"] = ordered_json::array();
  for (const ManifestMapQuality& map : quality.maps) {
    ordered_json entry;
    entry["map"] = map.map;
    entry["overall"] = MeasuresToJson(map.overall);
    entry["mips"] = ordered_json::array();
    for (const ManifestMeasures& mip : map.mips) entry["mips"].push_back(MeasuresToJson(mip));
    json["maps"].push_back(std::move(entry));
  }
  if (quality.gate_min_psnr_db) {
    json["gate"]["min_psnr_db"] = *quality.gate_min_psnr_db;
    json["gate"]["met"] = quality.gate_met;
  }
  return json;
}

ordered_json ChoiceToJson(const ManifestChoice& choice) {
  ordered_json json;
  if (choice.target_psnr_db > 0) json["target_psnr_db"] = choice.target_psnr_db;
  if (choice.most_bytes > 0) json["most_bytes"] = choice.most_bytes;
  json["candidates"] = ordered_json::array();
  for (const ManifestCandidate& candidate : choice.candidates) {
    ordered_json entry;
    entry["profile"] = candidate.profile;
    entry["bytes"] = candidate.bytes;
    if (candidate.reached_db) {
      entry["reached_psnr_db"] = *candidate.reached_db;
      entry["given_up"] = candidate.given_up;
    }
    json["candidates"].push_back(std::move(entry));
  }
  json["chosen"] = choice.chosen;
  json["in_reach"] = choice.in_reach;
  json["met"] = choice.met;
  json["reason"] = choice.reason;
  return json;
}

ordered_json TrainingToJson(const ManifestTraining& training) {
  ordered_json json;
  json["samples"] = training.samples;
  json["stopped_by"] = training.stopped_by;
  json["float_psnr_db"]["mip0"] = NullIfInfinite(training.float_psnr_mip0_db);
  json["float_psnr_db"]["mean_mips"] = NullIfInfinite(training.float_psnr_mean_mips_db);
  json["rollbacks"] = training.rollbacks;
  json["curve"] = ordered_json::array();
  for (const ManifestCurvePoint& point : training.curve) {
    ordered_json entry;
    entry["samples"] = point.samples;
    entry["psnr_mip0_db"] = NullIfInfinite(point.psnr_mip0_db);
    entry["psnr_mean_mips_db"] = NullIfInfinite(point.psnr_mean_mips_db);
    for (const auto& [map, db] : point.maps_db) entry["psnr_maps_db"][map] = NullIfInfinite(db);
    json["curve"].push_back(std::move(entry));
  }
  if (training.choice) json["choice"] = ChoiceToJson(*training.choice);
  return json;
}

ordered_json BrdfSourceToJson(const ManifestBrdf& brdf) {
  ordered_json json;
  json["format"] = brdf.source_format;
  json["cells"] = brdf.cells;
  json["invalid_cells"] = brdf.invalid_cells;
  if (brdf.simulation) {
    ordered_json& simulation = json["simulation"];
    simulation["pairs"] = brdf.simulation->pairs;
    simulation["paths"] = brdf.simulation->paths;
    simulation["standard_error"] = brdf.simulation->standard_error;
    simulation["effects"] = brdf.simulation->effects;
    simulation["left_out"] = brdf.simulation->left_out;
  }
  if (brdf.images) {
    ordered_json& images = json["images"];
    images["count"] = brdf.images->images;
    images["width"] = brdf.images->width;
    images["height"] = brdf.images->height;
    images["address"] = brdf.images->address;
    images["sha256"] = brdf.images->sha256;
  }
  json["files"] = ordered_json::array();
  for (const ManifestBrdfFile& file : brdf.files) {
    ordered_json entry;
    entry["path"] = file.path;
    entry["sha256"] = file.sha256;
    json["files"].push_back(std::move(entry));
  }
  return json;
}

ordered_json BrdfToJson(const ManifestBrdf& brdf) {
  ordered_json json;
  json["grid"] = brdf.grid;
  if (!brdf.codebook.empty()) json["codebook"]["payload"] = brdf.codebook;
  if (!brdf.shared_codebook_file.empty()) {
    json["codebook"]["file"] = brdf.shared_codebook_file;
    json["codebook"]["sha256"] = brdf.shared_codebook_sha256;
  }
  json["nside"] = brdf.nside;
  json["primitive_size"] = brdf.primitive_size;
  json["index_bits"] = brdf.index_bits;
  json["interpolation"] = brdf.interpolation;
  json["isotropic"] = brdf.isotropic;
  json["canonical_order"] = brdf.canonical_order;
  json["angle_inputs"] = brdf.angle_inputs;
  if (brdf.half_vector_inputs) json["half_vector_inputs"] = true;
  json["network"]["payload"] = brdf.network;
  json["network"]["layers"] = brdf.layers;
  json["network"]["activation"] = brdf.activation;
  json["output_transform"] = brdf.output_transform;
  if (!brdf.sampler.empty()) json["sampler"] = brdf.sampler;
  if (brdf.rollbacks != 0) json["rollbacks"] = brdf.rollbacks;
  return json;
}

ordered_json BrdfQualityToJson(const ManifestBrdfQuality& quality) {
  ordered_json json = ordered_json::object();
  if (quality.image_mae) json["image_mae"] = *quality.image_mae;
  if (quality.image_rmse) json["image_rmse"] = *quality.image_rmse;
  if (quality.image_ssim) json["image_ssim"] = *quality.image_ssim;
  if (quality.log1p_mse) json["log1p_mse"] = *quality.log1p_mse;
  if (quality.reciprocity_error) json["reciprocity_error"] = *quality.reciprocity_error;
  json["albedo"] = ordered_json::array();
  for (const ManifestAlbedo& albedo : quality.albedo) {
    ordered_json entry;
    entry["theta_deg"] = albedo.theta_deg;
    entry["rgb"] = albedo.rgb;
    json["albedo"].push_back(std::move(entry));
  }
  return json;
}

constexpr size_t kMaxEntries = 65536;

ManifestSource ReadSource(const JsonView& json) {
  ManifestSource source;
  source.width = json.Field("width").Int(1, kMaxDdsSide);
  source.height = json.Field("height").Int(1, kMaxDdsSide);
  source.levels = json.Field("levels").Int(1, 32);
  source.address = json.Field("address").String();
  source.normal_convention = json.Field("normal_convention").String();
  json.Field("files").ForEach(kMaxEntries, [&](const JsonView& entry) {
    ManifestSourceFile file;
    file.path = entry.Field("path").String();
    entry.Field("roles").ForEach(
        kMaxEntries, [&](const JsonView& role) { file.roles.push_back(role.String()); });
    file.sha256 = entry.Field("sha256").String();
    file.width = entry.Field("width").Int(1, kMaxDdsSide);
    file.height = entry.Field("height").Int(1, kMaxDdsSide);
    file.channels = entry.Field("channels").Int(1, 1024);
    file.type = entry.Field("type").String();
    file.file_format = entry.Field("file_format").String();
    source.files.push_back(std::move(file));
  });
  return source;
}

void ReadPayloads(const JsonView& json, std::vector<ManifestPayload>* payloads) {
  json.ForEach(kMaxEntries, [&](const JsonView& entry) {
    ManifestPayload payload;
    payload.name = entry.Field("name").String();
    payload.role = entry.Field("role").String();
    payload.bytes = entry.Field("bytes").Unsigned();
    payload.sha256 = entry.Field("sha256").String();
    payloads->push_back(std::move(payload));
  });
}

void ReadFeatures(const JsonView& json, std::vector<ManifestFeature>* features) {
  json.ForEach(kMaxManifestFeatures, [&](const JsonView& entry) {
    ManifestFeature feature;
    feature.payload = entry.Field("payload").String();
    feature.width = entry.Field("width").Int(1, kMaxDdsSide);
    feature.height = entry.Field("height").Int(1, kMaxDdsSide);
    feature.levels = entry.Field("levels").Int(1, 32);
    feature.lod_bias = entry.Field("lod_bias").Int(-31, 0);
    feature.format = entry.Field("format").String();
    features->push_back(std::move(feature));
  });
}

ManifestNetwork ReadNetwork(const JsonView& json) {
  ManifestNetwork network;
  network.payload = json.Field("payload").String();
  network.inputs = json.Field("inputs").Int(1, 3 * kMaxManifestFeatures);
  network.hidden = json.Field("hidden").Int(1, kMaxManifestHidden);
  network.outputs = json.Field("outputs").Int(1, kMaxManifestOutputs);
  network.activation = json.Field("activation").String();
  return network;
}

void ReadChannels(const JsonView& json, JsonProblem* problem,
                  std::vector<ManifestChannel>* channels) {
  json.ForEach(2048, [&](const JsonView& entry) {
    ManifestChannel channel;
    channel.map = entry.Field("map").String();
    channel.component = entry.Field("component").String();
    channel.encoding = entry.Field("encoding").String();
    if (const JsonView scale = entry.Optional("scale")) channel.scale = scale.Float();
    std::vector<float> range;
    entry.Field("range").ForEach(2, [&](const JsonView& bound) { range.push_back(bound.Float()); });
    if (range.size() == 2) {
      channel.range_min = range[0];
      channel.range_max = range[1];
    } else if (problem->text.empty()) {
      problem->text = "/channels/" + std::to_string(channels->size()) + "/range: not two numbers";
    }
    if (const JsonView output = entry.Optional("output")) {
      channel.output = output.Int(0, kMaxManifestOutputs - 1);
    } else {
      channel.constant = entry.Field("constant").Float();
    }
    channels->push_back(std::move(channel));
  });
}

void ReadMaps(const JsonView& json, std::vector<ManifestMap>* maps) {
  json.ForEach(kMaxEntries, [&](const JsonView& entry) {
    ManifestMap map;
    map.role = entry.Field("role").String();
    map.file = entry.Field("file").Int(-1, kMaxEntries);
    entry.Field("file_channels").ForEach(1024, [&](const JsonView& channel) {
      map.file_channels.push_back(channel.Int(0, 1023));
    });
    map.type = entry.Field("type").String();
    map.inverted = entry.Field("inverted").Bool();
    map.transfer = entry.Field("transfer").String();
    if (const JsonView space = entry.Optional("color_space")) map.color_space = space.String();
    if (const JsonView rule = entry.Optional("color_rule")) map.color_rule = rule.String();
    maps->push_back(std::move(map));
  });
}

std::optional<double> ReadOptionalNumber(const JsonView& json) {
  return json ? std::optional<double>(json.Number()) : std::nullopt;
}

ManifestMeasures ReadMeasures(const JsonView& json) {
  ManifestMeasures measures;
  if (const JsonView psnr = json.Optional("psnr_db")) measures.psnr_db = psnr.NumberOrInfinity();
  measures.ssim = ReadOptionalNumber(json.Optional("ssim"));
  measures.flip = ReadOptionalNumber(json.Optional("flip"));
  measures.normal_deg = ReadOptionalNumber(json.Optional("normal_deg"));
  return measures;
}

ManifestQuality ReadQuality(const JsonView& json) {
  ManifestQuality quality;
  const JsonView psnr = json.Field("psnr_db");
  quality.psnr_overall_db = psnr.Field("overall").NumberOrInfinity();
  quality.psnr_mip0_db = psnr.Field("mip0").NumberOrInfinity();
  quality.psnr_mean_mips_db = psnr.Field("mean_mips").NumberOrInfinity();
  quality.ssim = ReadOptionalNumber(json.Optional("ssim"));
  quality.flip = ReadOptionalNumber(json.Optional("flip"));
  json.Field("maps").ForEach(kMaxEntries, [&](const JsonView& entry) {
    ManifestMapQuality map;
    map.map = entry.Field("map").String();
    map.overall = ReadMeasures(entry.Field("overall"));
    entry.Field("mips").ForEach(
        32, [&](const JsonView& mip) { map.mips.push_back(ReadMeasures(mip)); });
    quality.maps.push_back(std::move(map));
  });
  if (const JsonView gate = json.Optional("gate")) {
    quality.gate_min_psnr_db = gate.Field("min_psnr_db").Number();
    quality.gate_met = gate.Field("met").Bool();
  }
  return quality;
}

ManifestChoice ReadChoice(const JsonView& json) {
  ManifestChoice choice;
  choice.target_psnr_db = json.Optional("target_psnr_db").Number();
  choice.most_bytes = json.Optional("most_bytes").Unsigned();
  json.Field("candidates").ForEach(kMaxEntries, [&](const JsonView& entry) {
    ManifestCandidate candidate;
    candidate.profile = entry.Field("profile").String();
    candidate.bytes = entry.Field("bytes").Unsigned();
    if (const JsonView reached = entry.Optional("reached_psnr_db")) {
      candidate.reached_db = reached.Number();
      candidate.given_up = entry.Optional("given_up").Bool();
    }
    choice.candidates.push_back(std::move(candidate));
  });
  choice.chosen = json.Field("chosen").String();
  choice.in_reach = json.Field("in_reach").Bool();
  choice.met = json.Field("met").Bool();
  choice.reason = json.Field("reason").String();
  return choice;
}

ManifestTraining ReadTraining(const JsonView& json) {
  ManifestTraining training;
  training.samples = json.Field("samples").Unsigned();
  training.stopped_by = json.Field("stopped_by").String();
  const JsonView psnr = json.Field("float_psnr_db");
  training.float_psnr_mip0_db = psnr.Field("mip0").NumberOrInfinity();
  training.float_psnr_mean_mips_db = psnr.Field("mean_mips").NumberOrInfinity();
  training.rollbacks = json.Field("rollbacks").Int(0, std::numeric_limits<int>::max());
  json.Field("curve").ForEach(kMaxEntries, [&](const JsonView& entry) {
    ManifestCurvePoint point;
    point.samples = entry.Field("samples").Unsigned();
    point.psnr_mip0_db = entry.Field("psnr_mip0_db").NumberOrInfinity();
    point.psnr_mean_mips_db = entry.Field("psnr_mean_mips_db").NumberOrInfinity();
    if (const JsonView maps = entry.Optional("psnr_maps_db")) {
      maps.ForEachMember(kMaxEntries, [&](const std::string& map, const JsonView& db) {
        point.maps_db[map] = db.NumberOrInfinity();
      });
    }
    training.curve.push_back(std::move(point));
  });
  if (const JsonView choice = json.Optional("choice")) training.choice = ReadChoice(choice);
  return training;
}

void ReadBrdfSource(const JsonView& json, ManifestBrdf* brdf) {
  brdf->source_format = json.Field("format").String();
  brdf->cells = json.Field("cells").Unsigned();
  brdf->invalid_cells = json.Field("invalid_cells").Unsigned();
  if (const JsonView simulation = json.Optional("simulation")) {
    ManifestSimulation& read = brdf->simulation.emplace();
    read.pairs = simulation.Field("pairs").Unsigned();
    read.paths = simulation.Field("paths").Unsigned();
    read.standard_error = simulation.Field("standard_error").Number();
    const auto names = [&](const char* key, std::vector<std::string>* list) {
      simulation.Field(key).ForEach(
          kMaxEntries, [&](const JsonView& name) { list->push_back(name.String()); });
    };
    names("effects", &read.effects);
    names("left_out", &read.left_out);
  }
  if (const JsonView images = json.Optional("images")) {
    ManifestImageSet& read = brdf->images.emplace();
    read.images = images.Field("count").Unsigned();
    read.width = images.Field("width").Int(1, kMaxDdsSide);
    read.height = images.Field("height").Int(1, kMaxDdsSide);
    read.address = images.Field("address").String();
    read.sha256 = images.Field("sha256").String();
  }
  json.Field("files").ForEach(kMaxEntries, [&](const JsonView& entry) {
    brdf->files.push_back({entry.Field("path").String(), entry.Field("sha256").String()});
  });
}

void ReadBrdfModel(const JsonView& json, ManifestBrdf* brdf) {
  brdf->grid = json.Field("grid").String();
  if (const JsonView codebook = json.Optional("codebook")) {
    if (const JsonView payload = codebook.Optional("payload")) {
      brdf->codebook = payload.String();
    } else {
      brdf->shared_codebook_file = codebook.Field("file").String();
      brdf->shared_codebook_sha256 = codebook.Field("sha256").String();
    }
  }
  brdf->nside = json.Field("nside").Int(1, healpix::kMaxNside);
  brdf->primitive_size = json.Field("primitive_size").Int(1, kMaxPrimitiveSize);
  brdf->index_bits = json.Field("index_bits").Int(1, kMaxIndexBits);
  brdf->interpolation = json.Field("interpolation").String();
  brdf->isotropic = json.Field("isotropic").Bool();
  brdf->canonical_order = json.Field("canonical_order").Bool();
  brdf->angle_inputs = json.Field("angle_inputs").Bool();
  if (const JsonView half = json.Optional("half_vector_inputs"))
    brdf->half_vector_inputs = half.Bool();
  const JsonView network = json.Field("network");
  brdf->network = network.Field("payload").String();
  network.Field("layers").ForEach(kMaxManifestLayers + 1, [&](const JsonView& width) {
    brdf->layers.push_back(width.Int(1, kMaxManifestLayerWidth));
  });
  brdf->activation = network.Field("activation").String();
  brdf->output_transform = json.Field("output_transform").String();
  if (const JsonView sampler = json.Optional("sampler")) brdf->sampler = sampler.String();
  if (const JsonView rollbacks = json.Optional("rollbacks"))
    brdf->rollbacks = rollbacks.Int(0, std::numeric_limits<int>::max());
}

void ReadBrdfQuality(const JsonView& json, JsonProblem* problem, ManifestBrdfQuality* quality) {
  quality->image_mae = ReadOptionalNumber(json.Optional("image_mae"));
  quality->image_rmse = ReadOptionalNumber(json.Optional("image_rmse"));
  quality->image_ssim = ReadOptionalNumber(json.Optional("image_ssim"));
  quality->log1p_mse = ReadOptionalNumber(json.Optional("log1p_mse"));
  quality->reciprocity_error = ReadOptionalNumber(json.Optional("reciprocity_error"));
  json.Field("albedo").ForEach(kMaxEntries, [&](const JsonView& entry) {
    ManifestAlbedo albedo;
    albedo.theta_deg = entry.Field("theta_deg").Number();
    std::vector<double> rgb;
    entry.Field("rgb").ForEach(3, [&](const JsonView& value) { rgb.push_back(value.Number()); });
    if (rgb.size() == 3) {
      std::copy(rgb.begin(), rgb.end(), albedo.rgb.begin());
    } else if (problem->text.empty()) {
      problem->text =
          "/quality/albedo/" + std::to_string(quality->albedo.size()) + "/rgb: not three numbers";
    }
    quality->albedo.push_back(albedo);
  });
}

ordered_json ColorToJson(const Manifest& manifest) {
  ordered_json json;
  json["working_space"] = manifest.working_space;
  if (manifest.color_config) {
    json["config"]["source"] = manifest.color_config->source;
    if (!manifest.color_config->file.empty()) json["config"]["file"] = manifest.color_config->file;
    json["config"]["sha256"] = manifest.color_config->sha256;
  }
  return json;
}

void ReadColor(const JsonView& json, Manifest* manifest) {
  manifest->working_space = json.Field("working_space").String();
  const JsonView config = json.Optional("config");
  if (!config) return;
  manifest->color_config.emplace();
  manifest->color_config->source = config.Field("source").String();
  if (const JsonView file = config.Optional("file")) manifest->color_config->file = file.String();
  manifest->color_config->sha256 = config.Field("sha256").String();
}

Status CheckVersion(const JsonView& json, const JsonProblem& problem) {
  const std::string format = json.Field("format").String();
  if (problem.text.empty() && format != kFormatName) {
    return Fail(ErrorCode::kUnsupported,
                "/format: " + QuoteForMessage(format) + " is not \"patina-container\"");
  }
  const int version = json.Field("format_version").Int(1, std::numeric_limits<int>::max());
  if (!problem.text.empty()) return Fail(ErrorCode::kCorruptData, problem.text);
  if (version > kManifestVersion) {
    return Fail(ErrorCode::kUnsupported, "/format_version: " + std::to_string(version) +
                                             " is newer than this program, which reads up to " +
                                             std::to_string(kManifestVersion) +
                                             "; use a newer patina");
  }
  const std::string kind = json.Field("kind").String();
  if (problem.text.empty() && kind != "material" && kind != "brdf" && kind != "svbrdf") {
    return Fail(ErrorCode::kUnsupported,
                "/kind: " + QuoteForMessage(kind) + " is not one of: material, brdf, svbrdf");
  }
  return {};
}

}  // namespace

int FormatVersionOf(const Manifest& manifest) {
  if (manifest.lod_range || manifest.working_space != "lin_rec709") return 2;
  std::set<int> outputs;
  for (const ManifestChannel& channel : manifest.channels) {
    if (channel.encoding == "signed_log") return 2;
    if (channel.output >= 0 && !outputs.insert(channel.output).second) return 2;
  }
  return 1;
}

Result<std::string> ToJson(const Manifest& manifest) {
  if (auto status = CheckManifest(manifest); !status) {
    return Fail(ErrorCode::kInvalidArgument, std::move(status).error().message);
  }
  ordered_json json;
  json["format"] = kFormatName;
  json["format_version"] = FormatVersionOf(manifest);
  json["kind"] = manifest.kind;
  json["asset"] = manifest.asset;
  json["tool"]["name"] = manifest.tool.name;
  json["tool"]["version"] = manifest.tool.version;
  json["tool"]["recipe"] = manifest.tool.recipe;
  json["tool"]["recipe_version"] = manifest.tool.recipe_version;
  json["fingerprint"] = manifest.fingerprint;
  json["seed"] = manifest.seed;
  if (!manifest.brdf) json["profile"] = manifest.profile;
  json["quality_setting"] = manifest.quality_setting;
  json["source"] = manifest.brdf ? BrdfSourceToJson(*manifest.brdf) : SourceToJson(manifest.source);
  json["payloads"] = PayloadsToJson(manifest.payloads);
  if (manifest.brdf) {
    if (!manifest.features.empty()) json["features"] = FeaturesToJson(manifest.features);
    json["brdf"] = BrdfToJson(*manifest.brdf);
  } else {
    json["features"] = FeaturesToJson(manifest.features);
    if (manifest.network) json["network"] = NetworkToJson(*manifest.network);
    json["channels"] = ChannelsToJson(manifest.channels);
    json["maps"] = MapsToJson(manifest.maps);
    if (manifest.lod_range) json["lod_range"] = *manifest.lod_range;
  }
  if (manifest.scene) json["scene"] = SceneLookToJson(*manifest.scene);
  json["color"] = ColorToJson(manifest);
  if (manifest.brdf) {
    json["quality"] = BrdfQualityToJson(manifest.brdf->quality);
  } else {
    json["quality"] = QualityToJson(manifest.quality);
    json["training"] = TrainingToJson(manifest.training);
  }
  if (!manifest.brdf || !manifest.effects.empty())
    json["effects"] = EffectsToJson(manifest.effects);
  json["left_out"] = ordered_json::array();  // where versions before `effects` look
  json["warnings"] = manifest.warnings;
  std::string text = json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
  // What is written must be readable: this also finds strings and lists above the reader's limits.
  if (auto read_back = ParseManifest(text); !read_back) {
    return Fail(ErrorCode::kInvalidArgument, std::move(read_back).error().message);
  }
  return text;
}

Result<Manifest> ParseManifest(std::string_view text) {
  if (text.size() > kMaxManifestBytes) {
    return Fail(ErrorCode::kCorruptData, "a manifest of " + std::to_string(text.size()) +
                                             " bytes, more than " +
                                             std::to_string(kMaxManifestBytes));
  }
  nlohmann::json document;
  try {
    document = nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    return Fail(ErrorCode::kCorruptData, std::string("not JSON: ") + error.what());
  }
  JsonProblem problem;
  const JsonView json(&document, &problem);
  PATINA_TRY(CheckVersion(json, problem));
  Manifest manifest;
  manifest.kind = json.Field("kind").String();
  manifest.asset = json.Field("asset").String();
  const JsonView tool = json.Field("tool");
  manifest.tool.name = tool.Field("name").String();
  manifest.tool.version = tool.Field("version").String();
  manifest.tool.recipe = tool.Field("recipe").String();
  manifest.tool.recipe_version = tool.Field("recipe_version").Int(1, 1000000);
  manifest.fingerprint = json.Field("fingerprint").String();
  manifest.seed = json.Field("seed").Unsigned();
  manifest.quality_setting = json.Field("quality_setting").String();
  ReadPayloads(json.Field("payloads"), &manifest.payloads);
  ReadColor(json.Field("color"), &manifest);
  if (manifest.kind != "material") {
    if (manifest.kind == "svbrdf") ReadFeatures(json.Field("features"), &manifest.features);
    manifest.brdf.emplace();
    ReadBrdfSource(json.Field("source"), &*manifest.brdf);
    ReadBrdfModel(json.Field("brdf"), &*manifest.brdf);
    ReadBrdfQuality(json.Field("quality"), &problem, &manifest.brdf->quality);
  } else {
    manifest.profile = json.Field("profile").String();
    manifest.source = ReadSource(json.Field("source"));
    ReadFeatures(json.Field("features"), &manifest.features);
    if (const JsonView network = json.Optional("network")) manifest.network = ReadNetwork(network);
    ReadChannels(json.Field("channels"), &problem, &manifest.channels);
    ReadMaps(json.Field("maps"), &manifest.maps);
    if (const JsonView range = json.Optional("lod_range")) {
      std::vector<int> mips;
      range.ForEach(2, [&](const JsonView& mip) { mips.push_back(mip.Int(0, 31)); });
      mips.resize(2, -1);  // CheckManifest refuses what is not there
      manifest.lod_range = {mips[0], mips[1]};
    }
    manifest.quality = ReadQuality(json.Field("quality"));
    manifest.training = ReadTraining(json.Field("training"));
  }
  if (manifest.kind != "brdf") {
    if (const JsonView scene = json.Optional("scene")) manifest.scene = SceneLookFromJson(scene);
  }
  manifest.effects = EffectsFromJson(json);
  json.Field("warnings").ForEach(kMaxEntries, [&](const JsonView& warning) {
    manifest.warnings.push_back(warning.String());
  });
  if (!problem.text.empty()) return Fail(ErrorCode::kCorruptData, problem.text);
  if (auto status = CheckManifest(manifest); !status) {
    Error error = std::move(status).error();
    if (error.code == ErrorCode::kInvalidArgument) error.code = ErrorCode::kCorruptData;
    return Fail(std::move(error));
  }
  return manifest;
}

}  // namespace patina
