#include "pipeline/jobs/svbrdf_package.h"

#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>

#include "formats/base/sha256.h"
#include "formats/dds.h"
#include "formats/model_bytes.h"
#include "pipeline/jobs/brdf_package.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/report.h"
#include "pipeline/jobs/svbrdf_job.h"
#include "pipeline/material/trainer.h"

namespace patina {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kSourceFormat = "image_set";

std::string FeatureName(int texture) { return "features_" + std::to_string(texture) + ".dds"; }

// Of all images, in the order of the list.
Result<std::vector<std::string>> HashImages(const svbrdf::ImageSet& set, ThreadPool& pool,
                                            const CancelToken& cancel) {
  std::vector<std::string> digests(set.images.size());
  std::mutex mutex;
  std::optional<std::pair<size_t, Error>> first_error;
  pool.ParallelFor(static_cast<int>(set.images.size()), [&](int task, int) {
    if (cancel.cancelled()) return;
    const auto image = static_cast<size_t>(task);
    const auto digest = Sha256OfFile(set.PathOf(image));
    if (digest) {
      digests[image] = digest->sha256;
      return;
    }
    const std::lock_guard lock(mutex);
    if (!first_error || image < first_error->first) first_error.emplace(image, digest.error());
  });
  if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
  if (first_error) {
    return Fail(std::move(first_error->second),
                set.path + ": /images/" + std::to_string(first_error->first) + "/file");
  }
  return digests;
}

}  // namespace

Result<SvbrdfSource> ReadSvbrdfSource(const Job& job, ThreadPool& pool, const CancelToken& cancel) {
  SvbrdfSource source;
  PATINA_ASSIGN(const FileDigest list, Sha256OfFile(job.file));
  PATINA_ASSIGN(source.set, svbrdf::ReadImageSet(job.file));
  PATINA_ASSIGN(const std::vector<std::string> digests, HashImages(source.set, pool, cancel));
  source.sha256 = list.sha256;
  Sha256 images;
  for (const std::string& digest : digests) images.Update(digest + "\n");
  source.images_sha256 = images.FinishHex();
  Sha256 hash;
  hash.Update("patina svbrdf\nrecipe " + std::to_string(kSvbrdfRecipeVersion) + "\njob " +
              CanonicalJob(job) + "\nlist " + source.sha256 + "\nimages " + source.images_sha256 +
              "\n");
  source.fingerprint = hash.FinishHex();
  return source;
}

Status AddSvbrdfModel(const svbrdf::TrainedSvbrdf& model, StagingArea* staging) {
  const svbrdf::TextureShape& texture = model.shape.texture;
  for (int t = 0; t < texture.textures; ++t) {
    auto bytes = EncodeDds(bc6h::Format::kUf16, texture.width, texture.height,
                           model.blocks[static_cast<size_t>(t)]);
    if (!bytes) return AsInternal(Fail(bytes.error(), FeatureName(t)));
    PATINA_TRY(staging->AddPayload(FeatureName(t), "features", *bytes));
  }
  return AddGridAndNetwork(model.pack, model.network, staging);
}

Manifest DescribeSvbrdf(const Job& job, const SvbrdfSource& source,
                        const svbrdf::SvbrdfShape& shape) {
  Manifest manifest =
      BeginManifest(job, JobKind::kSvbrdf, kSvbrdfRecipeVersion, source.fingerprint);
  const svbrdf::TextureShape& texture = shape.texture;
  for (int t = 0; t < texture.textures; ++t) {
    ManifestFeature feature;
    feature.payload = FeatureName(t);
    feature.width = texture.width;
    feature.height = texture.height;
    feature.levels = texture.levels;
    manifest.features.push_back(std::move(feature));
  }
  ManifestBrdf model;
  model.source_format = kSourceFormat;
  model.cells = uint64_t{source.set.images.size()} * static_cast<uint64_t>(texture.width) *
                static_cast<uint64_t>(texture.height);
  model.images = ManifestImageSet{source.set.images.size(), texture.width, texture.height,
                                  AddressModeName(texture.address), source.images_sha256};
  model.files.push_back(
      {ManifestPath(std::filesystem::path(job.file).filename().string()), source.sha256});
  DescribeBrdfModel(shape.model, texture.features(), &model);
  manifest.brdf = std::move(model);
  return manifest;
}

void DescribeSvbrdfQuality(const SvbrdfMeasurement& measurement, ManifestBrdf* model) {
  ManifestBrdfQuality quality;
  quality.image_mae = measurement.error.mae_srgb;
  quality.image_rmse = measurement.error.rmse_srgb;
  quality.image_ssim = measurement.error.ssim;
  quality.log1p_mse = measurement.log1p.mse;
  model->quality = std::move(quality);
}

std::string SvbrdfReportToJson(const Manifest& manifest,
                               const std::vector<ManifestPayload>& payloads,
                               const SvbrdfSource& source, const SvbrdfMeasurement& measurement,
                               const svbrdf::TrainedSvbrdf& model) {
  const ManifestBrdf& described = *manifest.brdf;
  Json json = BeginBrdfReport(manifest);
  json["source"] = {{"format", described.source_format},
                    {"file", described.files[0].path},
                    {"images", described.images->images},
                    {"width", described.images->width},
                    {"height", described.images->height}};
  json["model"] = BrdfModelJson(described);
  json["quality"]["planes"] = Json::array();
  for (const SvbrdfPlane& plane : measurement.planes) {
    json["quality"]["planes"].push_back({{"image", source.set.images[plane.image].file},
                                         {"light_deg", plane.light_deg},
                                         {"view_deg", plane.view_deg},
                                         {"mse", plane.mse},
                                         {"psnr", PsnrOfMse(plane.mse)},
                                         {"mae", plane.error.mae_srgb},
                                         {"rmse", plane.error.rmse_srgb},
                                         {"ssim", plane.error.ssim}});
  }
  json["quality"]["log1p"] = {{"texels", measurement.log1p.pairs},
                              {"mae", measurement.log1p.mae},
                              {"mse", measurement.log1p.mse}};
  json["compression_ratio"] = CompressionRatio(described, ModelBytes(payloads));
  json["training"] = {
      {"samples", model.samples},          {"codes_in_use", model.used_codes},
      {"log1p_mae_free", model.free_loss}, {"log1p_mae_before_legal_blocks", model.block_loss},
      {"log1p_mae", model.final_loss},     {"rollbacks", model.rollbacks}};
  return EndReport(std::move(json), manifest, payloads);
}

}  // namespace patina
