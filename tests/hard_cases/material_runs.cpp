#include "tests/hard_cases/material_runs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "formats/container.h"
#include "formats/decoder/patina_decoder.h"
#include "pipeline/jobs/package.h"
#include "tests/formats/test_support.h"

namespace patina::test {
namespace {

Manifest ManifestOf(const TrainedMaterial& model, const MaterialReference& reference) {
  const TargetLevel& base = reference.pyramid.levels[0];
  Manifest manifest;
  manifest.asset = "hard";
  manifest.tool.version = "1";
  manifest.fingerprint = std::string(64, '0');
  manifest.profile = "bcf-1k";
  manifest.source.width = base.width;
  manifest.source.height = base.height;
  manifest.source.levels = static_cast<int>(reference.pyramid.levels.size());
  manifest.training.stopped_by = "budget";
  for (int t = 0; t < kFeatureTextures; ++t) {
    const FeatureShape& shape = model.shape[t];
    manifest.features.push_back({"features_" + std::to_string(t) + ".dds", shape.width,
                                 shape.height, shape.levels, -shape.lod_shift, "BC6H_UF16"});
  }
  manifest.network =
      ManifestNetwork{"decoder.weights", kNetworkInputs, kNetworkHidden, model.outputs, "relu"};
  for (const TargetChannel& channel : reference.channels) {
    // So wide a range that nothing is clamped: what the network gives is looked at.
    manifest.channels.push_back(
        {channel.map, channel.component, "linear", -1e6f, 1e6f, channel.learned_index, 0});
    manifest.maps.push_back({channel.map, -1, {}, "float", false, "linear", "", ""});
  }
  return manifest;
}

}  // namespace

TrainedMaterial MustTrain(const MaterialReference& reference, const TrainOptions& options,
                          int threads) {
  ThreadPool pool(threads);
  const TargetLevel& base = reference.pyramid.levels[0];
  auto result = TrainMaterial(reference, ShapeForProfile(Profile::kBcf1k, base.width, base.height),
                              options, pool, NoProgress());
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result ? std::move(*result) : TrainedMaterial{};
}

bool SameModel(const TrainedMaterial& a, const TrainedMaterial& b) {
  return a.blocks == b.blocks && a.w1 == b.w1 && a.b1 == b.b1 && a.w2 == b.w2 && a.b2 == b.b2 &&
         a.rollbacks == b.rollbacks;
}

std::vector<std::vector<float>> DecodeMip0(const TrainedMaterial& model,
                                           const MaterialReference& reference) {
  std::vector<std::vector<float>> planes(reference.channels.size());
  const TemporaryDirectory out;
  auto staging = StagingArea::Create(out.path(), "hard");
  if (!staging) {
    ADD_FAILURE() << staging.error().message;
    return planes;
  }
  Status status = AddModel(model, &*staging);
  if (status) status = staging->WriteManifest(ManifestOf(model, reference));
  if (!status) {
    ADD_FAILURE() << status.error().message;
    return planes;
  }
  Decoder decoder;
  std::string problem;
  if (Decoder::Load(staging->directory(), &decoder, &problem) != Decoder::LoadStatus::kOk) {
    ADD_FAILURE() << problem;
    return planes;
  }
  std::vector<float> values(planes.size());
  for (int y = 0; y < decoder.height(); ++y) {
    for (int x = 0; x < decoder.width(); ++x) {
      decoder.Coded((x + 0.5) / decoder.width(), (y + 0.5) / decoder.height(), 0, values.data());
      for (size_t c = 0; c < planes.size(); ++c) {
        EXPECT_TRUE(std::isfinite(values[c])) << x << " " << y << " channel " << c;
        planes[c].push_back(values[c]);
      }
    }
  }
  return planes;
}

}  // namespace patina::test
