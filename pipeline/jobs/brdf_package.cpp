#include "pipeline/jobs/brdf_package.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>

#include "formats/base/file_io.h"
#include "formats/base/sha256.h"
#include "formats/brdf_sampler.h"
#include "formats/index_pack.h"
#include "formats/layered/layered_file.h"
#include "formats/manifest_json.h"
#include "formats/weights.h"
#include "pipeline/brdf/anisotropy.h"
#include "pipeline/brdf/sampler_fit.h"
#include "pipeline/jobs/brdf_effects.h"
#include "pipeline/jobs/brdf_job.h"
#include "pipeline/jobs/load_brdf_decoder.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/report.h"

namespace patina {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kGridName = "grid.hpx";
constexpr const char* kWeightsName = "decoder.weights";
constexpr const char* kSamplerName = "sampler.bin";

std::string FileName(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

// Messages that begin with the path of a file shall begin with its name: what is written must not
// depend on where the file lies.
std::string WithoutFolder(std::string message, const std::string& path) {
  const std::string name = FileName(path);
  for (size_t at = 0; (at = message.find(path, at)) != std::string::npos; at += name.size())
    message.replace(at, path.size(), name);
  return message;
}

Json Log1pJson(const Log1pError& error) {
  return {{"pairs", error.pairs}, {"mae", error.mae}, {"mse", error.mse}};
}

Json QualityJson(const BrdfMeasurement& measurement, bool is_list) {
  Json json;
  if (measurement.image) {
    json["image"] = {{"mae", measurement.image->mae_srgb},
                     {"rmse", measurement.image->rmse_srgb},
                     {"ssim", measurement.image->ssim},
                     {"mae_linear", measurement.image->mae_linear},
                     {"rmse_linear", measurement.image->rmse_linear}};
  }
  if (is_list) {
    json["log1p"] = {{"measurements", Log1pJson(measurement.all)}};
  } else {
    json["log1p"] = {{"half_angles", Log1pJson(measurement.half_angles)},
                     {"directions", Log1pJson(measurement.directions)},
                     {"all", Log1pJson(measurement.all)}};
  }
  json["reciprocity_error"] = measurement.reciprocity;
  json["albedo"] = Json::array();
  for (size_t i = 0; i < kAlbedoDegrees.size(); ++i)
    json["albedo"].push_back({{"theta_deg", kAlbedoDegrees[i]}, {"rgb", measurement.albedo[i]}});
  return json;
}

}  // namespace

nlohmann::ordered_json BrdfModelJson(const ManifestBrdf& model) {
  return {{"nside", model.nside},
          {"primitive_size", model.primitive_size},
          {"index_bits", model.index_bits},
          {"interpolation", model.interpolation},
          {"isotropic", model.isotropic},
          {"canonical_order", model.canonical_order},
          {"angle_inputs", model.angle_inputs},
          {"half_vector_inputs", model.half_vector_inputs},
          {"layers", model.layers}};
}

Result<BrdfSource> ReadBrdfSource(const Job& job) {
  // Hashed before and after reading: a file that is still being copied must not get a container
  // under a wrong name.
  PATINA_ASSIGN(const FileDigest before, Sha256OfFile(job.file));
  BrdfSource source;
  if (layered::IsLayersFileName(job.file)) {
    PATINA_ASSIGN(source.stack, layered::ReadStack(job.file));
    auto simulated = layered::SimulatedSource(*source.stack, EffortOfJob(job));
    if (!simulated) return Fail(simulated.error(), job.file);
    source.data = std::move(*simulated);
  } else {
    PATINA_ASSIGN(source.data, brdf::OpenBrdf(job.file));
  }
  PATINA_ASSIGN(const FileDigest after, Sha256OfFile(job.file));
  if (before.sha256 != after.sha256) {
    return Fail(ErrorCode::kConflict,
                job.file + ": it changed while it was read; bake again when it is complete");
  }
  for (std::string& warning : source.data.warnings) warning = WithoutFolder(warning, job.file);
  source.sha256 = after.sha256;
  brdf::Source& data = source.data;
  if (!data.isotropic && data.table && !data.simulated) {
    source.anisotropy =
        brdf::MeasureAnisotropy(*data.table, static_cast<double>(data.max_theta_rad));
    data.isotropic = *source.anisotropy <= brdf::kIsotropicWithin;
  }
  source.fingerprint = BrdfFingerprint(job, source);
  return source;
}

std::string BrdfFingerprint(const Job& job, const BrdfSource& source,
                            const std::vector<std::string>& group) {
  Sha256 hash;
  hash.Update("patina brdf\nrecipe " + std::to_string(kBrdfRecipeVersion) + "\njob " +
              CanonicalJob(job) + "\nfile " + source.sha256 + "\n");
  // Versions without this measure trained such files as anisotropic.
  if (source.anisotropy && source.data.isotropic) hash.Update("without azimuth\n");
  for (const std::string& member : group) hash.Update("trained with " + member + "\n");
  return hash.FinishHex();
}

Result<SharedCodebook> WriteSharedCodebook(const brdf::TrainedBrdf& model,
                                           const std::string& folder) {
  auto bytes = EncodeCodebook({model.pack.primitive_size, model.pack.codebook});
  if (!bytes) return Fail(ErrorCode::kInternal, "the shared codebook: " + bytes.error().message);
  Sha256 hash;
  hash.Update(*bytes);
  SharedCodebook shared;
  shared.sha256 = hash.FinishHex();
  shared.file = "codebook-" + shared.sha256.substr(0, 16) + ".hpc";
  PATINA_TRY(WriteFileDurably(folder + "/" + shared.file, *bytes));
  return shared;
}

Status AddBrdfModel(const brdf::TrainedBrdf& model, const SharedCodebook& shared,
                    StagingArea* staging) {
  IndexPack pack = model.pack;
  if (!shared.file.empty()) {
    pack.codebook.clear();
    pack.codebook_file = shared.file;
    pack.codebook_sha256 = shared.sha256;
  }
  return AddGridAndNetwork(pack, model.network, staging);
}

Status AddGridAndNetwork(const IndexPack& pack, const WeightBuffer& network, StagingArea* staging) {
  auto grid = EncodeIndexPack(pack);
  if (!grid) return AsInternal(Fail(grid.error(), kGridName));
  PATINA_TRY(staging->AddPayload(kGridName, "grid", *grid));
  auto weights = EncodeWeights(network);
  if (!weights) return AsInternal(Fail(weights.error(), kWeightsName));
  return staging->AddPayload(kWeightsName, "weights", *weights);
}

Status AddBrdfSampler(StagingArea* staging, ManifestBrdf* model) {
  PATINA_ASSIGN(const BrdfDecoder decoder, LoadBrdfDecoder(staging->directory()));
  const brdf::Luminance luminance = [&decoder](const float wi[3], const float wo[3]) {
    float rgb[3];
    decoder.Evaluate(wi, wo, rgb);
    return 0.2126 * static_cast<double>(rgb[0]) + 0.7152 * static_cast<double>(rgb[1]) +
           0.0722 * static_cast<double>(rgb[2]);
  };
  auto bytes = EncodeBrdfSampler(
      brdf::FitSampler(brdf::DefaultSamplerShape(decoder.isotropic()), luminance));
  if (!bytes) return AsInternal(Fail(bytes.error(), kSamplerName));
  PATINA_TRY(staging->AddPayload(kSamplerName, "sampler", *bytes));
  model->sampler = kSamplerName;
  return {};
}

void DescribeBrdfModel(const brdf::ModelShape& shape, int texture_inputs, ManifestBrdf* model) {
  model->grid = kGridName;
  model->network = kWeightsName;
  model->nside = shape.grid.nside;
  model->primitive_size = shape.primitive_size;
  model->index_bits = shape.index_bits;
  model->interpolation = InterpolationName(shape.grid.interpolation);
  model->isotropic = shape.grid.isotropic;
  model->canonical_order = shape.grid.canonical_order;
  model->angle_inputs = shape.grid.angle_inputs;
  model->half_vector_inputs = shape.grid.half_vector_inputs;
  model->layers.push_back(2 * shape.primitive_size + shape.grid.extra_inputs() + texture_inputs);
  model->layers.insert(model->layers.end(), static_cast<size_t>(shape.hidden_layers), shape.hidden);
  model->layers.push_back(brdf::kOutputs);
}

Manifest DescribeBrdf(const Job& job, const BrdfSource& source, const brdf::ModelShape& shape,
                      const SharedCodebook& shared) {
  Manifest manifest = BeginManifest(job, JobKind::kBrdf, kBrdfRecipeVersion, source.fingerprint);
  manifest.warnings = source.data.warnings;
  ManifestBrdf model;
  model.source_format = source.data.format;
  if (source.data.simulated) {
    const brdf::SimulationCost cost = source.data.simulated->Spent();
    model.simulation = ManifestSimulation{cost.pairs, cost.paths, cost.standard_error,
                                          source.data.effects, source.data.left_out_effects};
  }
  model.cells = source.data.cells;
  model.invalid_cells = source.data.invalid_cells;
  model.files.push_back({ManifestPath(FileName(job.file)), source.sha256});
  model.shared_codebook_file = shared.file;
  model.shared_codebook_sha256 = shared.sha256;
  DescribeBrdfModel(shape, 0, &model);
  manifest.brdf = std::move(model);
  manifest.effects = DescribeBrdfEffects(job, source, shape);
  return manifest;
}

void DescribeBrdfQuality(const BrdfMeasurement& measurement, ManifestBrdf* model) {
  ManifestBrdfQuality quality;
  if (measurement.image) {
    quality.image_mae = measurement.image->mae_srgb;
    quality.image_rmse = measurement.image->rmse_srgb;
    quality.image_ssim = measurement.image->ssim;
  }
  quality.log1p_mse = measurement.all.mse;
  quality.reciprocity_error = measurement.reciprocity;
  for (size_t i = 0; i < kAlbedoDegrees.size(); ++i)
    quality.albedo.push_back({kAlbedoDegrees[i], measurement.albedo[i]});
  model->quality = std::move(quality);
}

Json BeginBrdfReport(const Manifest& manifest) {
  return {{"version", 1},
          {"kind", manifest.kind},
          {"asset", manifest.asset},
          {"fingerprint", manifest.fingerprint},
          {"quality_setting", manifest.quality_setting},
          {"recipe", manifest.tool.recipe}};
}

std::vector<RunCurvePoint> CurveOf(const std::vector<brdf::CurvePoint>& points) {
  std::vector<RunCurvePoint> curve;
  for (const brdf::CurvePoint& point : points) {
    curve.push_back({point.samples,
                     point.wall_s,
                     {{"cpu_seconds", point.cpu_s}, {"log1p_mae", point.log1p_mae}}});
  }
  return curve;
}

std::string BrdfReportToJson(const Manifest& manifest, const std::vector<ManifestPayload>& payloads,
                             const BrdfSource& source, const BrdfMeasurement& measurement,
                             const brdf::TrainedBrdf& model) {
  const ManifestBrdf& described = *manifest.brdf;
  Json json = BeginBrdfReport(manifest);
  json["source"] = {
      {"format", described.source_format},
      {"file", described.files[0].path},
      {"cells", described.cells},
      {"invalid_cells", described.invalid_cells},
      {"isotropic", source.data.isotropic},
      {"max_theta_deg", static_cast<double>(source.data.max_theta_rad) * 180 / std::numbers::pi}};
  if (described.simulation) {
    json["source"]["simulation"] = {{"pairs", described.simulation->pairs},
                                    {"paths", described.simulation->paths},
                                    {"standard_error", described.simulation->standard_error},
                                    {"effects", described.simulation->effects},
                                    {"left_out", described.simulation->left_out}};
  }
  if (source.anisotropy) json["source"]["anisotropy"] = *source.anisotropy;
  json["effects"] = EffectsToJson(manifest.effects);
  json["model"] = BrdfModelJson(described);
  json["quality"] = QualityJson(measurement, source.data.table == nullptr);
  json["training"] = {
      {"samples", model.samples},
      {"codes", model.pack.codebook.size() / static_cast<size_t>(described.primitive_size)},
      {"codes_in_use", model.used_codes},
      {"log1p_mae_before_codebook", model.free_loss},
      {"log1p_mae", model.final_loss},
      {"rollbacks", model.rollbacks}};
  return EndReport(std::move(json), manifest, payloads);
}

}  // namespace patina
