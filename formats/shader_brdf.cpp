#include <map>

#include "formats/container_match.h"
#include "formats/dds.h"
#include "formats/half.h"
#include "formats/healpix_corners.h"
#include "formats/index_pack.h"
#include "formats/shader_build.h"

namespace patina {
namespace {

// Each corner's primitive as an entry of a codebook that also holds the means of derived corners.
struct CornerTable {
  std::vector<uint32_t> entry;   // [2][corner]
  std::vector<uint16_t> halves;  // [entry][k], the codebook's own entries first
};

// Derived corners hold means, which are rounded to halves: the primitives of corners that training
// never reached, each off by at most 2^-12 of itself.
CornerTable TableOf(const IndexPack& pack, const Codebook& codebook,
                    const std::vector<float>& features) {
  const auto k = static_cast<size_t>(pack.primitive_size);
  CornerTable table;
  table.halves = codebook.halves;
  std::map<std::vector<uint16_t>, uint32_t> derived;
  size_t next_stored = 0;
  const size_t corners = pack.stored[0].size();
  for (size_t place = 0; place < 2 * corners; ++place) {
    if (pack.stored[place / corners][place % corners] != 0) {
      table.entry.push_back(pack.indices[next_stored++]);
      continue;
    }
    std::vector<uint16_t> mean(k);
    for (size_t i = 0; i < k; ++i) mean[i] = FloatToHalf(features[place * k + i]);
    const auto next = static_cast<uint32_t>(table.halves.size() / k);
    const auto [found, is_new] = derived.emplace(mean, next);
    if (is_new) table.halves.insert(table.halves.end(), mean.begin(), mean.end());
    table.entry.push_back(found->second);
  }
  return table;
}

// Primitives in texels of four halves, filled with zeros.
std::vector<uint8_t> CodebookTexels(const CornerTable& table, size_t k) {
  const size_t padded = (k + 3) / 4 * 4;
  const size_t entries = table.halves.size() / k;
  std::vector<uint8_t> bytes(entries * padded * 2, 0);
  for (size_t e = 0; e < entries; ++e) {
    for (size_t i = 0; i < k; ++i) {
      const uint16_t half = table.halves[e * k + i];
      bytes[2 * (e * padded + i)] = static_cast<uint8_t>(half);
      bytes[2 * (e * padded + i) + 1] = static_cast<uint8_t>(half >> 8);
    }
  }
  return bytes;
}

std::vector<uint8_t> IndexTexels(const CornerTable& table, size_t bytes_each) {
  std::vector<uint8_t> bytes;
  for (const uint32_t entry : table.entry) {
    for (size_t b = 0; b < bytes_each; ++b) bytes.push_back(static_cast<uint8_t>(entry >> (8 * b)));
  }
  return bytes;
}

// What a spatially varying BRDF has besides: textures of one size, sampled at one level.
Status DraftNeuralTexture(ShaderDraft* draft, int first_feature, ShaderConstants* constants) {
  const Manifest& manifest = draft->container.manifest;
  std::string declarations, samples;
  for (size_t t = 0; t < manifest.features.size(); ++t) {
    PATINA_ASSIGN(const std::string declaration, AddFeatureTexture(draft, t));
    declarations += declaration;
    const std::string index = std::to_string(t);
    samples += " PATINA_BRDF_FEATURE(" + index + ", patina_feature_" + index + ")";
  }
  const float top[] = {static_cast<float>(manifest.features[0].levels - 1)};
  draft->Define("TEXTURES", declarations);
  draft->Define("SAMPLES", samples);
  draft->Define("FIRST_FEATURE", first_feature);
  draft->Define("TOP", constants->AddVectors(top));
  draft->bindings["address"] = manifest.brdf->images->address;
  return {};
}

}  // namespace

Status DraftBrdf(ShaderDraft* draft) {
  const Container& container = draft->container;
  const ManifestBrdf& brdf = *container.manifest.brdf;
  const std::string grid_path = container.PathOf(brdf.grid);
  PATINA_ASSIGN(const IndexPack pack, ReadIndexPack(grid_path));
  auto matches = MatchIndexPack(brdf, pack);
  if (!matches) return Fail(std::move(matches).error(), grid_path);
  PATINA_ASSIGN(const Codebook codebook, CodebookOf(pack, container.directory));
  auto features = ExpandCorners(pack, codebook);
  if (!features) return Fail(std::move(features).error(), grid_path);
  const CornerTable table = TableOf(pack, codebook, *features);
  const int k = pack.primitive_size;
  const int k4 = (k + 3) / 4;

  draft->Define("NSIDE", pack.nside);
  draft->Define("CORNERS", healpix::CornerCount(pack.nside));
  draft->Define("PRIMITIVE4", k4);
  draft->Define("INTERPOLATION", static_cast<int>(pack.interpolation));
  draft->Define("ISOTROPIC", pack.isotropic ? 1 : 0);
  draft->Define("CANONICAL_ORDER", pack.canonical_order ? 1 : 0);
  draft->Define("ANGLE_INPUTS", pack.angle_inputs ? 1 : 0);
  draft->Define("HALF_VECTOR_INPUTS", pack.half_vector_inputs ? 1 : 0);
  const bool wide = table.halves.size() / static_cast<size_t>(k) > 65536;
  PATINA_TRY(draft->AddTable("index", wide ? DataFormat::kR32Uint : DataFormat::kR16Uint,
                             IndexTexels(table, wide ? 4 : 2)));
  PATINA_TRY(draft->AddTable("codebook", DataFormat::kRgba16Float,
                             CodebookTexels(table, static_cast<size_t>(k))));

  // The two features start at a vector of their own; so do the scalar inputs.
  const int scalars = (pack.angle_inputs ? 3 : 0) + (pack.half_vector_inputs ? 2 : 0);
  std::vector<int> slots;
  for (int i = 0; i < k; ++i) slots.push_back(i);
  for (int i = 0; i < k; ++i) slots.push_back(4 * k4 + i);
  for (int i = 0; i < scalars; ++i) slots.push_back(8 * k4 + i);
  const std::string path = container.PathOf(brdf.network);
  PATINA_ASSIGN(const WeightBuffer buffer, ReadWeights(path));
  auto layers = MatchNetwork(container.manifest, buffer);
  if (!layers) return Fail(std::move(layers).error(), path);
  // Each texture of a neural texture has a vector.
  const size_t textures = container.manifest.features.size();
  const int first_feature = 2 * k4 + (scalars + 3) / 4;
  for (size_t t = 0; t < textures; ++t) {
    for (int c = 0; c < 3; ++c) slots.push_back(4 * (first_feature + static_cast<int>(t)) + c);
  }
  ShaderConstants constants;
  constants.AddLayers(*layers, slots, first_feature + static_cast<int>(textures));
  if (textures > 0) PATINA_TRY(DraftNeuralTexture(draft, first_feature, &constants));
  draft->Define("WIDTH4", constants.width4());
  return draft->AddConstants(constants);
}

}  // namespace patina
