#include "pipeline/jobs/svbrdf_package.h"

#include <nlohmann/json.hpp>

#include "formats/dds.h"
#include "formats/half.h"
#include "formats/model_bytes.h"
#include "pipeline/jobs/brdf_package.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/report.h"
#include "pipeline/jobs/svbrdf_job.h"
#include "pipeline/material/trainer.h"

namespace patina {
namespace {

using Json = nlohmann::ordered_json;

// Which of the two a model holds.
svbrdf::TextureForm FormOf(const svbrdf::TrainedSvbrdf& model) {
  return model.texels.empty() ? svbrdf::TextureForm::kBlocks : svbrdf::TextureForm::kHalves;
}

TextureFormat FormatOf(svbrdf::TextureForm form) {
  return form == svbrdf::TextureForm::kHalves ? TextureFormat::kRgba16f : TextureFormat::kBc6hUf16;
}

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

// The three features of a texture in all levels, as DdsTexture::halves.
Result<std::vector<std::vector<uint16_t>>> HalvesOf(const svbrdf::TrainedSvbrdf& model,
                                                    int texture) {
  const svbrdf::TextureShape& shape = model.shape.texture;
  std::vector<std::vector<uint16_t>> levels;
  size_t row = 0;
  for (int l = 0; l < shape.levels; ++l) {
    std::vector<uint16_t>& level = levels.emplace_back();
    const size_t texels = static_cast<size_t>(DdsLevelSide(shape.width, l)) *
                          static_cast<size_t>(DdsLevelSide(shape.height, l));
    for (size_t i = 0; i < texels; ++i, ++row) {
      const float* features = model.texels.data() + row * svbrdf::kRowFloats + 3 * texture;
      for (int c = 0; c < 3; ++c) {
        level.push_back(FloatToHalf(features[c]));
        if (!HalfIsFinite(level.back())) {
          return Fail(ErrorCode::kOutOfRange,
                      FeatureName(texture) + ": texel " + std::to_string(i) + " of level " +
                          std::to_string(l) +
                          " is beyond what halves hold; bake with another seed, or as bc6h");
        }
      }
    }
  }
  return levels;
}

}  // namespace

Status AddSvbrdfModel(const svbrdf::TrainedSvbrdf& model, StagingArea* staging) {
  const svbrdf::TextureShape& texture = model.shape.texture;
  for (int t = 0; t < texture.textures; ++t) {
    DdsTexture dds{FormatOf(FormOf(model)), texture.width, texture.height, {}, {}};
    if (dds.has_blocks()) {
      dds.levels = model.blocks[static_cast<size_t>(t)];
    } else {
      PATINA_ASSIGN(dds.halves, HalvesOf(model, t));
    }
    auto bytes = EncodeDds(dds);
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
    feature.format = TextureFormatName(FormatOf(TextureFormOfJob(job)));
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
  manifest.scene = source.scene;
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
  const bool blocks = FormOf(model) == svbrdf::TextureForm::kBlocks;
  json["training"] = {
      {"samples", model.samples},
      {"codes_in_use", model.used_codes},
      {"log1p_mae_free", model.free_loss},
      {blocks ? "log1p_mae_before_legal_blocks" : "log1p_mae_before_halves", model.block_loss},
      {"log1p_mae", model.final_loss},
      {"rollbacks", model.rollbacks}};
  return EndReport(std::move(json), manifest, payloads);
}

}  // namespace patina
