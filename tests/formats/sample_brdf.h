// Index packs, manifests and containers of kind "brdf" with random content for the tests of
// formats/.
#pragma once

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "formats/base/sha256.h"
#include "formats/brdf_sampler.h"
#include "formats/container.h"
#include "formats/half.h"
#include "formats/index_pack.h"
#include "formats/manifest.h"
#include "formats/weights.h"
#include "tests/formats/sample_container.h"
#include "tests/formats/test_support.h"

namespace patina::test {

inline uint16_t RandomHalf(Random& random, double size) {
  return FloatToHalf(static_cast<float>((random.Unit() * 2 - 1) * size));
}

struct PackOptions {
  int nside = 4;
  int primitive_size = 5;
  int index_bits = 6;
  int entries = 50;
  Interpolation interpolation = Interpolation::kBilinear;
  bool isotropic = false;
  bool canonical_order = false;
  bool angle_inputs = true;
  bool half_vector_inputs = false;
  double stored = 0.6;  // share of stored corners
};

inline IndexPack RandomPack(Random& random, const PackOptions& options = {}) {
  IndexPack pack;
  pack.nside = options.nside;
  pack.primitive_size = options.primitive_size;
  pack.index_bits = options.index_bits;
  pack.interpolation = options.interpolation;
  pack.isotropic = options.isotropic;
  pack.canonical_order = options.canonical_order;
  pack.angle_inputs = options.angle_inputs;
  pack.half_vector_inputs = options.half_vector_inputs;
  for (auto& stored : pack.stored) {
    stored.resize(static_cast<size_t>(healpix::CornerCount(pack.nside)));
    for (uint8_t& value : stored) {
      value = random.Unit() < options.stored ? 1 : 0;
      if (value != 0) pack.indices.push_back(static_cast<uint16_t>(random.Below(options.entries)));
    }
  }
  for (int i = 0; i < options.entries * options.primitive_size; ++i)
    pack.codebook.push_back(RandomHalf(random, 1));
  return pack;
}

// A network of the given widths with weights of about unit gain.
inline WeightBuffer RandomLayers(Random& random, const std::vector<int>& widths) {
  WeightBuffer buffer;
  for (size_t l = 0; l + 1 < widths.size(); ++l) {
    const auto rows = static_cast<uint32_t>(widths[l + 1]);
    const auto columns = static_cast<uint32_t>(widths[l]);
    const std::string name = "layer" + std::to_string(l);
    WeightTensor weight{name + ".weight", {rows, columns}, {}};
    for (uint32_t i = 0; i < rows * columns; ++i)
      weight.elements.push_back(RandomHalf(random, std::sqrt(6.0 / columns)));
    WeightTensor bias{name + ".bias", {rows}, {}};
    for (uint32_t i = 0; i < rows; ++i) bias.elements.push_back(RandomHalf(random, 0.5));
    buffer.tensors.push_back(std::move(weight));
    buffer.tensors.push_back(std::move(bias));
  }
  return buffer;
}

// A manifest that uses every field of a BRDF.
inline Manifest FullBrdfManifest() {
  Manifest manifest;
  manifest.kind = "brdf";
  manifest.asset = "chrome";
  manifest.tool.version = "0.1.0";
  manifest.fingerprint = std::string(64, 'b');
  manifest.payloads = {{"grid.hpx", "grid", 20000, std::string(64, '1')},
                       {"decoder.weights", "weights", 8000, std::string(64, '2')},
                       {"sampler.bin", "sampler", 1072, std::string(64, '3')},
                       {"preview.png", "preview", 12345, std::string(64, '4')}};
  ManifestBrdf brdf;
  brdf.source_format = "merl";
  brdf.cells = 1458000;
  brdf.invalid_cells = 1234;
  brdf.files = {{"chrome.binary", std::string(64, '5')}};
  brdf.grid = "grid.hpx";
  brdf.shared_codebook_file = "metals.hpc";
  brdf.shared_codebook_sha256 = std::string(64, '6');
  brdf.nside = 32;
  brdf.network = "decoder.weights";
  brdf.layers = {35, 32, 32, 3};
  brdf.sampler = "sampler.bin";
  brdf.quality.image_mae = 0.00125;
  brdf.quality.image_rmse = 0.0025;
  brdf.quality.image_ssim = 0.9990234375;
  brdf.quality.log1p_mse = 0.0001220703125;
  brdf.quality.reciprocity_error = 0;
  for (const double theta : {0.0, 30.0, 60.0, 80.0, 89.0})
    brdf.quality.albedo.push_back({theta, {0.5, 0.625, 0.75 + theta / 256}});
  manifest.brdf = brdf;
  manifest.warnings = {"1234 of 1458000 cells are invalid and were left out"};
  return manifest;
}

inline BrdfSamplerTables RandomTables(Random& random, int bins, int theta_cells, int phi_cells,
                                      bool relative_phi) {
  BrdfSamplerTables tables;
  tables.theta_i_bins = bins;
  tables.theta_h_cells = theta_cells;
  tables.phi_cells = phi_cells;
  tables.relative_phi = relative_phi;
  tables.mixture.resize(static_cast<size_t>(bins));
  for (uint8_t& code : tables.mixture) code = static_cast<uint8_t>(50 + random.Below(150));
  tables.mass.resize(static_cast<size_t>(bins) * tables.CellsInBin());
  for (uint8_t& code : tables.mass) code = static_cast<uint8_t>(200 + random.Below(56));
  return tables;
}

struct BrdfSampleOptions {
  PackOptions pack;
  std::vector<int> hidden = {16, 16};
  bool shared_codebook = false;
  bool with_sampler = true;
  int textures = 0;     // of a spatially varying one
  bool halves = false;  // its textures are uncompressed
  int zstd_level = 0;
};

// A staging area with a random BRDF, ready to be published.
inline Result<StagingArea> StageBrdfSample(const std::string& out, const std::string& asset,
                                           uint64_t seed, const BrdfSampleOptions& options = {}) {
  Random random(seed);
  PATINA_ASSIGN(StagingArea staging, StagingArea::Create(out, asset));
  Manifest manifest = FullBrdfManifest();
  ManifestBrdf& brdf = *manifest.brdf;
  IndexPack pack = RandomPack(random, options.pack);
  brdf.shared_codebook_file.clear();
  brdf.shared_codebook_sha256.clear();
  if (options.shared_codebook) {
    PATINA_ASSIGN(const auto bytes, EncodeCodebook({pack.primitive_size, pack.codebook}));
    PATINA_TRY(WriteCodebook(out + "/shared.hpc", {pack.primitive_size, pack.codebook}));
    pack.codebook.clear();
    pack.codebook_file = brdf.shared_codebook_file = "shared.hpc";
    pack.codebook_sha256 = brdf.shared_codebook_sha256 = Sha256Hex(bytes);
  }
  PATINA_ASSIGN(const auto grid, EncodeIndexPack(pack, options.zstd_level));
  PATINA_TRY(staging.AddPayload("grid.hpx", "grid", grid));
  brdf.nside = pack.nside;
  brdf.primitive_size = pack.primitive_size;
  brdf.index_bits = pack.index_bits;
  const char* const names[] = {"bilinear", "inverse_distance", "uniform"};
  brdf.interpolation = names[static_cast<int>(pack.interpolation)];
  brdf.isotropic = pack.isotropic;
  brdf.canonical_order = pack.canonical_order;
  brdf.angle_inputs = pack.angle_inputs;
  brdf.half_vector_inputs = pack.half_vector_inputs;
  brdf.layers = {2 * pack.primitive_size + (pack.angle_inputs ? 3 : 0) +
                 (pack.half_vector_inputs ? 2 : 0)};
  if (options.textures > 0) {
    constexpr int kWidth = 13, kHeight = 9;
    manifest.kind = "svbrdf";
    brdf.images = ManifestImageSet{7, kWidth, kHeight, "wrap", std::string(64, '7')};
    brdf.layers[0] += 3 * options.textures;
    for (int t = 0; t < options.textures; ++t) {
      const std::string name = "features_" + std::to_string(t) + ".dds";
      const int count = DdsFullChainLevels(kWidth, kHeight);
      DdsTexture dds;
      dds.width = kWidth;
      dds.height = kHeight;
      if (options.halves) {
        dds.format = TextureFormat::kRgba16f;
        for (int level = 0; level < count; ++level) {
          auto& halves = dds.halves.emplace_back();
          for (int i = 3 * DdsLevelSide(kWidth, level) * DdsLevelSide(kHeight, level); i > 0; --i)
            halves.push_back(RandomHalf(random, 2));
        }
      } else {
        dds.levels = FeatureLevels(random, kWidth, kHeight);
      }
      PATINA_ASSIGN(const auto bytes, EncodeDds(dds));
      PATINA_TRY(staging.AddPayload(name, "features", bytes));
      manifest.features.push_back(
          {name, kWidth, kHeight, count, 0, TextureFormatName(dds.format)});
    }
  }
  brdf.layers.insert(brdf.layers.end(), options.hidden.begin(), options.hidden.end());
  brdf.layers.push_back(3);
  PATINA_ASSIGN(const auto weights, EncodeWeights(RandomLayers(random, brdf.layers)));
  PATINA_TRY(staging.AddPayload("decoder.weights", "weights", weights));
  if (options.with_sampler) {
    PATINA_ASSIGN(const auto sampler,
                  EncodeBrdfSampler(RandomTables(random, 4, 8, 4, pack.isotropic)));
    PATINA_TRY(staging.AddPayload("sampler.bin", "sampler", sampler));
  } else {
    brdf.sampler.clear();
  }
  PATINA_TRY(staging.WriteManifest(manifest));
  return staging;
}

}  // namespace patina::test
