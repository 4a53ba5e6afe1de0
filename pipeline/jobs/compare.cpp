#include "pipeline/jobs/compare.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "pipeline/jobs/job_sets.h"

namespace patina {
namespace {

using Json = nlohmann::ordered_json;

Json OrNull(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

std::string Cell(const std::optional<double>& value, int digits) {
  char text[32];
  if (!value) return "         -";
  std::snprintf(text, sizeof text, "%10.*f", digits, *value);
  return text;
}

}  // namespace

Result<JobSource> ReadSourceOf(const Container& opened, const Job& source, ThreadPool& pool,
                               const CancelToken& cancel, ProgressSink& progress) {
  if (opened.manifest.kind != "material" || source.kind != JobKind::kMaterial) {
    return Fail(ErrorCode::kUnsupported,
                opened.directory +
                    ": only materials are compared with maps; `patina info` tells how good a BRDF "
                    "is, and `patina validate --against SOURCE` measures it again");
  }
  if (!source.scene.empty()) {
    return Fail(ErrorCode::kUnsupported,
                opened.directory +
                    ": it is not compared with a scene; `patina info` tells how good "
                    "it is");
  }
  Job job = source;
  job.address =
      opened.manifest.source.address == "clamp" ? AddressMode::kClamp : AddressMode::kWrap;
  job.working_space =
      ParseWorkingSpace(opened.manifest.working_space).value_or(WorkingSpace::kLinearRec709);
  // What the container has no mips or channels for is not compared.
  job.lod_range = opened.manifest.lod_range;
  // Against every sample, those included that count as constant.
  job.effects = EffectSwitches();
  job.effects.constant_tolerance = 0;
  job.effects.equal = job.effects.unused = false;
  PATINA_ASSIGN(const MapSet set, MapsOfJob(job));
  PATINA_ASSIGN(JobSource read, ReadSource(job, set, pool, cancel, progress));
  for (const ReferenceMap& map : read.reference.maps) {
    for (const ManifestMap& baked : opened.manifest.maps) {
      if (baked.role != map.role || baked.color_space.empty() ||
          baked.color_space == map.color_space)
        continue;
      return Fail(ErrorCode::kConflict,
                  opened.directory + ": its " + map.role + " was read as \"" + baked.color_space +
                      "\", now it would be as \"" + map.color_space +
                      "\"; give the --color-space and the --ocio of the bake");
    }
  }
  return read;
}

bool IsSameSource(const Container& opened, const JobSource& read) {
  const std::vector<ManifestSourceFile>& files = opened.manifest.source.files;
  return files.size() == read.sha256.size() &&
         std::all_of(files.begin(), files.end(), [&](const ManifestSourceFile& file) {
           return std::find(read.sha256.begin(), read.sha256.end(), file.sha256) !=
                  read.sha256.end();
         });
}

Result<Comparison> CompareContainer(const std::string& container, const Job& source,
                                    ThreadPool& pool, const CancelToken& cancel,
                                    ProgressSink& progress) {
  PATINA_ASSIGN(const Container opened, OpenContainer(container));
  PATINA_TRY(VerifyPayloads(opened));
  PATINA_ASSIGN(const JobSource read, ReadSourceOf(opened, source, pool, cancel, progress));
  Comparison comparison;
  comparison.asset = opened.manifest.asset;
  comparison.directory = opened.directory;
  PATINA_ASSIGN(comparison.measurement, MeasureContainer(opened.directory, read.reference.material,
                                                         pool, cancel, progress, {}));
  comparison.same_source = IsSameSource(opened, read);
  return comparison;
}

std::string ComparisonToJson(const Comparison& comparison) {
  const metrics::QualityResult& quality = comparison.measurement.quality;
  const PsnrSummary psnr = SummarizePsnr(quality);
  Json maps = Json::object();
  for (const auto& [role, db] : psnr.maps) maps[role] = db;
  Json json;
  json["asset"] = comparison.asset;
  json["container"] = comparison.directory;
  json["psnr"] = {
      {"overall", psnr.overall_db}, {"mip0", psnr.mip0_db}, {"mean_mips", psnr.mean_mips_db}};
  json["psnr"]["maps"] = std::move(maps);
  json["ssim"] = OrNull(quality.ssim);
  json["flip"] = OrNull(quality.flip);
  json["normal_angle_deg"] = OrNull(quality.normal_angle_deg);
  json["same_source"] = comparison.same_source;
  json["not_compared"] = comparison.measurement.not_compared;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string ComparisonText(const Comparison& comparison) {
  const metrics::QualityResult& quality = comparison.measurement.quality;
  std::string text = comparison.asset + "  (" + comparison.directory + ")\n";
  text +=
      "                     overall dB   mip 0 dB    mips dB       SSIM       FLIP    degrees\n";
  auto row = [&](std::string name, const metrics::PsnrTable& psnr,
                 const std::optional<double>& ssim, const std::optional<double>& flip,
                 const std::optional<double>& angle) {
    name.resize(20, ' ');
    text += name + Cell(CapPsnr(psnr.overall_db), 2) + " " + Cell(CapPsnr(psnr.mip0_db), 2) + " " +
            Cell(CapPsnr(psnr.mean_mips_db), 2) + " " + Cell(ssim, 4) + " " + Cell(flip, 4) + " " +
            Cell(angle, 3) + "\n";
  };
  for (const metrics::MapQuality& map : quality.maps)
    row(map.name, map.psnr, map.ssim, map.flip, map.normal_angle_deg);
  row("all", quality.psnr, quality.ssim, quality.flip, quality.normal_angle_deg);
  text += comparison.same_source ? "The source is the one it was baked from.\n"
                                 : "The source's files are not those it was baked from.\n";
  for (const std::string& map : comparison.measurement.not_compared) {
    text += "Not compared, because only one side has it: " + map + "\n";
  }
  return text;
}

}  // namespace patina
