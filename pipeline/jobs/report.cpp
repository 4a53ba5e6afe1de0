#include "pipeline/jobs/report.h"

#include <nlohmann/json.hpp>

#include "formats/manifest_json.h"

namespace patina {
namespace {

using Json = nlohmann::ordered_json;

Json Table(const metrics::PsnrTable& table) {
  Json json{{"overall", CapPsnr(table.overall_db)},
            {"mip0", CapPsnr(table.mip0_db)},
            {"mean_mips", CapPsnr(table.mean_mips_db)}};
  json["mips"] = Json::array();
  for (const double db : table.psnr_db) json["mips"].push_back(CapPsnr(db));
  return json;
}

void SetIf(const char* key, const std::optional<double>& value, Json* json) {
  if (value) (*json)[key] = *value;
}

Json QualityJson(const Measurement& measurement) {
  const metrics::QualityResult& measured = measurement.quality;
  Json json;
  json["psnr_db"] = Table(measured.psnr);
  SetIf("ssim", measured.ssim, &json);
  SetIf("flip", measured.flip, &json);
  SetIf("normal_angle_deg", measured.normal_angle_deg, &json);
  json["maps"] = Json::array();
  for (const metrics::MapQuality& map : measured.maps) {
    Json entry{{"map", map.name}, {"psnr_db", Table(map.psnr)}};
    SetIf("ssim", map.ssim, &entry);
    SetIf("flip", map.flip, &entry);
    SetIf("normal_angle_deg", map.normal_angle_deg, &entry);
    json["maps"].push_back(std::move(entry));
  }
  return json;
}

Json TrainingJson(const TrainedMaterial& model) {
  Json json;
  json["samples"] = model.samples;
  json["stopped_by"] = model.stopped_by;
  json["rollbacks"] = model.rollbacks;
  json["curve"] = Json::array();
  for (const CurvePoint& point : model.curve) {
    json["curve"].push_back({{"samples", point.samples},
                             {"psnr_mip0_db", CapPsnr(point.psnr_mip0_db)},
                             {"psnr_mean_mips_db", CapPsnr(point.psnr_mean_mips_db)}});
  }
  auto model_psnr = [](double mip0, double mean_mips, double off_grid) {
    return Json{{"mip0", CapPsnr(mip0)},
                {"mean_mips", CapPsnr(mean_mips)},
                {"off_grid", CapPsnr(off_grid)}};
  };
  json["export"] = {
      {"float_model_psnr_db", model_psnr(model.float_psnr_mip0_db, model.float_psnr_mean_mips_db,
                                         model.float_psnr_off_grid_db)},
      {"exported_psnr_db", model_psnr(model.exported_psnr_mip0_db, model.exported_psnr_mean_mips_db,
                                      model.exported_psnr_off_grid_db)}};
  return json;
}

}  // namespace

std::string ReportToJson(const Manifest& manifest, const std::vector<ManifestPayload>& payloads,
                         const JobSource& source, const Measurement& measurement,
                         const TrainedMaterial* model) {
  Json json;
  json["version"] = 1;
  json["asset"] = manifest.asset;
  json["fingerprint"] = manifest.fingerprint;
  json["profile"] = manifest.profile;
  json["quality_setting"] = manifest.quality_setting;
  json["recipe"] = manifest.tool.recipe;
  json["width"] = manifest.source.width;
  json["height"] = manifest.source.height;
  json["inputs"] = Json::array();
  for (const MapNote& note : source.reference.notes) {
    json["inputs"].push_back(
        {{"file", note.file}, {"status", MapNoteKindName(note.kind)}, {"text", note.text}});
  }
  json["channels"] = Json::array();
  for (const ManifestChannel& channel : manifest.channels) {
    Json entry{
        {"map", channel.map}, {"component", channel.component}, {"encoding", channel.encoding}};
    entry["range"] = {channel.range_min, channel.range_max};
    if (channel.output < 0) entry["constant"] = channel.constant;
    json["channels"].push_back(std::move(entry));
  }
  json["effects"] = EffectsToJson(manifest.effects);
  json["quality"] = QualityJson(measurement);
  if (model != nullptr) json["training"] = TrainingJson(*model);
  return EndReport(std::move(json), manifest, payloads);
}

std::string EndReport(Json json, const Manifest& manifest,
                      const std::vector<ManifestPayload>& payloads) {
  json["bytes"] = Json::object();
  for (const ManifestPayload& payload : payloads) json["bytes"][payload.name] = payload.bytes;
  json["warnings"] = manifest.warnings;
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace patina
