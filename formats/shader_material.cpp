#include <algorithm>

#include "formats/container_match.h"
#include "formats/dds.h"
#include "formats/shader_build.h"
#include "formats/shader_text.h"

namespace patina {
namespace {

// The word of patina_material.core for an encoding; manifests with others are not read.
std::string EncodingWord(const ManifestChannel& channel) {
  if (channel.encoding == "srgb") return "PATINA_SRGB";
  if (channel.encoding == "normal_xy") return "PATINA_NORMAL_XY";
  if (channel.encoding == "signed_log") return "PATINA_SIGNED_LOG";
  return channel.scale == 1 ? "PATINA_LINEAR" : "PATINA_SCALED";
}

Status CheckTexture(const Container& container, const ManifestFeature& feature) {
  const std::string path = container.PathOf(feature.payload);
  PATINA_ASSIGN(const DdsTexture texture, ReadDds(path));
  auto matches = MatchTexture(feature, texture);
  return matches ? Status() : Fail(std::move(matches).error(), path);
}

// Tables have this format, too, and name it as DXGI does.
std::string BindingFormat(const ManifestFeature& feature) {
  return feature.format == TextureFormatName(TextureFormat::kRgba16f) ? "RGBA16_FLOAT"
                                                                      : feature.format;
}

void ListTexture(ShaderDraft* draft, const ManifestFeature& feature, size_t index) {
  draft->textures.push_back({{"name", "patina_feature_" + std::to_string(index)},
                             {"binding", draft->next_binding()},
                             {"container_file", feature.payload},
                             {"format", BindingFormat(feature)},
                             {"width", feature.width},
                             {"height", feature.height},
                             {"levels", feature.levels}});
}

}  // namespace

Result<std::string> AddFeatureTexture(ShaderDraft* draft, size_t index) {
  const ManifestFeature& feature = draft->container.manifest.features[index];
  PATINA_TRY(CheckTexture(draft->container, feature));
  const std::string declaration = " PATINA_TEXTURE(patina_feature_" + std::to_string(index) + ", " +
                                  std::to_string(draft->next_binding()) + ")";
  ListTexture(draft, feature, index);
  return declaration;
}

namespace {

// PATINA_MATERIAL_GROUPS: the samples of four textures at a time.
std::string Groups(size_t textures) {
  std::string text;
  for (size_t first = 0; first < textures; first += 4) {
    text += " PATINA_MATERIAL_GROUP(" + std::to_string(first / 4);
    for (size_t lane = 0; lane < 4; ++lane) {
      const size_t i = first + lane;
      text += i < textures ? ", PATINA_FEATURE(patina_feature_" + std::to_string(i) + ", " +
                                 "xyzw"[lane] + ")"
                           : ", PATINA_NO_FEATURE";
    }
    text += ")";
  }
  return text;
}

Status DraftNetwork(ShaderDraft* draft) {
  const Manifest& manifest = draft->container.manifest;
  const ManifestNetwork& network = *manifest.network;
  const std::string path = draft->container.PathOf(network.payload);
  PATINA_ASSIGN(const WeightBuffer buffer, ReadWeights(path));
  auto layers = MatchNetwork(manifest, buffer);
  if (!layers) return Fail(std::move(layers).error(), path);
  std::string declarations;
  std::vector<float> bias, top;
  for (size_t i = 0; i < manifest.features.size(); ++i) {
    const ManifestFeature& feature = manifest.features[i];
    PATINA_ASSIGN(const std::string declaration, AddFeatureTexture(draft, i));
    declarations += declaration;
    bias.push_back(static_cast<float>(feature.lod_bias));
    top.push_back(static_cast<float>(feature.levels - 1));
  }
  std::vector<int> slots;
  for (int i = 0; i < network.inputs; ++i) slots.push_back(i);
  ShaderConstants constants;
  constants.AddLayers(*layers, slots, (network.inputs + 3) / 4);
  std::vector<float> minimum, maximum, scale;
  for (const ManifestChannel& channel : manifest.channels) {
    minimum.push_back(channel.range_min);
    maximum.push_back(channel.range_max);
    scale.push_back(channel.scale);
  }
  const float source[2] = {static_cast<float>(manifest.source.width),
                           static_cast<float>(manifest.source.height)};
  draft->Define("TEXTURES", declarations);
  draft->Define("GROUPS", Groups(manifest.features.size()));
  // Groups of four textures fill three vectors each.
  const int groups = static_cast<int>(manifest.features.size() + 3) / 4;
  draft->Define("WIDTH4", std::max(constants.width4(), 3 * groups));
  draft->Define("SOURCE", constants.AddVectors(source));
  draft->Define("BIAS", constants.AddVectors(bias));
  draft->Define("TOP", constants.AddVectors(top));
  draft->Define("MINIMUM", constants.AddVectors(minimum));
  draft->Define("MAXIMUM", constants.AddVectors(maximum));
  draft->Define("SCALE", constants.AddVectors(scale));
  return draft->AddConstants(constants);
}

}  // namespace

Status DraftMaterial(ShaderDraft* draft) {
  const Manifest& manifest = draft->container.manifest;
  draft->Define("CHANNELS", static_cast<int>(manifest.channels.size()));
  std::string list;
  nlohmann::ordered_json channels = nlohmann::ordered_json::array();
  for (size_t c = 0; c < manifest.channels.size(); ++c) {
    const ManifestChannel& channel = manifest.channels[c];
    const std::string index = std::to_string(c);
    nlohmann::ordered_json listed = {{"index", c},
                                     {"map", channel.map},
                                     {"component", channel.component},
                                     {"encoding", channel.encoding}};
    if (channel.output < 0) {
      list += " PATINA_CONSTANT(" + index + ", " + ShaderNumber(channel.constant) + ", " +
              ShaderNumber(channel.scale) + ", " + EncodingWord(channel) + ")";
      listed["constant"] = channel.constant;
    } else {
      list += " PATINA_LEARNED(" + index + ", " + std::to_string(channel.output) + ", " +
              EncodingWord(channel) + ")";
    }
    channels.push_back(std::move(listed));
  }
  draft->Define("CHANNEL_LIST", list);
  if (manifest.network) {
    PATINA_TRY(DraftNetwork(draft));
  } else {
    draft->Define("TEXTURES", "");
    draft->Define("MATRICES", 0);
  }
  draft->tail = "\n// Maps by name.\n" + MapAccessors(manifest.channels);
  draft->bindings["address"] = manifest.source.address;
  draft->bindings["channels"] = std::move(channels);
  return {};
}

}  // namespace patina
