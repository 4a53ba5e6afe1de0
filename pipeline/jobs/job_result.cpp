#include "pipeline/jobs/job_result.h"

#include <nlohmann/json.hpp>

namespace patina {
namespace {

using Json = nlohmann::ordered_json;

const char* StatusName(int exit_code) {
  switch (exit_code) {
    case kExitDone:
      return "done";
    case kExitQualityGate:
      return "rejected";
    case kExitInterrupted:
      return "cancelled";
    default:
      return "failed";
  }
}

Json OrNull(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json BrdfJson(const BrdfSummary& brdf) {
  return {{"image_mae", OrNull(brdf.image_mae)},   {"image_rmse", OrNull(brdf.image_rmse)},
          {"image_ssim", OrNull(brdf.image_ssim)}, {"log1p_mae", brdf.log1p_mae},
          {"reciprocity", brdf.reciprocity},       {"albedo", brdf.albedo}};
}

Json SvbrdfJson(const SvbrdfSummary& svbrdf) {
  return {{"image_mae", svbrdf.image_mae},   {"image_rmse", svbrdf.image_rmse},
          {"image_ssim", svbrdf.image_ssim}, {"psnr", svbrdf.psnr_db},
          {"log1p_mae", svbrdf.log1p_mae},   {"ratio", svbrdf.ratio}};
}

}  // namespace

std::string JobResultToJson(const JobResult& result, int indent) {
  Json json;
  json["version"] = 1;
  json["status"] = StatusName(result.exit_code);
  json["exit_code"] = result.exit_code;
  if (result.error) {
    const bool gate = result.exit_code == kExitQualityGate;
    json["error"] = {{"code", gate ? "quality_gate" : ErrorCodeName(result.error->code)},
                     {"message", result.error->message}};
    if (!result.error_stage.empty()) json["error"]["stage"] = result.error_stage;
  }
  json["asset"] = result.asset;
  if (!result.container.empty()) json["container"] = result.container;
  if (!result.revision.empty()) json["revision"] = result.revision;
  if (!result.fingerprint.empty()) json["fingerprint"] = result.fingerprint;
  if (!result.profile.empty()) json["profile"] = result.profile;
  if (!result.quality.empty()) {
    json["quality"] = result.quality;
    json["recipe"] = result.recipe;
    json["seed"] = result.seed;
  }
  json["seconds"] = result.seconds;
  json["cpu_seconds"] = result.cpu_seconds;
  if (!result.stopped_by.empty()) {
    json["samples"] = result.samples;
    json["stopped_by"] = result.stopped_by;
    if (!result.choice.empty()) json["choice"] = result.choice;
  }
  if (result.psnr || result.brdf || result.svbrdf) json["bytes"] = result.bytes;
  if (result.brdf) json["brdf"] = BrdfJson(*result.brdf);
  if (result.svbrdf) json["svbrdf"] = SvbrdfJson(*result.svbrdf);
  if (result.psnr) {
    Json maps = Json::object();
    for (const auto& [role, db] : result.psnr->maps) maps[role] = db;
    json["psnr"] = {{"overall", result.psnr->overall_db},
                    {"mip0", result.psnr->mip0_db},
                    {"mean_mips", result.psnr->mean_mips_db},
                    {"maps", std::move(maps)}};
    json["ssim"] = OrNull(result.ssim);
    json["flip"] = OrNull(result.flip);
    json["normal_angle_deg"] = OrNull(result.normal_angle_deg);
  }
  json["warnings"] = result.warnings;
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

int ExitCodeFor(const Error& error, bool reading_input) {
  switch (error.code) {
    case ErrorCode::kCancelled:
      return kExitInterrupted;
    case ErrorCode::kResourceExhausted:
    case ErrorCode::kTimeout:
    case ErrorCode::kInternal:
      return kExitFailed;
    default:
      return reading_input ? kExitBadInput : kExitFailed;
  }
}

}  // namespace patina
