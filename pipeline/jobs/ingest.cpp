#include "pipeline/jobs/ingest.h"

#include <bit>
#include <map>

#include "formats/base/names.h"
#include "formats/base/sha256.h"
#include "formats/scene/scene_json.h"

namespace patina {
namespace {

// SHA-256 of each file by its path.
Result<std::map<std::string, std::string>> HashFiles(const std::vector<std::string>& paths,
                                                     const CancelToken& cancel) {
  std::map<std::string, std::string> hashes;
  for (const std::string& path : paths) {
    if (hashes.count(path) != 0) continue;
    if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
    PATINA_ASSIGN(FileDigest digest, Sha256OfFile(path));
    hashes[path] = std::move(digest.sha256);
  }
  return hashes;
}

// What of a scene decides bytes, for the fingerprint; empty without one.
std::string SceneText(const JobMaps& maps) {
  if (!maps.scene) return "";
  std::string text =
      "scene " +
      SceneLookToJson(*maps.scene).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  text += maps.address == AddressMode::kClamp ? " clamp" : " wrap";
  for (const ConstantMap& constant : maps.constants) {
    text += " " + constant.role;
    for (const float value : constant.value)
      text += " " + std::to_string(std::bit_cast<uint32_t>(value));
  }
  for (const Effect& effect : maps.left_out) text += " without " + effect.what;
  if (maps.lod_range)
    text += " mips " + std::to_string((*maps.lod_range)[0]) + " " +
            std::to_string((*maps.lod_range)[1]);
  if (maps.density) {
    for (const double value :
         {maps.density->uv_size_m, maps.density->min_pixels_per_m, maps.density->max_pixels_per_m})
      text += " " + std::to_string(std::bit_cast<uint64_t>(value));
  }
  return text + "\n";
}

}  // namespace

Result<JobSource> ReadSource(const Job& job, const JobMaps& maps, ThreadPool& pool,
                             const CancelToken& cancel, ProgressSink& progress,
                             SharedImages* images) {
  ReferenceOptions options;
  options.address = maps.address.value_or(job.address);
  options.normal_convention =
      ParseNormalConvention(job.normal_convention).value_or(NormalConvention::kAuto);
  options.repair_nonfinite = job.repair_nonfinite;
  options.widen_roughness = job.toksvig;
  options.cancel = &cancel;
  auto config = ColorConfig::Load(job.ocio);
  if (!config) return Fail(std::move(config).error(), "/ocio");
  options.color = {job.working_space, *config, job.color_space};
  options.opacity_cutoff = maps.opacity_cutoff;
  options.constants = maps.constants;
  options.effects = job.effects;
  options.lod_range = job.lod_range ? job.lod_range : maps.lod_range;
  if (!job.lod_range) options.density = maps.density;
  for (const std::string& warning : maps.warnings) progress.OnWarning(warning);

  // Hashed before and after reading: a file that is still being copied must not get a container
  // under a wrong name.
  std::vector<std::string> paths;
  for (const MapSource& map : maps.set.maps) paths.push_back(map.path);
  PATINA_ASSIGN(const auto before, HashFiles(paths, cancel));
  if (images != nullptr) {
    options.read_image = [&](const std::string& path) {
      return images->Read(before.at(path), path);
    };
  }
  JobSource source;
  source.color_config = *config;
  source.scene = maps.scene;
  PATINA_ASSIGN(source.reference, BuildReference(maps.set, options, pool, progress));
  std::vector<std::string>& warnings = source.reference.warnings;
  warnings.insert(warnings.begin(), maps.warnings.begin(), maps.warnings.end());
  std::vector<Effect>& effects = source.reference.effects;
  effects.insert(effects.end(), maps.left_out.begin(), maps.left_out.end());
  PATINA_ASSIGN(const auto after, HashFiles(paths, cancel));
  for (const auto& [path, hash] : after) {
    if (before.at(path) != hash) {
      return Fail(ErrorCode::kConflict,
                  path + ": it changed while it was read; bake again when it is complete");
    }
  }
  for (const ReferenceFile& file : source.reference.files) {
    const auto found = after.find(file.path);
    if (found == after.end()) {
      return Fail(ErrorCode::kInternal, file.path + ": read without being a file of the set");
    }
    source.sha256.push_back(found->second);
  }
  source.fingerprint =
      FingerprintOf(job, maps, source.reference, source.color_config, source.sha256);
  return source;
}

std::string FingerprintOf(const Job& job, const JobMaps& maps, const SourceReference& reference,
                          const ColorConfig& color_config, const std::vector<std::string>& sha256) {
  Sha256 hash;
  bool converted = false;
  hash.Update("patina material\nrecipe " + std::to_string(kRecipeVersion) + "\njob " +
              CanonicalJob(job) + "\n");
  for (const ReferenceMap& map : reference.maps) {
    std::string line = "map " + map.role;
    line += " " + (map.file < 0 ? std::string("none") : sha256[static_cast<size_t>(map.file)]);
    for (const int channel : map.file_channels) line += " " + std::to_string(channel);
    line += map.inverted ? " inverted" : "";
    line += map.srgb ? " srgb" : " linear";
    line += std::string(" ") + NormalConventionName(map.convention);
    // Nothing is said of what was always so: containers of earlier versions keep their
    // fingerprints.
    if (map.converted) line += " from " + QuoteForMessage(map.color_space);
    if (map.encoding == Encoding::kSignedLog) line += " signed_log";
    hash.Update(line + "\n");
    converted = converted || map.converted;
  }
  if (converted || color_config.source() != ConfigSource::kBuiltin)
    hash.Update("colors " + color_config.sha256() + "\n");
  hash.Update(SceneText(maps));
  return hash.FinishHex();
}

}  // namespace patina
