// Manifests and whole containers with random content for the tests of formats/.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "formats/container.h"
#include "formats/dds.h"
#include "formats/half.h"
#include "formats/manifest.h"
#include "formats/weights.h"
#include "tests/formats/test_support.h"

namespace patina::test {

inline std::string HexOf(char digit) { return std::string(64, digit); }

// A manifest that uses every field.
inline Manifest FullManifest() {
  Manifest manifest;
  manifest.asset = "cobblestone";
  manifest.tool.version = "0.1.0";
  manifest.fingerprint = HexOf('a');
  manifest.seed = 9223372036854775807ull;
  manifest.profile = "bcf-1k";
  manifest.source.width = 64;
  manifest.source.height = 48;
  manifest.source.levels = 7;
  manifest.source.address = "clamp";
  manifest.source.normal_convention = "directx";
  manifest.source.files = {
      {"cobblestone_diff_64.png", {"albedo"}, HexOf('1'), 64, 48, 3, "uint8", "png"},
      {"sub/cobblestone_arm_64.exr", {"ao", "roughness"}, HexOf('2'), 32, 24, 4, "half", "openexr"},
      {"readme.tif", {}, HexOf('3'), 1, 1, 1, "uint16", "tiff"}};
  const int sides[4][2] = {{32, 24}, {16, 12}, {8, 6}, {4, 3}};
  for (int i = 0; i < 4; ++i) {
    const std::string name = "features_" + std::to_string(i) + ".dds";
    manifest.payloads.push_back({name, "features", 1000, HexOf('4')});
    manifest.features.push_back({name, sides[i][0], sides[i][1],
                                 DdsFullChainLevels(sides[i][0], sides[i][1]), -(i + 1),
                                 "BC6H_UF16"});
  }
  manifest.payloads.push_back({"decoder.weights", "weights", 1024, HexOf('5')});
  manifest.payloads.push_back({"preview.png", "preview", 12345, HexOf('6')});
  manifest.payloads.push_back({"report.json", "report", 0, HexOf('7')});
  manifest.network = ManifestNetwork{"decoder.weights", 12, 16, 5, "relu"};
  manifest.channels = {{"albedo", "r", "srgb", 0.1f, 0.9f, 1, 0},
                       {"albedo", "g", "srgb", 0, 1, 0, 0},
                       {"albedo", "b", "srgb", 0.25f, 0.25f, -1, 0.25f},
                       {"normal", "x", "normal_xy", 0, 1, 2, 0},
                       {"normal", "y", "normal_xy", 0, 1, 3, 0},
                       {"roughness", "", "linear", 0.3f, 1e-30f + 0.7f, 4, 0}};
  manifest.channels.back().scale = 4;
  manifest.maps = {{"albedo", 0, {0, 1, 2}, "uint8", false, "srgb", "sRGB", "tag"},
                   {"roughness", 1, {1}, "half", true, "linear", "", ""},
                   {"normal", -1, {}, "uint16", false, "linear", "", ""}};
  manifest.color_config = ManifestColorConfig{"file", "config.ocio", HexOf('8')};
  manifest.quality.psnr_overall_db = 36.5;
  manifest.quality.psnr_mip0_db = 30.625;
  manifest.quality.psnr_mean_mips_db = INFINITY;
  manifest.quality.ssim = 0.95;
  manifest.quality.flip = 0.05;
  ManifestMapQuality albedo{"albedo", {31.5, 0.9, 0.04, std::nullopt}, {}};
  albedo.mips = {{31.5, 0.9, 0.04, std::nullopt}, {INFINITY, 1.0, 0.0, std::nullopt}};
  manifest.quality.maps = {albedo, {"normal", {std::nullopt, std::nullopt, std::nullopt, 2.5}, {}}};
  manifest.quality.gate_min_psnr_db = 30;
  manifest.quality.gate_met = true;
  manifest.training.samples = 400000000;
  manifest.training.stopped_by = "slope";
  manifest.training.float_psnr_mip0_db = 30.75;
  manifest.training.float_psnr_mean_mips_db = 36.875;
  manifest.training.rollbacks = 1;
  manifest.training.curve = {{1000000, 25.5, 30.25, {{"albedo", 26.5}, {"normal", 24.5}}},
                             {400000000, 30.75, 36.875, {{"albedo", 31.5}, {"normal", INFINITY}}}};
  manifest.training.choice =
      ManifestChoice{30.5,
                     3000000,
                     {{"bcf-0.5k", 117872, 26.25, true}, {"bcf-1k", 466032, std::nullopt, false}},
                     "bcf-1k",
                     true,
                     true,
                     "bcf-1k is the smallest that is left"};
  manifest.effects = {{"albedo.b", "constant", "constant 0.25", ManifestSavings{34, 16, 0, 4800}},
                      {"albedo.r", "learned", "", std::nullopt}};
  manifest.warnings = {"readme.tif was not recognised"};
  return manifest;
}

// A network with weights of about unit size.
inline NetworkWeights RandomNetwork(Random& random, int inputs, int outputs) {
  NetworkWeights network;
  network.inputs = inputs;
  network.hidden = 16;
  network.outputs = outputs;
  const auto fill = [&](std::vector<float>* values, int count) {
    for (int i = 0; i < count; ++i) {
      values->push_back(HalfToFloat(FloatToHalf(static_cast<float>(random.Unit() * 2 - 1))));
    }
  };
  fill(&network.w1, 16 * inputs);
  fill(&network.b1, 16);
  fill(&network.w2, outputs * 16);
  fill(&network.b2, outputs);
  return network;
}

// Levels of legal blocks in the six-bit mode with values around 1 (2^-4 .. 2^4), like trained
// features.
inline std::vector<std::vector<bc6h::Block>> FeatureLevels(Random& random, int width, int height) {
  std::vector<std::vector<bc6h::Block>> levels(
      static_cast<size_t>(DdsFullChainLevels(width, height)));
  for (size_t level = 0; level < levels.size(); ++level) {
    const int side = static_cast<int>(level);
    const int count = DdsBlocks(DdsLevelSide(width, side)) * DdsBlocks(DdsLevelSide(height, side));
    for (int i = 0; i < count; ++i) {
      bc6h::BlockFields fields;
      fields.partition = random.Below(32);
      for (auto& endpoint : fields.endpoints) {
        for (auto& code : endpoint) code = 22 + random.Below(17);
      }
      for (auto& index : fields.indices) index = static_cast<uint8_t>(random.Below(8));
      bc6h::FixAnchors(&fields);
      levels[level].push_back(*bc6h::Pack(fields, bc6h::Format::kUf16));
    }
  }
  return levels;
}

struct SampleOptions {
  int width = 64;
  int height = 48;
  int shifts[4] = {1, 2, 3, 4};
  std::string address = "wrap";
  bool all_constant = false;
};

// A staging area with a material of five learned channels and one constant one, ready to be
// published.
inline Result<StagingArea> StageSample(const std::string& out, const std::string& asset,
                                       uint64_t seed, const SampleOptions& options = {},
                                       FileSystem& files = RealFileSystem()) {
  Random random(seed);
  PATINA_ASSIGN(StagingArea staging, StagingArea::Create(out, asset, files));
  Manifest manifest = FullManifest();
  manifest.source.width = options.width;
  manifest.source.height = options.height;
  manifest.source.levels = DdsFullChainLevels(options.width, options.height);
  manifest.source.address = options.address;
  manifest.quality.maps.clear();
  manifest.features.clear();
  if (options.all_constant) {
    manifest.network.reset();
    for (auto& channel : manifest.channels) {
      channel.output = -1;
      channel.constant = 0.5f;
    }
  } else {
    for (int i = 0; i < 4; ++i) {
      const int width = DdsLevelSide(options.width, options.shifts[i]);
      const int height = DdsLevelSide(options.height, options.shifts[i]);
      const auto levels = FeatureLevels(random, width, height);
      PATINA_ASSIGN(const auto bytes, EncodeDds(bc6h::Format::kUf16, width, height, levels));
      const std::string name = "features_" + std::to_string(i) + ".dds";
      PATINA_TRY(staging.AddPayload(name, "features", bytes));
      manifest.features.push_back(
          {name, width, height, static_cast<int>(levels.size()), -options.shifts[i], "BC6H_UF16"});
    }
    PATINA_ASSIGN(const WeightBuffer weights, PackNetwork(RandomNetwork(random, 12, 5)));
    PATINA_ASSIGN(const auto bytes, EncodeWeights(weights));
    PATINA_TRY(staging.AddPayload("decoder.weights", "weights", bytes));
    for (auto& channel : manifest.channels) {
      channel.range_min = -30;  // so that clamping happens, but rarely
      channel.range_max = 30;
    }
  }
  PATINA_TRY(staging.AddPayload("report.json", "report", AsBytes("{}\n")));
  PATINA_TRY(staging.AddUnlisted("run.json", AsBytes("{\"seconds\": 1}\n")));
  PATINA_TRY(staging.WriteManifest(manifest));
  return staging;
}

}  // namespace patina::test
