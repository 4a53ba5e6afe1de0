#include "tests/formats/gpu/material_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/base/sha256.h"
#include "tests/formats/sample_container.h"

namespace patina::gpu_test {
namespace {

// What is promised is 1e-3 of a channel's range: GPUs may round filter weights to 8 bits. llvmpipe
// filters in floats, so the bound here is what differs besides: float positions (2^-23 of up to 4
// texture widths of 128 texels are 6e-5 texels, times differences of neighbours of about a range),
// another order of sums, and pow.
constexpr double kBound = 1e-4;

using test::Random;

NetworkWeights NetworkOf(Random& random, int inputs, int hidden, int outputs) {
  NetworkWeights network;
  network.inputs = inputs;
  network.hidden = hidden;
  network.outputs = outputs;
  const auto fill = [&](std::vector<float>* values, int count, double size) {
    for (int i = 0; i < count; ++i) {
      const double value = (random.Unit() * 2 - 1) * size;
      values->push_back(HalfToFloat(FloatToHalf(static_cast<float>(value))));
    }
  };
  // Features are around 1; outputs are to spread over the ranges below.
  fill(&network.w1, hidden * inputs, 1 / std::sqrt(inputs));
  fill(&network.b1, hidden, 0.5);
  fill(&network.w2, outputs * hidden, 1.5 / std::sqrt(hidden));
  fill(&network.b2, outputs, 0.5);
  return network;
}

// The channels: `outputs` learned ones with `constants` others among them. Channels of a map are
// together.
std::vector<ManifestChannel> Channels(const MaterialShape& shape) {
  struct Kind {
    const char* map;
    const char* component;
    const char* encoding;
    float scale;
  };
  const Kind kinds[] = {{"albedo", "r", "srgb", 1},          {"albedo", "g", "srgb", 1},
                        {"albedo", "b", "srgb", 1},          {"normal", "x", "normal_xy", 1},
                        {"normal", "y", "normal_xy", 1},     {"roughness", "", "linear", 1},
                        {"displacement", "", "linear", 4.5f}};
  std::vector<ManifestChannel> channels;
  int next_output = shape.outputs, left = shape.constants;
  for (int c = 0; c < shape.outputs + shape.constants; ++c) {
    const bool known = c < static_cast<int>(std::size(kinds));
    const Kind kind = known ? kinds[c] : Kind{"", "", "linear", 1};
    ManifestChannel channel;
    channel.map = known ? kind.map : "extra-" + std::to_string(c);
    channel.component = kind.component;
    channel.encoding = kind.encoding;
    channel.scale = kind.scale;
    channel.range_min = -0.6f;
    channel.range_max = 1.7f;
    if (left > 0 && (c % 3 == 1 || next_output == 0)) {
      --left;
      channel.constant = 0.03125f * static_cast<float>(c) - 0.1f;
    } else {
      channel.output = --next_output;  // not in the order of the channels
    }
    channels.push_back(channel);
  }
  return channels;
}

std::vector<std::vector<bc6h::Block>> Levels(Random& random, const MaterialShape& shape, int width,
                                             int height) {
  if (!shape.is_signed) return test::FeatureLevels(random, width, height);
  std::vector<std::vector<bc6h::Block>> levels(
      static_cast<size_t>(DdsFullChainLevels(width, height)));
  for (size_t l = 0; l < levels.size(); ++l) {
    const int level = static_cast<int>(l);
    const int count =
        DdsBlocks(DdsLevelSide(width, level)) * DdsBlocks(DdsLevelSide(height, level));
    for (int i = 0; i < count; ++i) {
      bc6h::BlockFields fields;
      fields.partition = random.Below(32);
      for (auto& endpoint : fields.endpoints) {
        for (auto& code : endpoint) code = (random.Below(2) == 0 ? 1 : -1) * (12 + random.Below(6));
      }
      for (auto& index : fields.indices) index = static_cast<uint8_t>(random.Below(8));
      bc6h::FixAnchors(&fields);
      const auto block = bc6h::Pack(fields, bc6h::Format::kSf16);
      EXPECT_TRUE(block);
      levels[l].push_back(block ? *block : bc6h::Block{});
    }
  }
  return levels;
}

Result<std::string> Publish(const std::string& folder, const MaterialShape& shape, uint64_t seed) {
  Random random(seed);
  PATINA_ASSIGN(StagingArea staging, StagingArea::Create(folder, "asset"));
  Manifest manifest = test::FullManifest();
  manifest.source.width = shape.width;
  manifest.source.height = shape.height;
  manifest.source.levels = DdsFullChainLevels(shape.width, shape.height);
  manifest.source.address = shape.address;
  manifest.quality.maps.clear();
  manifest.maps.clear();
  manifest.features.clear();
  manifest.network.reset();
  manifest.channels = Channels(shape);
  if (shape.outputs > 0) {
    const int inputs = 3 * static_cast<int>(shape.shifts.size());
    for (size_t i = 0; i < shape.shifts.size(); ++i) {
      const int width = DdsLevelSide(shape.width, shape.shifts[i]);
      const int height = DdsLevelSide(shape.height, shape.shifts[i]);
      const auto levels = Levels(random, shape, width, height);
      const auto format = shape.is_signed ? bc6h::Format::kSf16 : bc6h::Format::kUf16;
      PATINA_ASSIGN(const auto bytes, EncodeDds(format, width, height, levels));
      const std::string name = "features_" + std::to_string(i) + ".dds";
      PATINA_TRY(staging.AddPayload(name, "features", bytes));
      manifest.features.push_back({name, width, height, static_cast<int>(levels.size()),
                                   -shape.shifts[i], shape.is_signed ? "BC6H_SF16" : "BC6H_UF16"});
    }
    const NetworkWeights network = NetworkOf(random, inputs, shape.hidden, shape.outputs);
    PATINA_ASSIGN(const WeightBuffer weights, PackNetwork(network));
    PATINA_ASSIGN(const auto bytes, EncodeWeights(weights));
    PATINA_TRY(staging.AddPayload("decoder.weights", "weights", bytes));
    manifest.network =
        ManifestNetwork{"decoder.weights", inputs, shape.hidden, shape.outputs, "relu"};
  }
  PATINA_TRY(staging.WriteManifest(manifest));
  PATINA_ASSIGN(const PublishedContainer published, staging.Publish());
  return published.directory;
}

}  // namespace

Container MakeMaterial(const std::string& folder, const MaterialShape& shape, uint64_t seed) {
  const auto directory = Publish(folder, shape, seed);
  EXPECT_TRUE(directory) << directory.error().message;
  if (!directory) return {};
  auto container = OpenContainer(*directory);
  EXPECT_TRUE(container) << container.error().message;
  return container ? std::move(*container) : Container{};
}

Container CutLevels(const Container& container, int fine, int coarse) {
  Container cut = container;
  const std::string path = container.PathOf(kManifestName);
  const auto text = ReadTextFile(path, kMaxManifestBytes);
  EXPECT_TRUE(text);
  auto json = nlohmann::ordered_json::parse(*text);
  for (size_t i = 0; i < cut.manifest.features.size(); ++i) {
    ManifestFeature& feature = cut.manifest.features[i];
    DdsTexture texture = *ReadDds(container.PathOf(feature.payload));
    auto& levels = texture.levels;
    const int first = std::min(fine, feature.levels - 1);
    levels.erase(levels.begin(), levels.begin() + first);
    levels.resize(std::max<size_t>(1, levels.size() - std::min<size_t>(levels.size(), coarse)));
    feature.width = DdsLevelSide(feature.width, first);
    feature.height = DdsLevelSide(feature.height, first);
    feature.levels = static_cast<int>(levels.size());
    feature.lod_bias -= first;
    const auto bytes = EncodeDds(static_cast<bc6h::Format>(texture.format), feature.width,
                                 feature.height, levels);
    EXPECT_TRUE(bytes && WriteFileDurably(container.PathOf(feature.payload), *bytes));
    for (ManifestPayload& payload : cut.manifest.payloads) {
      if (payload.name != feature.payload) continue;
      payload.bytes = bytes->size();
      payload.sha256 = Sha256Hex(*bytes);
    }
    auto& listed = json["features"][i];
    listed["width"] = feature.width;
    listed["height"] = feature.height;
    listed["levels"] = feature.levels;
    listed["lod_bias"] = feature.lod_bias;
  }
  EXPECT_TRUE(WriteFileDurably(path, json.dump(2)));
  return cut;
}

std::vector<float> RandomLookups(uint64_t seed, size_t count, int width, int height) {
  Random random(seed);
  std::vector<float> lookups;
  for (size_t i = 0; i < count; ++i) {
    double u = random.Unit() * 4 - 1.5, v = random.Unit() * 4 - 1.5;
    double s = random.Unit() * 12 - 2;
    if (i % 4 == 0) {
      u = (random.Below(width) + 0.5) / width;
      v = (random.Below(height) + 0.5) / height;
      s = std::floor(s);
    }
    if (i % 16 == 1) u = random.Below(3) - 1, v = random.Below(3) - 1;  // the seam itself
    lookups.insert(lookups.end(), {static_cast<float>(u), static_cast<float>(v),
                                   static_cast<float>(s), 0, 0, 0, 0, 0});
  }
  return lookups;
}

std::vector<float> Decoded(const Decoder& decoder, const std::vector<float>& lookups) {
  const size_t channels = decoder.channels().size();
  std::vector<float> values(lookups.size() / 8 * channels);
  for (size_t i = 0; i < lookups.size() / 8; ++i) {
    const float* at = lookups.data() + 8 * i;
    decoder.Physical(at[0], at[1], at[2], values.data() + i * channels);
  }
  return values;
}

Decoder LoadDecoder(const Container& container) {
  Decoder decoder;
  std::string problem;
  EXPECT_EQ(Decoder::Load(container.directory, &decoder, &problem), Decoder::LoadStatus::kOk)
      << problem;
  return decoder;
}

void ExpectMaterialClose(const Decoder& decoder, const std::vector<float>& lookups,
                         const std::vector<float>& from_gpu, const std::vector<float>& expected) {
  ASSERT_EQ(from_gpu.size(), expected.size());
  const size_t channels = decoder.channels().size();
  double worst = 0;
  size_t at = 0;
  for (size_t i = 0; i < expected.size(); ++i) {
    const double error = std::abs(static_cast<double>(from_gpu[i]) - expected[i]) /
                         PhysicalRange(decoder.channels()[i % channels]);
    if (!(error <= worst)) worst = error, at = i;  // NaN counts
  }
  const float* place = lookups.data() + at / channels * 8;
  EXPECT_LE(worst, kBound) << "channel " << at % channels << " at " << place[0] << ", " << place[1]
                           << ", " << place[2] << ": " << from_gpu[at] << " instead of "
                           << expected[at];
}

void CheckMaterial(const Container& container, uint64_t seed, size_t count,
                   const ShaderOptions& options, const RunProgram& run) {
  const Decoder decoder = LoadDecoder(container);
  GpuProgram program = LoadProgram(container, options);
  SetMaterialBody(&program, static_cast<int>(decoder.channels().size()));
  const auto lookups = RandomLookups(seed, count, decoder.width(), decoder.height());
  ExpectMaterialClose(decoder, lookups, run(program, lookups), Decoded(decoder, lookups));
}

double PhysicalRange(const Decoder::Channel& channel) {
  return static_cast<double>(Decoder::ToPhysical(channel, channel.max)) -
         static_cast<double>(Decoder::ToPhysical(channel, channel.min));
}

}  // namespace patina::gpu_test
