// From a trained neural texture to the files of a container, and back through the decoder that
// renderers use.
#include "pipeline/jobs/svbrdf_package.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "formats/dds.h"
#include "formats/half.h"
#include "pipeline/jobs/load_svbrdf_decoder.h"
#include "pipeline/svbrdf/image_set_source.h"
#include "tests/pipeline/svbrdf/set_files.h"

namespace patina {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 16, kHeight = 8, kTextures = 2;

// A model of a small set after a few steps, with an uncompressed texture.
svbrdf::TrainedSvbrdf TrainHalves(const std::string& folder) {
  const std::string list = svbrdf::testing_support::WriteSet(
      folder, 5, kWidth, kHeight,
      [](int i, int x, int y, float rgb[3]) {
        for (int c = 0; c < 3; ++c)
          rgb[c] = 0.02f * static_cast<float>((x * (c + 1) + 3 * y + i) % 16);
      },
      "wrap");
  ThreadPool pool(2);
  const auto set = svbrdf::ReadImageSet(list);
  EXPECT_TRUE(set) << set.error().message;
  svbrdf::SvbrdfShape shape =
      svbrdf::DefaultSvbrdfShape(kWidth, kHeight, AddressMode::kWrap, false);
  shape.model.grid.nside = 2;
  shape.model.index_bits = 5;
  shape.model.hidden = 16;
  shape.texture.textures = kTextures;
  svbrdf::SvbrdfOptions options;
  options.form = svbrdf::TextureForm::kHalves;
  options.batch = 256;
  options.free_steps = options.block_steps = 40;
  options.final_steps = 10;
  svbrdf::TexelPoolOptions drawing;
  drawing.count = WantedSamples(options, shape.texture, svbrdf::ImageSetSource(*set));
  drawing.levels = shape.texture.levels;
  drawing.grid = shape.model.grid;
  const auto texels = DrawTexels(*set, drawing, pool);
  EXPECT_TRUE(texels) << texels.error().message;
  auto model = TrainSvbrdf(*texels, shape, options, pool, NoProgress());
  EXPECT_TRUE(model) << model.error().message;
  return std::move(*model);
}

Job HalvesJob() {
  Job job;
  job.kind = JobKind::kSvbrdf;
  job.asset = "stripes";
  job.model.texture_format = "fp16";
  return job;
}

// The staged container of a model whose network gives `weight` times the features of a texture.
Result<StagingArea> Stage(const std::string& out, svbrdf::TrainedSvbrdf model, int texture,
                          uint16_t weight) {
  PATINA_ASSIGN(StagingArea staging, StagingArea::Create(out, "stripes"));
  const int features = model.shape.texture.features();
  const auto inputs = static_cast<uint32_t>(2 * model.shape.model.primitive_size +
                                            model.shape.model.grid.extra_inputs() + features);
  WeightTensor weights{"layer0.weight", {3, inputs}, std::vector<uint16_t>(size_t{3} * inputs)};
  for (uint32_t c = 0; c < 3; ++c) {
    const uint32_t input = inputs - static_cast<uint32_t>(features - 3 * texture) + c;
    weights.elements[c * inputs + input] = weight;
  }
  model.network.tensors = {weights, {"layer0.bias", {3}, std::vector<uint16_t>(3)}};
  PATINA_TRY(AddSvbrdfModel(model, &staging));
  SvbrdfSource source;
  source.format = "image_set";
  source.images = 5;
  source.images_sha256 = source.fingerprint = std::string(64, 'a');
  source.files = {{"set.btf.json", std::string(64, 'b')}};
  Manifest manifest = DescribeSvbrdf(HalvesJob(), source, model.shape, {});
  manifest.brdf->layers = {static_cast<int>(inputs), 3};
  PATINA_TRY(staging.WriteManifest(manifest));
  return staging;
}

TEST(SvbrdfPackage, HoldsTheTrainedHalvesBitForBit) {
  const test::TemporaryDirectory folder;
  const svbrdf::TrainedSvbrdf model = TrainHalves(folder.path());
  const float up[3] = {0, 0, 1};
  int positive = 0, negative = 0;
  for (int t = 0; t < kTextures; ++t) {
    for (const uint16_t weight : {uint16_t{0x3C00}, uint16_t{0xBC00}}) {
      const auto staging = Stage(folder.path(), model, t, weight);
      ASSERT_OK(staging);
      const auto container = OpenContainer(staging->directory());
      ASSERT_OK(container);
      ASSERT_OK(VerifyPayloads(*container));
      EXPECT_EQ(container->manifest.features[1].format, "RGBA16F");
      const std::string name = "features_" + std::to_string(t) + ".dds";
      const auto dds = ReadDds(container->PathOf(name));
      ASSERT_OK(dds);
      const auto decoder = LoadSvbrdfDecoder(staging->directory());
      ASSERT_OK(decoder);
      ASSERT_EQ(decoder->levels(), model.shape.texture.levels);
      size_t row = 0;
      for (int l = 0; l < decoder->levels(); ++l) {
        const int width = DdsLevelSide(kWidth, l), height = DdsLevelSide(kHeight, l);
        for (int i = 0; i < width * height; ++i, ++row) {
          const float* trained = model.texels.data() + row * svbrdf::kRowFloats + 3 * t;
          float rgb[3];
          decoder->Evaluate(up, up, (i % width + 0.5) / width, (i / width + 0.5) / height, l, rgb);
          for (int c = 0; c < 3; ++c) {
            ASSERT_EQ(dds->halves[l][static_cast<size_t>(3 * i + c)], FloatToHalf(trained[c]));
            ASSERT_EQ(HalfToFloat(FloatToHalf(trained[c])), trained[c]);
            const float y = HalfToFloat(weight) * trained[c];
            ASSERT_EQ(rgb[c], y > 0 ? std::expm1(std::min(y, 12.0f)) : 0.0f)
                << name << " level " << l << " texel " << i;
            ++(y > 0 ? positive : negative);
          }
        }
      }
    }
  }
  EXPECT_GT(positive, 100);
  EXPECT_GT(negative, 100);
}

TEST(SvbrdfPackage, RefusesATexelThatNoHalfHolds) {
  const test::TemporaryDirectory folder;
  svbrdf::TrainedSvbrdf model = TrainHalves(folder.path());
  for (const float value : {1e6f, INFINITY, NAN}) {
    // Row 130 is texel 2 of level 1, feature 4 the second one of texture 1.
    model.texels[130 * svbrdf::kRowFloats + 4] = value;
    const auto staging = Stage(folder.path(), model, 0, 0x3C00);
    ASSERT_FALSE(staging);
    EXPECT_EQ(staging.error().code, ErrorCode::kOutOfRange);
    EXPECT_THAT(staging.error().message, HasSubstr("features_1.dds: texel 2 of level 1"));
  }
}

}  // namespace
}  // namespace patina
