#include "formats/manifest_check.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "formats/base/names.h"
#include "formats/base/strict_json.h"
#include "formats/dds.h"
#include "formats/index_pack.h"
#include "formats/manifest_json.h"
#include "formats/scene/scene_json.h"

namespace patina {
namespace {

using Pointer = std::string;

tl::unexpected<Error> Bad(const Pointer& pointer, const std::string& what) {
  return Fail(ErrorCode::kInvalidArgument, pointer + ": " + what);
}

Status OneOf(const Pointer& pointer, const std::string& value,
             std::initializer_list<const char*> legal,
             ErrorCode code = ErrorCode::kInvalidArgument) {
  std::string list;
  for (const char* name : legal) {
    if (value == name) return {};
    list += (list.empty() ? "" : ", ") + std::string(name);
  }
  return Fail(code, pointer + ": " + QuoteForMessage(value) + " is not one of: " + list);
}

Status HexDigest(const Pointer& pointer, const std::string& value) {
  const bool legal =
      value.size() == 64 && value.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (!legal) return Bad(pointer, QuoteForMessage(value) + " is not 64 lower-case hex digits");
  return {};
}

Status NotEmpty(const Pointer& pointer, const std::string& value) {
  if (value.empty()) return Bad(pointer, "empty");
  return {};
}

Status InRange(const Pointer& pointer, double value, double min, double max) {
  if (!(value >= min && value <= max)) {
    return Bad(pointer, std::to_string(value) + " is not within " + std::to_string(min) + " to " +
                            std::to_string(max));
  }
  return {};
}

// Finite, or plus infinity for "no error".
Status Psnr(const Pointer& pointer, double value) {
  if (std::isnan(value) || value == -INFINITY) return Bad(pointer, "not a number");
  return {};
}

Status Sides(const Pointer& pointer, int width, int height) {
  PATINA_TRY(InRange(pointer + "/width", width, 1, kMaxDdsSide));
  return InRange(pointer + "/height", height, 1, kMaxDdsSide);
}

Status FullChain(const Pointer& pointer, int width, int height, int levels) {
  PATINA_TRY(Sides(pointer, width, height));
  const int full = DdsFullChainLevels(width, height);
  if (levels != full) {
    return Bad(
        pointer + "/levels",
        std::to_string(levels) + " levels, but the chain down to 1x1 has " + std::to_string(full));
  }
  return {};
}

Status PartOfChain(const Pointer& pointer, int width, int height, int levels) {
  PATINA_TRY(Sides(pointer, width, height));
  return InRange(pointer + "/levels", levels, 1, DdsFullChainLevels(width, height));
}

Status CheckLodRange(const Manifest& manifest) {
  if (!manifest.lod_range) return {};
  const auto [first, last] = *manifest.lod_range;
  if (first < 0 || first > last || last >= manifest.source.levels) {
    return Bad("/lod_range", "not two mips of the source's " +
                                 std::to_string(manifest.source.levels) + ", the smaller first");
  }
  return {};
}

Status CheckType(const Pointer& pointer, const std::string& type) {
  return OneOf(pointer, type, {"uint8", "uint16", "uint32", "half", "float", "double"});
}

Status CheckSource(const ManifestSource& source) {
  PATINA_TRY(FullChain("/source", source.width, source.height, source.levels));
  PATINA_TRY(OneOf("/source/address", source.address, {"wrap", "clamp"}, ErrorCode::kUnsupported));
  PATINA_TRY(OneOf("/source/normal_convention", source.normal_convention, {"opengl", "directx"}));
  for (size_t i = 0; i < source.files.size(); ++i) {
    const ManifestSourceFile& file = source.files[i];
    const Pointer at = "/source/files/" + std::to_string(i);
    if (auto status = CheckRelativePath(file.path, at + "/path:"); !status) return status;
    PATINA_TRY(HexDigest(at + "/sha256", file.sha256));
    PATINA_TRY(Sides(at, file.width, file.height));
    PATINA_TRY(InRange(at + "/channels", file.channels, 1, 1024));
    PATINA_TRY(CheckType(at + "/type", file.type));
    PATINA_TRY(NotEmpty(at + "/file_format", file.file_format));
    for (size_t r = 0; r < file.roles.size(); ++r)
      PATINA_TRY(NotEmpty(at + "/roles/" + std::to_string(r), file.roles[r]));
  }
  return {};
}

Status CheckPayloads(const Manifest& manifest) {
  std::set<std::string> names;
  for (size_t i = 0; i < manifest.payloads.size(); ++i) {
    const ManifestPayload& payload = manifest.payloads[i];
    const Pointer at = "/payloads/" + std::to_string(i);
    if (auto status = CheckPlainName(payload.name, at + "/name:"); !status) return status;
    if (payload.name == "manifest.json" || !names.insert(payload.name).second) {
      return Bad(at + "/name",
                 QuoteForMessage(payload.name) + " is listed twice or is the manifest itself");
    }
    PATINA_TRY(NotEmpty(at + "/role", payload.role));
    PATINA_TRY(HexDigest(at + "/sha256", payload.sha256));
  }
  return {};
}

Status CheckReference(const Pointer& pointer, const Manifest& manifest, const std::string& name,
                      const char* role) {
  const bool found =
      std::any_of(manifest.payloads.begin(), manifest.payloads.end(),
                  [&](const ManifestPayload& p) { return p.name == name && p.role == role; });
  if (!found)
    return Bad(pointer,
               "no payload " + QuoteForMessage(name) + " of role \"" + role + "\" is listed");
  return {};
}

Status CheckFeatures(const Manifest& manifest) {
  if (manifest.features.size() > static_cast<size_t>(kMaxManifestFeatures)) {
    return Bad("/features", std::to_string(manifest.features.size()) + " textures, more than 16");
  }
  for (size_t i = 0; i < manifest.features.size(); ++i) {
    const ManifestFeature& feature = manifest.features[i];
    const Pointer at = "/features/" + std::to_string(i);
    PATINA_TRY(CheckReference(at + "/payload", manifest, feature.payload, "features"));
    PATINA_TRY(manifest.lod_range ? PartOfChain(at, feature.width, feature.height, feature.levels)
                                  : FullChain(at, feature.width, feature.height, feature.levels));
    PATINA_TRY(InRange(at + "/lod_bias", feature.lod_bias, -31, 0));
    // Blocks are what a material is made of; a neural texture may do without them.
    PATINA_TRY(manifest.kind == "svbrdf"
                   ? OneOf(at + "/format", feature.format, {"BC6H_UF16", "BC6H_SF16", "RGBA16F"},
                           ErrorCode::kUnsupported)
                   : OneOf(at + "/format", feature.format, {"BC6H_UF16", "BC6H_SF16"},
                           ErrorCode::kUnsupported));
  }
  return {};
}

Status CheckModel(const Manifest& manifest) {
  PATINA_TRY(CheckFeatures(manifest));
  if (!manifest.network) {
    if (!manifest.features.empty()) return Bad("/features", "feature textures without a network");
    return {};
  }
  const ManifestNetwork& network = *manifest.network;
  PATINA_TRY(CheckReference("/network/payload", manifest, network.payload, "weights"));
  if (manifest.features.empty() ||
      network.inputs != 3 * static_cast<int>(manifest.features.size())) {
    return Bad("/network/inputs", std::to_string(network.inputs) + " inputs for " +
                                      std::to_string(manifest.features.size()) +
                                      " textures of three channels");
  }
  PATINA_TRY(InRange("/network/hidden", network.hidden, 1, kMaxManifestHidden));
  PATINA_TRY(InRange("/network/outputs", network.outputs, 1, kMaxManifestOutputs));
  return OneOf("/network/activation", network.activation, {"relu"}, ErrorCode::kUnsupported);
}

Status CheckChannels(const Manifest& manifest) {
  const int outputs = manifest.network ? manifest.network->outputs : 0;
  std::vector<const ManifestChannel*> users(static_cast<size_t>(outputs), nullptr);
  std::set<std::pair<std::string, std::string>> seen;
  std::set<std::string> finished_maps;
  if (manifest.channels.empty()) return Bad("/channels", "no channel");
  for (size_t i = 0; i < manifest.channels.size(); ++i) {
    const ManifestChannel& channel = manifest.channels[i];
    const Pointer at = "/channels/" + std::to_string(i);
    PATINA_TRY(NotEmpty(at + "/map", channel.map));
    PATINA_TRY(OneOf(at + "/encoding", channel.encoding,
                     {"linear", "srgb", "normal_xy", "signed_log"}, ErrorCode::kUnsupported));
    if (!seen.insert({channel.map, channel.component}).second) {
      return Bad(at, "the channel " + QuoteForMessage(channel.map + "." + channel.component) +
                         " is listed twice");
    }
    if (i > 0 && manifest.channels[i - 1].map != channel.map)
      finished_maps.insert(manifest.channels[i - 1].map);
    if (finished_maps.count(channel.map) != 0) {
      return Bad(at + "/map",
                 "the channels of " + QuoteForMessage(channel.map) + " are not together");
    }
    if (channel.encoding == "normal_xy" && channel.component != "x" && channel.component != "y") {
      return Bad(at + "/component", "a normal_xy channel is \"x\" or \"y\", not " +
                                        QuoteForMessage(channel.component));
    }
    if (!std::isfinite(channel.scale) || !(channel.scale > 0) ||
        (channel.scale != 1.0f && channel.encoding != "linear" &&
         channel.encoding != "signed_log")) {
      return Bad(at + "/scale",
                 "not a finite number above 0 of a \"linear\" or \"signed_log\" channel");
    }
    if (!std::isfinite(channel.range_min) || !std::isfinite(channel.range_max) ||
        channel.range_min > channel.range_max) {
      return Bad(at + "/range", "not two finite numbers in rising order");
    }
    if (channel.encoding == "signed_log") {
      // Powers of two beyond this are no floats.
      constexpr double kMostLog = 256;
      PATINA_TRY(InRange(at + "/range/0", channel.range_min, -kMostLog, kMostLog));
      PATINA_TRY(InRange(at + "/range/1", channel.range_max, -kMostLog, kMostLog));
    }
    if (channel.output < 0) {
      if (!std::isfinite(channel.constant)) return Bad(at + "/constant", "not a finite number");
    } else if (channel.output >= outputs) {
      return Bad(at + "/output", std::to_string(channel.output) + " is not one of the network's " +
                                     std::to_string(outputs) + " outputs");
    } else {
      const ManifestChannel*& user = users[static_cast<size_t>(channel.output)];
      // Decoders clamp an output once.
      if (user != nullptr &&
          (user->range_min != channel.range_min || user->range_max != channel.range_max)) {
        return Bad(at + "/range", "not that of the channel before it that has the same output");
      }
      user = &channel;
    }
  }
  const auto unused = std::find(users.begin(), users.end(), nullptr);
  if (unused != users.end()) {
    return Bad("/network/outputs",
               "output " + std::to_string(unused - users.begin()) + " belongs to no channel");
  }
  return {};
}

Status CheckMaps(const Manifest& manifest) {
  std::set<std::string> roles;
  for (size_t i = 0; i < manifest.maps.size(); ++i) {
    const ManifestMap& map = manifest.maps[i];
    const Pointer at = "/maps/" + std::to_string(i);
    PATINA_TRY(NotEmpty(at + "/role", map.role));
    if (!roles.insert(map.role).second)
      return Bad(at + "/role", QuoteForMessage(map.role) + " is listed twice");
    PATINA_TRY(CheckType(at + "/type", map.type));
    PATINA_TRY(OneOf(at + "/transfer", map.transfer, {"linear", "srgb"}));
    if (!map.color_rule.empty()) {
      PATINA_TRY(OneOf(at + "/color_rule", map.color_rule,
                       {"list", "option", "name", "tag", "file_rule", "default"}));
    }
    if (map.color_space.empty() != map.color_rule.empty())
      return Bad(at, "color_space and color_rule come together");
    if (map.file < -1 || map.file >= static_cast<int>(manifest.source.files.size())) {
      return Bad(at + "/file", std::to_string(map.file) + " is not an index into /source/files");
    }
    const int channels =
        map.file < 0 ? 0 : manifest.source.files[static_cast<size_t>(map.file)].channels;
    for (size_t c = 0; c < map.file_channels.size(); ++c) {
      if (map.file_channels[c] < 0 || map.file_channels[c] >= channels) {
        return Bad(at + "/file_channels/" + std::to_string(c),
                   std::to_string(map.file_channels[c]) + " is not a channel of the file");
      }
    }
  }
  return {};
}

Status CheckMeasures(const Pointer& at, const ManifestMeasures& measures) {
  if (measures.psnr_db) PATINA_TRY(Psnr(at + "/psnr_db", *measures.psnr_db));
  if (measures.ssim) PATINA_TRY(InRange(at + "/ssim", *measures.ssim, -1, 1));
  if (measures.flip) PATINA_TRY(InRange(at + "/flip", *measures.flip, 0, 1));
  if (measures.normal_deg) PATINA_TRY(InRange(at + "/normal_deg", *measures.normal_deg, 0, 180));
  return {};
}

Status CheckQuality(const Manifest& manifest) {
  const ManifestQuality& quality = manifest.quality;
  PATINA_TRY(Psnr("/quality/psnr_db/overall", quality.psnr_overall_db));
  PATINA_TRY(Psnr("/quality/psnr_db/mip0", quality.psnr_mip0_db));
  PATINA_TRY(Psnr("/quality/psnr_db/mean_mips", quality.psnr_mean_mips_db));
  PATINA_TRY(CheckMeasures("/quality", {std::nullopt, quality.ssim, quality.flip, std::nullopt}));
  for (size_t i = 0; i < quality.maps.size(); ++i) {
    const ManifestMapQuality& map = quality.maps[i];
    const Pointer at = "/quality/maps/" + std::to_string(i);
    PATINA_TRY(NotEmpty(at + "/map", map.map));
    PATINA_TRY(CheckMeasures(at + "/overall", map.overall));
    if (map.mips.size() > static_cast<size_t>(manifest.source.levels)) {
      return Bad(at + "/mips",
                 std::to_string(map.mips.size()) + " mips, more than the source's levels");
    }
    for (size_t mip = 0; mip < map.mips.size(); ++mip) {
      PATINA_TRY(CheckMeasures(at + "/mips/" + std::to_string(mip), map.mips[mip]));
    }
  }
  if (quality.gate_min_psnr_db && !std::isfinite(*quality.gate_min_psnr_db)) {
    return Bad("/quality/gate/min_psnr_db", "not a finite number");
  }
  return {};
}

Status CheckChoice(const ManifestChoice& choice) {
  const Pointer at = "/training/choice";
  PATINA_TRY(NotEmpty(at + "/chosen", choice.chosen));
  PATINA_TRY(NotEmpty(at + "/reason", choice.reason));
  if (!(choice.target_psnr_db >= 0 && std::isfinite(choice.target_psnr_db)))
    return Bad(at + "/target_psnr_db", "not a number of at least 0");
  bool listed = false;
  for (size_t i = 0; i < choice.candidates.size(); ++i) {
    const ManifestCandidate& candidate = choice.candidates[i];
    const Pointer here = at + "/candidates/" + std::to_string(i);
    PATINA_TRY(NotEmpty(here + "/profile", candidate.profile));
    if (candidate.reached_db && !std::isfinite(*candidate.reached_db))
      return Bad(here + "/reached_psnr_db", "not a finite number");
    listed |= candidate.profile == choice.chosen;
  }
  if (!listed) return Bad(at + "/chosen", "none of the candidates");
  return {};
}

Status CheckTraining(const ManifestTraining& training) {
  PATINA_TRY(NotEmpty("/training/stopped_by", training.stopped_by));
  PATINA_TRY(Psnr("/training/float_psnr_db/mip0", training.float_psnr_mip0_db));
  PATINA_TRY(Psnr("/training/float_psnr_db/mean_mips", training.float_psnr_mean_mips_db));
  if (training.rollbacks < 0) return Bad("/training/rollbacks", "negative");
  for (size_t i = 0; i < training.curve.size(); ++i) {
    const Pointer at = "/training/curve/" + std::to_string(i);
    PATINA_TRY(Psnr(at + "/psnr_mip0_db", training.curve[i].psnr_mip0_db));
    PATINA_TRY(Psnr(at + "/psnr_mean_mips_db", training.curve[i].psnr_mean_mips_db));
    for (const auto& [map, db] : training.curve[i].maps_db)
      PATINA_TRY(Psnr(at + "/psnr_maps_db/" + EscapePointer(map), db));
  }
  if (training.choice) PATINA_TRY(CheckChoice(*training.choice));
  return {};
}

Status NotNegative(const Pointer& pointer, const std::optional<double>& value) {
  if (value && !(std::isfinite(*value) && *value >= 0))
    return Bad(pointer, "not a finite number of at least 0");
  return {};
}

Status CheckBrdfQuality(const ManifestBrdfQuality& quality) {
  PATINA_TRY(NotNegative("/quality/image_mae", quality.image_mae));
  PATINA_TRY(NotNegative("/quality/image_rmse", quality.image_rmse));
  if (quality.image_ssim) PATINA_TRY(InRange("/quality/image_ssim", *quality.image_ssim, -1, 1));
  PATINA_TRY(NotNegative("/quality/log1p_mse", quality.log1p_mse));
  PATINA_TRY(NotNegative("/quality/reciprocity_error", quality.reciprocity_error));
  for (size_t i = 0; i < quality.albedo.size(); ++i) {
    const Pointer at = "/quality/albedo/" + std::to_string(i);
    PATINA_TRY(InRange(at + "/theta_deg", quality.albedo[i].theta_deg, 0, 90));
    for (size_t c = 0; c < 3; ++c)
      PATINA_TRY(NotNegative(at + "/rgb/" + std::to_string(c), quality.albedo[i].rgb[c]));
  }
  return {};
}

Status CheckBrdfCodebook(const Manifest& manifest, const ManifestBrdf& brdf) {
  const bool shared = !brdf.shared_codebook_file.empty() || !brdf.shared_codebook_sha256.empty();
  if (!brdf.codebook.empty()) {
    if (shared) return Bad("/brdf/codebook", "both a payload and a shared file");
    return CheckReference("/brdf/codebook/payload", manifest, brdf.codebook, "codebook");
  }
  if (!shared) return {};
  if (auto status = CheckPlainName(brdf.shared_codebook_file, "/brdf/codebook/file:"); !status)
    return status;
  return HexDigest("/brdf/codebook/sha256", brdf.shared_codebook_sha256);
}

// What a spatially varying BRDF has more than another one.
Status CheckNeuralTexture(const Manifest& manifest) {
  const ManifestBrdf& brdf = *manifest.brdf;
  if (manifest.kind != "svbrdf") {
    if (brdf.images) return Bad("/source/images", "in a manifest of kind \"brdf\"");
    if (!manifest.features.empty())
      return Bad("/kind", "\"brdf\" with feature textures, which \"svbrdf\" has");
    return {};
  }
  if (!brdf.images) return Bad("/source/images", "missing in a manifest of kind \"svbrdf\"");
  const ManifestImageSet& images = *brdf.images;
  if (images.images == 0 && brdf.source_format == "image_set")
    return Bad("/source/images/count", "no image");
  PATINA_TRY(InRange("/source/images/width", images.width, 1, kMaxDdsSide));
  PATINA_TRY(InRange("/source/images/height", images.height, 1, kMaxDdsSide));
  PATINA_TRY(
      OneOf("/source/images/address", images.address, {"wrap", "clamp"}, ErrorCode::kUnsupported));
  PATINA_TRY(HexDigest("/source/images/sha256", images.sha256));
  if (manifest.features.empty()) return Bad("/features", "no texture in a spatially varying BRDF");
  for (size_t i = 0; i < manifest.features.size(); ++i) {
    const ManifestFeature& feature = manifest.features[i];
    const Pointer at = "/features/" + std::to_string(i);
    if (feature.width != images.width) return Bad(at + "/width", "not that of /source/images");
    if (feature.height != images.height) return Bad(at + "/height", "not that of /source/images");
    if (feature.lod_bias != 0) return Bad(at + "/lod_bias", "not 0 in a spatially varying BRDF");
  }
  return CheckFeatures(manifest);
}

Status CheckBrdf(const Manifest& manifest) {
  if (!manifest.brdf)
    return Bad("/brdf", "missing in a manifest of kind \"" + manifest.kind + "\"");
  if (manifest.network || !manifest.channels.empty() || !manifest.maps.empty() ||
      manifest.lod_range) {
    return Bad("/kind", "\"" + manifest.kind + "\" with a network, channels, maps or a lod_range");
  }
  PATINA_TRY(CheckNeuralTexture(manifest));
  const ManifestBrdf& brdf = *manifest.brdf;
  PATINA_TRY(NotEmpty("/source/format", brdf.source_format));
  if (brdf.invalid_cells > brdf.cells)
    return Bad("/source/invalid_cells",
               std::to_string(brdf.invalid_cells) + " of " + std::to_string(brdf.cells) + " cells");
  if (brdf.simulation &&
      !(std::isfinite(brdf.simulation->standard_error) && brdf.simulation->standard_error >= 0)) {
    return Bad("/source/simulation/standard_error", "not a finite number of 0 or more");
  }
  for (size_t i = 0; i < brdf.files.size(); ++i) {
    const Pointer at = "/source/files/" + std::to_string(i);
    if (auto status = CheckRelativePath(brdf.files[i].path, at + "/path:"); !status) return status;
    PATINA_TRY(HexDigest(at + "/sha256", brdf.files[i].sha256));
  }
  PATINA_TRY(CheckReference("/brdf/grid", manifest, brdf.grid, "grid"));
  PATINA_TRY(CheckBrdfCodebook(manifest, brdf));
  PATINA_TRY(InRange("/brdf/nside", brdf.nside, 1, healpix::kMaxNside));
  PATINA_TRY(InRange("/brdf/primitive_size", brdf.primitive_size, 1, kMaxPrimitiveSize));
  PATINA_TRY(InRange("/brdf/index_bits", brdf.index_bits, 1, kMaxIndexBits));
  PATINA_TRY(OneOf("/brdf/interpolation", brdf.interpolation,
                   {"bilinear", "inverse_distance", "uniform"}, ErrorCode::kUnsupported));
  PATINA_TRY(CheckReference("/brdf/network/payload", manifest, brdf.network, "weights"));
  const size_t count = brdf.layers.size();
  if (count < 2 || count > static_cast<size_t>(kMaxManifestLayers) + 1)
    return Bad("/brdf/network/layers", std::to_string(count) + " widths, not 2 to 17");
  for (size_t i = 0; i < count; ++i) {
    PATINA_TRY(InRange("/brdf/network/layers/" + std::to_string(i), brdf.layers[i], 1,
                       kMaxManifestLayerWidth));
  }
  if (brdf.rollbacks < 0) return Bad("/brdf/rollbacks", "negative");
  if (brdf.half_vector_inputs && !brdf.angle_inputs)
    return Bad("/brdf/half_vector_inputs", "true without angle_inputs");
  const int inputs = 2 * brdf.primitive_size + (brdf.angle_inputs ? 3 : 0) +
                     (brdf.half_vector_inputs ? 2 : 0) +
                     3 * static_cast<int>(manifest.features.size());
  if (brdf.layers.front() != inputs || brdf.layers.back() != 3) {
    return Bad("/brdf/network/layers", std::to_string(brdf.layers.front()) + " inputs and " +
                                           std::to_string(brdf.layers.back()) + " outputs, not " +
                                           std::to_string(inputs) + " and 3");
  }
  PATINA_TRY(OneOf("/brdf/network/activation", brdf.activation, {"relu"}, ErrorCode::kUnsupported));
  PATINA_TRY(
      OneOf("/brdf/output_transform", brdf.output_transform, {"expm1"}, ErrorCode::kUnsupported));
  if (!brdf.sampler.empty())
    PATINA_TRY(CheckReference("/brdf/sampler", manifest, brdf.sampler, "sampler"));
  return CheckBrdfQuality(brdf.quality);
}

Status CheckMaterial(const Manifest& manifest) {
  if (manifest.brdf) return Bad("/brdf", "in a manifest of kind \"material\"");
  PATINA_TRY(NotEmpty("/profile", manifest.profile));
  PATINA_TRY(CheckSource(manifest.source));
  PATINA_TRY(CheckLodRange(manifest));
  PATINA_TRY(CheckModel(manifest));
  PATINA_TRY(CheckChannels(manifest));
  PATINA_TRY(CheckMaps(manifest));
  PATINA_TRY(CheckQuality(manifest));
  return CheckTraining(manifest.training);
}

}  // namespace

Status CheckManifest(const Manifest& manifest) {
  PATINA_TRY(
      OneOf("/kind", manifest.kind, {"material", "brdf", "svbrdf"}, ErrorCode::kUnsupported));
  if (auto status = CheckPlainName(manifest.asset, "/asset: asset name"); !status) return status;
  PATINA_TRY(NotEmpty("/tool/name", manifest.tool.name));
  PATINA_TRY(NotEmpty("/tool/version", manifest.tool.version));
  PATINA_TRY(NotEmpty("/tool/recipe", manifest.tool.recipe));
  PATINA_TRY(InRange("/tool/recipe_version", manifest.tool.recipe_version, 1, 1000000));
  PATINA_TRY(HexDigest("/fingerprint", manifest.fingerprint));
  if (manifest.seed > static_cast<uint64_t>(INT64_MAX))
    return Bad("/seed", std::to_string(manifest.seed) + " is 2^63 or more");
  PATINA_TRY(NotEmpty("/quality_setting", manifest.quality_setting));
  PATINA_TRY(CheckPayloads(manifest));
  PATINA_TRY(CheckEffects(manifest.effects));
  PATINA_TRY(OneOf("/color/working_space", manifest.working_space, {"lin_rec709", "acescg"},
                   ErrorCode::kUnsupported));
  if (manifest.color_config) {
    const ManifestColorConfig& config = *manifest.color_config;
    PATINA_TRY(OneOf("/color/config/source", config.source, {"builtin", "environment", "file"}));
    PATINA_TRY(HexDigest("/color/config/sha256", config.sha256));
    if (auto status = CheckPlainName(config.file, "/color/config/file:");
        !status && config.source != "builtin")
      return status;
  }
  if (manifest.scene) PATINA_TRY(CheckSceneLook(*manifest.scene));
  return manifest.kind == "material" ? CheckMaterial(manifest) : CheckBrdf(manifest);
}

}  // namespace patina
