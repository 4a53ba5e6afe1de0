#include "pipeline/jobs/package.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "formats/base/names.h"
#include "formats/dds.h"
#include "formats/weights.h"
#include "pipeline/jobs/effect_costs.h"
#include "pipeline/material/trainer.h"

namespace patina {
namespace {

constexpr const char* kWeightsName = "decoder.weights";

std::string FeatureName(int texture) { return "features_" + std::to_string(texture) + ".dds"; }

ManifestSource DescribeSource(const JobSource& source) {
  const SourceReference& reference = source.reference;
  ManifestSource described;
  described.width = reference.width;
  described.height = reference.height;
  described.levels = DdsFullChainLevels(reference.width, reference.height);
  described.address = AddressModeName(reference.material.pyramid.address);
  for (const ReferenceMap& map : reference.maps) {
    if (map.convention != NormalConvention::kAuto && map.role == "normal") {
      described.normal_convention = NormalConventionName(map.convention);
    }
  }
  for (size_t i = 0; i < reference.files.size(); ++i) {
    const ReferenceFile& file = reference.files[i];
    ManifestSourceFile entry;
    entry.path = ManifestPath(file.file);
    entry.roles = file.roles;
    entry.sha256 = source.sha256[i];
    entry.width = file.width;
    entry.height = file.height;
    entry.channels = file.channels;
    entry.type = SampleTypeName(file.type);
    entry.file_format = file.format;
    described.files.push_back(std::move(entry));
  }
  return described;
}

void DescribeModel(const TrainedMaterial& model, const MaterialReference& reference,
                   Manifest* manifest) {
  for (int t = 0; t < kFeatureTextures; ++t) {
    const FeatureShape& shape = model.shape[static_cast<size_t>(t)];
    manifest->features.push_back({FeatureName(t), shape.width, shape.height, shape.levels,
                                  -shape.lod_shift - reference.pyramid.first_mip, "BC6H_UF16"});
  }
  ManifestNetwork network;
  network.payload = kWeightsName;
  network.inputs = kNetworkInputs;
  network.hidden = kNetworkHidden;
  network.outputs = model.outputs;
  manifest->network = network;
  manifest->training.samples = static_cast<uint64_t>(model.samples);
  manifest->training.stopped_by = model.stopped_by;
  manifest->training.float_psnr_mip0_db = CapPsnr(model.float_psnr_mip0_db);
  manifest->training.float_psnr_mean_mips_db = CapPsnr(model.float_psnr_mean_mips_db);
  manifest->training.rollbacks = model.rollbacks;
  for (const CurvePoint& point : model.curve) {
    manifest->training.curve.push_back(
        {static_cast<uint64_t>(point.samples), CapPsnr(point.psnr_mip0_db),
         CapPsnr(point.psnr_mean_mips_db), MapsOfPoint(reference, point)});
  }
}

}  // namespace

std::string ManifestPath(const std::string& file) {
  if (CheckRelativePath(file, "")) return file;
  std::string name = std::filesystem::path(file).filename().string();
  for (char& c : name) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '.';
    if (!plain) c = '_';
  }
  if (name.size() > 100) name = name.substr(name.size() - 100);
  return CheckRelativePath(name, "") ? name : "file_" + name;
}

Status AsInternal(Status status) {
  if (!status && status.error().code == ErrorCode::kInvalidArgument)
    status.error().code = ErrorCode::kInternal;
  return status;
}

Status AddModel(const TrainedMaterial& model, StagingArea* staging) {
  for (int t = 0; t < kFeatureTextures; ++t) {
    const FeatureShape& shape = model.shape[static_cast<size_t>(t)];
    auto bytes = EncodeDds(bc6h::Format::kUf16, shape.width, shape.height,
                           model.blocks[static_cast<size_t>(t)]);
    if (!bytes) return AsInternal(Fail(bytes.error(), FeatureName(t)));
    PATINA_TRY(staging->AddPayload(FeatureName(t), "features", *bytes));
  }
  NetworkWeights network;
  network.inputs = kNetworkInputs;
  network.hidden = kNetworkHidden;
  network.outputs = model.outputs;
  network.w1 = model.w1;
  network.b1 = model.b1;
  network.w2 = model.w2;
  network.b2 = model.b2;
  auto buffer = PackNetwork(network);
  if (!buffer) return AsInternal(Fail(buffer.error(), kWeightsName));
  auto bytes = EncodeWeights(*buffer);
  if (!bytes) return AsInternal(Fail(bytes.error(), kWeightsName));
  return staging->AddPayload(kWeightsName, "weights", *bytes);
}

