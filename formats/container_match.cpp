#include "formats/container_match.h"

#include <string>

#include "formats/base/names.h"

namespace patina {
namespace {

std::string WidthsText(const std::vector<int>& widths) {
  std::string text;
  for (const int width : widths) text += (text.empty() ? "" : ", ") + std::to_string(width);
  return text;
}

const char* InterpolationWord(Interpolation interpolation) {
  switch (interpolation) {
    case Interpolation::kBilinear:
      return "bilinear";
    case Interpolation::kInverseDistance:
      return "inverse_distance";
    case Interpolation::kUniform:
      break;
  }
  return "uniform";
}

Status Same(const char* pointer, const std::string& described, const std::string& found) {
  if (described == found) return {};
  return Fail(ErrorCode::kCorruptData, std::string(pointer) + ": " + QuoteForMessage(described) +
                                           " in the manifest, " + QuoteForMessage(found) +
                                           " in the index pack");
}

std::string Word(bool value) { return value ? "true" : "false"; }

}  // namespace

Status MatchTexture(const ManifestFeature& feature, const DdsTexture& texture) {
  const std::string format = TextureFormatName(texture.format);
  if (texture.width != feature.width || texture.height != feature.height ||
      texture.level_count() != feature.levels || format != feature.format) {
    return Fail(ErrorCode::kCorruptData,
                std::to_string(texture.width) + "x" + std::to_string(texture.height) +
                    " texels in " + std::to_string(texture.level_count()) + " levels, " + format +
                    ", but the manifest says " + std::to_string(feature.width) + "x" +
                    std::to_string(feature.height) + ", " + std::to_string(feature.levels) +
                    " levels, " + feature.format);
  }
  return {};
}

Result<std::vector<DenseLayer>> MatchNetwork(const Manifest& manifest, const WeightBuffer& buffer) {
  const std::vector<int> widths =
      manifest.brdf ? manifest.brdf->layers
                    : std::vector<int>{manifest.network->inputs, manifest.network->hidden,
                                       manifest.network->outputs};
  PATINA_ASSIGN(std::vector<DenseLayer> layers,
                DenseLayersOf(buffer, widths.front(), widths.back()));
  std::vector<int> found = {widths.front()};
  for (const DenseLayer& layer : layers) found.push_back(layer.outputs);
  if (found != widths || buffer.tensors.size() != 2 * layers.size()) {
    return Fail(ErrorCode::kCorruptData, "a network of the widths " + WidthsText(found) +
                                             ", but the manifest describes one of " +
                                             WidthsText(widths));
  }
  return layers;
}

Status MatchIndexPack(const ManifestBrdf& brdf, const IndexPack& pack) {
  const auto number = [](int value) { return std::to_string(value); };
  PATINA_TRY(Same("/brdf/nside", number(brdf.nside), number(pack.nside)));
  PATINA_TRY(
      Same("/brdf/primitive_size", number(brdf.primitive_size), number(pack.primitive_size)));
  PATINA_TRY(Same("/brdf/index_bits", number(brdf.index_bits), number(pack.index_bits)));
  PATINA_TRY(
      Same("/brdf/interpolation", brdf.interpolation, InterpolationWord(pack.interpolation)));
  PATINA_TRY(Same("/brdf/isotropic", Word(brdf.isotropic), Word(pack.isotropic)));
  PATINA_TRY(Same("/brdf/canonical_order", Word(brdf.canonical_order), Word(pack.canonical_order)));
  PATINA_TRY(Same("/brdf/angle_inputs", Word(brdf.angle_inputs), Word(pack.angle_inputs)));
  PATINA_TRY(Same("/brdf/half_vector_inputs", Word(brdf.half_vector_inputs),
                  Word(pack.half_vector_inputs)));
  // A codebook that is a payload of the container is named by the pack like one that is shared.
  const std::string& file = brdf.codebook.empty() ? brdf.shared_codebook_file : brdf.codebook;
  PATINA_TRY(Same("/brdf/codebook", file, pack.codebook_file));
  if (brdf.codebook.empty())
    return Same("/brdf/codebook/sha256", brdf.shared_codebook_sha256, pack.codebook_sha256);
  return {};
}

}  // namespace patina
