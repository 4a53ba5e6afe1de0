#include "pipeline/jobs/svbrdf_source.h"

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <optional>
#include <utility>

#include "formats/base/sha256.h"
#include "formats/layered/layered_file.h"
#include "formats/layered/varying_stack.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/pbr_maps.h"
#include "pipeline/jobs/svbrdf_job.h"
#include "pipeline/layered/simulated_source.h"
#include "pipeline/material/source_maps.h"
#include "pipeline/svbrdf/image_set_source.h"
#include "pipeline/svbrdf/modelled_source.h"
#include "pipeline/svbrdf/pbr_model.h"
#include "pipeline/svbrdf/stack_model.h"

namespace patina {
namespace {

std::string NameOf(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

Result<std::vector<std::string>> HashFiles(const std::vector<std::string>& paths, ThreadPool& pool,
                                           const CancelToken& cancel) {
  std::vector<std::string> digests(paths.size());
  std::mutex mutex;
  std::optional<std::pair<size_t, Error>> first_error;
  pool.ParallelFor(static_cast<int>(paths.size()), [&](int task, int) {
    if (cancel.cancelled()) return;
    const auto file = static_cast<size_t>(task);
    const auto digest = Sha256OfFile(paths[file]);
    if (digest) {
      digests[file] = digest->sha256;
      return;
    }
    const std::lock_guard lock(mutex);
    if (!first_error || file < first_error->first) first_error.emplace(file, digest.error());
  });
  if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
  if (first_error) return Fail(std::move(first_error->second));
  return digests;
}

// Hashes of the files from `first` on, those of images or maps.
std::string HashOfDigests(const std::vector<std::string>& digests, size_t first) {
  Sha256 hash;
  for (size_t i = first; i < digests.size(); ++i) hash.Update(digests[i] + "\n");
  return hash.FinishHex();
}

std::string Begin(const Job& job) {
  return "patina svbrdf\nrecipe " + std::to_string(kSvbrdfRecipeVersion) + "\njob " +
         CanonicalJob(job) + "\n";
}

// What of a configuration of colours decides bytes.
std::string ColorText(const ColorConfig& config, bool converted) {
  if (!converted && config.source() == ConfigSource::kBuiltin) return "";
  return "colors " + config.sha256() + "\n";
}

void AddFile(const std::string& path, const std::string& digest, SvbrdfSource* source) {
  source->files.push_back({ManifestPath(NameOf(path)), digest});
}

std::string SizeText(const svbrdf::TexelModel& model) {
  return std::to_string(model.width()) + " x " + std::to_string(model.height());
}

void UseModel(const Job& job, std::shared_ptr<const svbrdf::TexelModel> model,
              const layered::Outlook& outlook, SvbrdfSource* source) {
  auto modelled = std::make_shared<svbrdf::ModelledSource>(
      model, SvbrdfSamplingOfJob(job, model->exact(), outlook));
  if (modelled->width() != model->width()) {
    source->warnings.push_back("the maps of " + SizeText(*model) + " texels are baked at " +
                               std::to_string(modelled->width()) + " x " +
                               std::to_string(modelled->height()) +
                               ": f is the mean over the texels below.");
  }
  source->texels = std::move(modelled);
}

Result<SvbrdfSource> ReadImages(const Job& job, ThreadPool& pool, const CancelToken& cancel) {
  SvbrdfSource source;
  source.format = "image_set";
  PATINA_ASSIGN(const FileDigest list, Sha256OfFile(job.file));
  PATINA_ASSIGN(svbrdf::ImageSet set, svbrdf::ReadImageSet(job.file));
  source.paths = {job.file};
  for (size_t i = 0; i < set.images.size(); ++i) source.paths.push_back(set.PathOf(i));
  PATINA_ASSIGN(source.digests, HashFiles(source.paths, pool, cancel));
  source.digests[0] = list.sha256;  // from before it was read
  source.images = set.images.size();
  source.images_sha256 = HashOfDigests(source.digests, 1);
  source.found = NameOf(job.file) + ": " + std::to_string(source.images) + " images of " +
                 std::to_string(set.width) + " x " + std::to_string(set.height);
  AddFile(job.file, source.digests[0], &source);
  Sha256 hash;
  hash.Update(Begin(job) + "list " + source.digests[0] + "\nimages " + source.images_sha256 + "\n");
  source.fingerprint = hash.FinishHex();
  source.texels = std::make_shared<svbrdf::ImageSetSource>(std::move(set));
  return source;
}

Result<SvbrdfSource> ReadStack(const Job& job, ThreadPool& pool, const CancelToken& cancel) {
  SvbrdfSource source;
  source.format = "layered";
  PATINA_ASSIGN(const FileDigest list, Sha256OfFile(job.file));
  PATINA_ASSIGN(const layered::VaryingStack stack, layered::ReadVaryingStack(job.file));
  if (!stack.varies()) {
    return Fail(ErrorCode::kInvalidArgument,
                job.file +
                    ": none of its numbers comes from a map, so that it is the same everywhere; "
                    "bake it as kind \"brdf\", or give a map: {\"map\": \"thickness.png\"}");
  }
  const std::string folder = FolderOfFile(job.file);
  source.paths = {job.file};
  for (const std::string& file : stack.Files())
    source.paths.push_back(folder.empty() ? file : folder + "/" + file);
  ColorOptions color;
  auto config = ColorConfig::Load(job.ocio);
  if (!config) return Fail(config.error(), "/ocio");
  color.config = *config;
  color.space = job.color_space;
  // A file that is missing is named by the reader of the maps, with its pointer.
  auto digests = HashFiles(source.paths, pool, cancel);
  PATINA_ASSIGN(const auto model, svbrdf::StackModel::Load(stack, job.file, color, pool));
  if (!digests) return Fail(digests.error());
  source.digests = std::move(*digests);
  source.digests[0] = list.sha256;
  source.images_sha256 = HashOfDigests(source.digests, 1);
  for (size_t i = 0; i < source.paths.size(); ++i)
    AddFile(source.paths[i], source.digests[i], &source);
  const layered::Simulator mean(model->mean());
  auto outlook = layered::LookAhead(mean);
  if (!outlook) return Fail(outlook.error(), job.file);
  if (!model->exact()) source.simulated = model->mean();
  source.warnings = layered::WarningsOf(*outlook);
  source.warnings.insert(source.warnings.end(), model->warnings().begin(), model->warnings().end());
  source.effects = layered::EffectNames(model->effects());
  source.left_out = layered::LeftOutNames(model->effects());
  (model->has_normals() ? source.effects : source.left_out).push_back("normal map");
  source.found = NameOf(job.file) + ": layers to simulate with maps of " + SizeText(*model) +
                 (model->isotropic() ? ", isotropic" : ", anisotropic");
  Sha256 hash;
  hash.Update(Begin(job) + "layers " + source.digests[0] + "\nmaps " + source.images_sha256 + "\n" +
              ColorText(*config, model->used_color_config()));
  source.fingerprint = hash.FinishHex();
  UseModel(job, model, *outlook, &source);
  return source;
}

Result<SvbrdfSource> ReadTextureSet(const Job& job, const std::string& scratch_folder,
                                    ThreadPool& pool, const CancelToken& cancel,
                                    ProgressSink& progress) {
  SvbrdfSource source;
  source.format = kTextureSetFormat;
  PATINA_ASSIGN(PbrMaps input, ReadPbrMaps(job, scratch_folder));
  const MapSet& set = input.set;
  ReferenceOptions options;
  options.address = input.address;
  options.normal_convention =
      ParseNormalConvention(job.normal_convention).value_or(NormalConvention::kAuto);
  options.cancel = &cancel;
  auto config = ColorConfig::Load(job.ocio);
  if (!config) return Fail(config.error(), "/ocio");
  options.color.config = *config;
  options.color.space = job.color_space;
  std::string how = input.scene_text;
  std::vector<std::string> names;
  for (const MapSource& map : set.maps) {
    // A file may hold several maps.
    if (std::find(source.paths.begin(), source.paths.end(), map.path) != source.paths.end())
      continue;
    source.paths.push_back(map.path);
    names.push_back(input.scene ? map.file : NameOf(map.path));
  }
  PATINA_ASSIGN(source.digests, HashFiles(source.paths, pool, cancel));
  PATINA_ASSIGN(const SourceMaps maps, LoadSourceMaps(set, options, pool, progress));
  PATINA_ASSIGN(const auto model,
                svbrdf::PbrModel::Make(maps, set.name, input.address, pool, input.settings));
  bool converted = false;
  std::string used;
  for (const std::string& role : model->used()) used += (used.empty() ? "" : ", ") + role;
  for (const MapPlan& plan : maps.plans) {
    const ReferenceFile& file = maps.descriptions[static_cast<size_t>(plan.file)];
    how += "map " + std::string(plan.role->name);
    const auto path = std::find(source.paths.begin(), source.paths.end(), file.path);
    if (path != source.paths.end())
      how += " " + source.digests[static_cast<size_t>(path - source.paths.begin())];
    for (const int channel : plan.channels) how += " " + std::to_string(channel);
    how += std::string(plan.invert ? " inverted" : "") + (plan.srgb ? " srgb " : " linear ") +
           NormalConventionName(plan.convention);
    if (plan.color.transform != nullptr) how += " from " + plan.color.space;
    how += "\n";
    converted = converted || plan.color.transform != nullptr;
  }
  source.images_sha256 = HashOfDigests(source.digests, 0);
  for (size_t i = 0; i < source.paths.size(); ++i)
    source.files.push_back({ManifestPath(names[i]), source.digests[i]});
  source.effects = model->used();
  source.left_out = model->left_out();
  source.warnings = std::move(input.warnings);
  source.warnings.insert(source.warnings.end(), model->warnings().begin(), model->warnings().end());
  source.scene = std::move(input.scene);
  source.found = set.name + ": " + used + " of " + SizeText(*model);
  Sha256 hash;
  hash.Update(Begin(job) + how + ColorText(*config, converted));
  source.fingerprint = hash.FinishHex();
  UseModel(job, model, {}, &source);
  return source;
}

}  // namespace

Result<SvbrdfSource> ReadSvbrdfSource(const Job& job, const std::string& scratch_folder,
                                      ThreadPool& pool, const CancelToken& cancel,
                                      ProgressSink& progress) {
  if (job.file.empty()) return ReadTextureSet(job, scratch_folder, pool, cancel, progress);
  return layered::IsLayersFileName(job.file) ? ReadStack(job, pool, cancel)
                                             : ReadImages(job, pool, cancel);
}

Status CheckUnchanged(const SvbrdfSource& source, ThreadPool& pool, const CancelToken& cancel) {
  PATINA_ASSIGN(const std::vector<std::string> after, HashFiles(source.paths, pool, cancel));
  for (size_t i = 0; i < after.size(); ++i) {
    if (after[i] == source.digests[i]) continue;
    return Fail(ErrorCode::kConflict,
                source.paths[i] + ": it changed while it was read; bake again when it is complete");
  }
  return {};
}

}  // namespace patina