Manifest BeginManifest(const Job& job, JobKind kind, int recipe_version,
                       const std::string& fingerprint) {
  Manifest manifest;
  manifest.kind = JobKindName(kind);
  manifest.asset = job.asset;
  manifest.tool.version = PATINA_VERSION;
  manifest.tool.recipe = RecipeName(job.recipe);
  manifest.tool.recipe_version = recipe_version;
  manifest.fingerprint = fingerprint;
  manifest.seed = job.seed;
  manifest.quality_setting = QualityName(job.quality);
  return manifest;
}

Manifest DescribeContainer(const Job& job, const JobSource& source, const TrainedMaterial* model) {
  Manifest manifest = BeginManifest(job, JobKind::kMaterial, kRecipeVersion, source.fingerprint);
  manifest.profile = ProfileName(job.profile);
  manifest.source = DescribeSource(source);
  manifest.training.stopped_by = "none";
  if (model != nullptr) DescribeModel(*model, source.reference.material, &manifest);
  for (const TargetChannel& channel : source.reference.material.channels) {
    ManifestChannel entry;
    entry.map = channel.map;
    entry.component = channel.component;
    entry.encoding = EncodingName(channel.encoding);
    entry.scale = channel.scale;
    entry.range_min = channel.min_value;
    entry.range_max = channel.max_value;
    entry.output = channel.constant ? -1 : channel.learned_index;
    entry.constant = channel.constant ? channel.constant_value : 0;
    manifest.channels.push_back(std::move(entry));
  }
  for (const ReferenceMap& map : source.reference.maps) {
    ManifestMap entry;
    entry.role = map.role;
    entry.file = map.file;
    entry.file_channels = map.file_channels;
    entry.type = SampleTypeName(map.type);
    entry.inverted = map.inverted;
    entry.transfer = map.srgb ? "srgb" : "linear";
    entry.color_space = map.color_space;
    entry.color_rule = map.color_rule;
    manifest.maps.push_back(std::move(entry));
  }
  manifest.working_space = WorkingSpaceName(job.working_space);
  const ColorConfig& config = source.color_config;
  manifest.color_config = ManifestColorConfig{
      ConfigSourceName(config.source()),
      config.file().empty() ? "" : ManifestPath(std::filesystem::path(config.file()).filename()),
      config.sha256()};
  manifest.scene = source.scene;
  manifest.lod_range = source.reference.lod_range;
  manifest.effects = DescribeEffects(job, source.reference, model);
  manifest.warnings = source.reference.warnings;
  return manifest;
}

void DescribeQuality(const Job& job, const Measurement& measurement, Manifest* manifest) {
  const metrics::QualityResult& measured = measurement.quality;
  const PsnrSummary psnr = SummarizePsnr(measured);
  ManifestQuality quality;
  quality.psnr_overall_db = psnr.overall_db;
  quality.psnr_mip0_db = psnr.mip0_db;
  quality.psnr_mean_mips_db = psnr.mean_mips_db;
  quality.ssim = measured.ssim;
  quality.flip = measured.flip;
  for (const metrics::MapQuality& map : measured.maps) {
    ManifestMapQuality entry;
    entry.map = map.name;
    entry.overall.psnr_db = CapPsnr(map.psnr.overall_db);
    for (const double db : map.psnr.psnr_db) {
      ManifestMeasures mip;
      mip.psnr_db = CapPsnr(db);
      entry.mips.push_back(mip);
    }
    if (!entry.mips.empty()) {
      entry.mips[0].ssim = map.ssim;
      entry.mips[0].flip = map.flip;
      entry.mips[0].normal_deg = map.normal_angle_deg;
    }
    quality.maps.push_back(std::move(entry));
  }
  if (job.min_psnr_db > 0) {
    quality.gate_min_psnr_db = job.min_psnr_db;
    quality.gate_met = psnr.overall_db >= job.min_psnr_db;
  }
  manifest->quality = std::move(quality);
}

std::map<std::string, double> MapsOfPoint(const MaterialReference& reference,
                                          const CurvePoint& point) {
  std::map<std::string, std::pair<double, int>> errors;  // sum of squares, channels
  for (const TargetChannel& channel : reference.channels) {
    const auto output = static_cast<size_t>(channel.learned_index);
    if (channel.learned_index < 0 || output >= point.psnr_channels_db.size()) continue;
    auto& [sum, channels] = errors[channel.map];
    sum += std::pow(10, -0.1 * point.psnr_channels_db[output]);
    ++channels;
  }
  std::map<std::string, double> maps;
  for (const auto& [map, error] : errors) maps[map] = PsnrOfMse(error.first / error.second);
  return maps;
}

}  // namespace patina
