#include "pipeline/jobs/svbrdf_package.h"

#include <nlohmann/json.hpp>

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

std::string FeatureName(int texture) { return "features_" + std::to_string(texture) + ".dds"; }

// What of a model with maps was not learned. Of layers the list of their simulation says the rest.
std::vector<ManifestEffect> EffectsOf(const SvbrdfSource& source, const brdf::GridShape& grid) {
  std::vector<ManifestEffect> effects;
  if (source.format == kTextureSetFormat) {
    for (const std::string& role : source.left_out)
      effects.push_back({role, "left_out", "it is no part of the reflectance", std::nullopt});
  }
  if (grid.isotropic) {
    effects.push_back({"azimuth", "left_out", "no texel has one", std::nullopt});
  } else {
    effects.push_back({"azimuth", "learned", "", std::nullopt});
  }
  if (grid.canonical_order) {
    effects.push_back(
        {"f(wo, wi)", "derived", "it is f(wi, wo): the directions are put in order", std::nullopt});
  } else {
    effects.push_back({"f(wo, wi)", "learned", "", std::nullopt});
  }
  return effects;
}

}  // namespace

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
                        const svbrdf::SvbrdfShape& shape, const brdf::SimulationCost& cost) {
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
  model.source_format = source.format;
  model.cells =
      source.images * static_cast<uint64_t>(texture.width) * static_cast<uint64_t>(texture.height);
  model.images = ManifestImageSet{source.images, texture.width, texture.height,
                                  AddressModeName(texture.address), source.images_sha256};
  model.files = source.files;
  if (source.simulated) {
    model.simulation = ManifestSimulation{cost.pairs, cost.paths, cost.standard_error,
                                          source.effects, source.left_out};
  }
  if (source.images == 0) manifest.effects = EffectsOf(source, shape.model.grid);
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
  if (!source.effects.empty()) {
    json["source"]["effects"] = source.effects;
    json["source"]["left_out"] = source.left_out;
  }
  json["model"] = BrdfModelJson(described);
  json["quality"]["planes"] = Json::array();
  for (const SvbrdfPlane& plane : measurement.planes) {
    json["quality"]["planes"].push_back({{"image", source.texels->pairs()[plane.image].name},
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
  if (source.images > 0)
    json["compression_ratio"] = CompressionRatio(described, ModelBytes(payloads));
  json["training"] = {
      {"samples", model.samples},          {"codes_in_use", model.used_codes},
      {"log1p_mae_free", model.free_loss}, {"log1p_mae_before_legal_blocks", model.block_loss},
      {"log1p_mae", model.final_loss},     {"rollbacks", model.rollbacks}};
  return EndReport(std::move(json), manifest, payloads);
}

}  // namespace patina
