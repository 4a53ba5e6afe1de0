// The trainer of spatially varying BRDFs on small and on hard sets: finite, within a bound, the
// same bytes everywhere.
#include "pipeline/svbrdf/train_svbrdf.h"

#include <cstring>

#include "pipeline/base/rng.h"
#include "pipeline/svbrdf/image_set_source.h"
#include "tests/hard_cases/everywhere.h"
#include "tests/pipeline/svbrdf/set_files.h"

namespace patina::svbrdf {
namespace {

using testing_support::WriteSet;

SvbrdfOptions Quick() {
  SvbrdfOptions options;
  options.batch = 256;
  options.free_steps = 250;
  options.block_steps = 200;
  options.final_steps = 50;
  return options;
}

SvbrdfShape Small(int width, int height, AddressMode address) {
  SvbrdfShape shape = DefaultSvbrdfShape(width, height, address);
  shape.model.grid.nside = 2;
  shape.model.index_bits = 5;
  shape.model.hidden = 16;
  shape.texture.textures = 2;
  return shape;
}

struct Trained {
  TrainedSvbrdf model;
  double black = 0;  // what a black surface would err by, on the measure of the training
};

Trained Train(const std::string& list, int threads, const SvbrdfOptions& options = Quick()) {
  ThreadPool pool(threads);
  const auto set = ReadImageSet(list);
  EXPECT_TRUE(set) << set.error().message;
  const SvbrdfShape shape = Small(set->width, set->height, set->address);
  TexelPoolOptions drawing;
  drawing.count = WantedSamples(options, shape.texture, ImageSetSource(*set));
  drawing.levels = shape.texture.levels;
  drawing.grid = shape.model.grid;
  auto texels = DrawTexels(*set, drawing, pool);
  EXPECT_TRUE(texels) << texels.error().message;
  auto model = TrainSvbrdf(*texels, shape, options, pool, NoProgress());
  EXPECT_TRUE(model) << model.error().message;
  Trained trained{std::move(*model)};
  for (const TexelSample& sample : texels->samples) {
    for (const float value : sample.value)
      trained.black += std::log1p(std::max(0.0, static_cast<double>(value)) *
                                  static_cast<double>(texels->lookups[sample.pair].cosine));
  }
  trained.black /= 3 * static_cast<double>(texels->samples.size());
  return trained;
}

bool SameModel(const Trained& a, const Trained& b) {
  bool same = a.model.blocks == b.model.blocks && a.model.texels == b.model.texels &&
              a.model.pack.indices == b.model.pack.indices &&
              a.model.pack.codebook == b.model.pack.codebook &&
              a.model.network.tensors.size() == b.model.network.tensors.size();
  for (size_t t = 0; same && t < a.model.network.tensors.size(); ++t)
    same = a.model.network.tensors[t].elements == b.model.network.tensors[t].elements;
  return same && a.model.final_loss == b.model.final_loss;
}

// Two materials in stripes under a few lights.
void Stripes(int i, int x, int, float rgb[3]) {
  const bool first = x % 8 < 4;
  rgb[0] = first ? 0.3f : 0.05f;
  rgb[1] = first ? 0.02f : 0.2f + 0.01f * static_cast<float>(i);
  rgb[2] = 0.1f;
}

TEST(TrainSvbrdf, LearnsWhereWhichMaterialIs) {
  test::TemporaryDirectory folder;
  const std::string list = WriteSet(folder.path(), 9, 16, 16, Stripes, "wrap");
  const Trained trained =
      test::Everywhere([&](int threads) { return Train(list, threads); }, SameModel);
  const TrainedSvbrdf& model = trained.model;
  // One colour for all would be off by half of what black is off by.
  EXPECT_LT(model.final_loss, 0.15 * trained.black);
  EXPECT_EQ(model.rollbacks, 0);
  ASSERT_GE(model.curve.size(), 4u);
  EXPECT_LT(model.curve.back().log1p_mae, model.curve.front().log1p_mae);
  EXPECT_EQ(model.blocks[1].size(), 5u);  // 16 .. 1
  EXPECT_EQ(model.blocks[1][0].size(), 16u);
  EXPECT_TRUE(model.blocks[2].empty());
  EXPECT_EQ(model.texture_bytes(), 2u * 16 * (16 + 4 + 1 + 1 + 1));

  SvbrdfOptions halves = Quick();
  halves.form = TextureForm::kHalves;
  const Trained free = Train(list, 2, halves);
  EXPECT_LT(free.model.final_loss, 0.15 * trained.black);
  EXPECT_EQ(free.model.texture_bytes(), 2u * 6 * (256 + 64 + 16 + 4 + 1));
  EXPECT_EQ(free.model.texels.size(), size_t{341} * kRowFloats);
}

// Texels that have nothing to do with their neighbours: one number of them matters a lot, the other
// less, and each light shows both otherwise.
void Grains(int i, int x, int y, float rgb[3]) {
  Rng rng(static_cast<uint64_t>(16 * y + x), 9);
  const float bright = rng.Uniform(), hue = rng.Uniform(), turn = 0.1f * static_cast<float>(i);
  rgb[0] = 0.1f + bright * (0.6f - turn / 2) + 0.1f * hue;
  rgb[1] = 0.1f + bright * 0.3f + 0.1f * hue * turn;
  rgb[2] = 0.1f + bright * turn / 2;
}

// The first fit of blocks hardly loses where the features of each texture lie along a line, which
// few steps behind it show: 2.5 times the error of halves, and 5.5 with features as they come.
TEST(TrainSvbrdf, BlocksAreFittedToTexelsThatDifferAtRandom) {
  test::TemporaryDirectory folder;
  const std::string list = WriteSet(folder.path(), 9, 16, 16, Grains, "wrap");
  SvbrdfOptions options = Quick();
  options.free_steps = 1000;
  options.block_steps = 20;
  const Trained blocks = Train(list, 2, options);
  options.form = TextureForm::kHalves;
  const Trained halves = Train(list, 2, options);
  EXPECT_LT(halves.model.final_loss, 0.01 * halves.black);
  EXPECT_LT(blocks.model.final_loss, 4 * halves.model.final_loss);
}

struct HardSet {
  const char* name;
  const char* why;
  int images, width, height;
  testing_support::Look look;
};

TEST(TrainSvbrdf, HardSetsAreLearnedNoWorseThanByABlackSurface) {
  const HardSet sets[] = {
      {"constant", "nothing to tell texels apart by; features have no deviation", 4, 8, 8,
       [](int, int, int, float rgb[3]) { rgb[0] = rgb[1] = rgb[2] = 0.3f; }},
      {"black", "no light at all", 3, 4, 4,
       [](int, int, int, float rgb[3]) { rgb[0] = rgb[1] = rgb[2] = 0; }},
      {"one texel", "a texture of one texel and one level", 5, 1, 1,
       [](int i, int, int, float rgb[3]) {
         rgb[0] = rgb[1] = rgb[2] = 0.1f * static_cast<float>(i);
       }},
      {"odd sizes", "blocks and mips that are cut off", 5, 13, 7,
       [](int i, int x, int y, float rgb[3]) {
         rgb[0] = static_cast<float>((x + y + i) % 3);
         rgb[1] = static_cast<float>(x) / 13;
         rgb[2] = static_cast<float>(y) / 7;
       }},
      {"HDR spike", "one texel is a million times brighter", 5, 8, 8,
       [](int, int x, int y, float rgb[3]) {
         rgb[0] = rgb[1] = rgb[2] = x == 3 && y == 3 ? 1e5f : 0.1f;
       }},
      {"single image", "one pair of directions", 1, 8, 8,
       [](int, int x, int, float rgb[3]) {
         rgb[0] = rgb[1] = rgb[2] = 0.1f * static_cast<float>(x);
       }},
      {"noise below zero", "measured values that no material has", 3, 8, 8,
       [](int i, int x, int y, float rgb[3]) {
         rgb[0] = rgb[1] = rgb[2] = (x + y + i) % 2 == 0 ? -0.05f : 0.1f;
       }},
  };
  for (const HardSet& hard : sets) {
    SCOPED_TRACE(std::string(hard.name) + ": " + hard.why);
    test::TemporaryDirectory folder;
    const Trained trained =
        Train(WriteSet(folder.path(), hard.images, hard.width, hard.height, hard.look), 2);
    // 0.02 of the logarithm is 2 % of what a perfect white reflects: as good as black.
    EXPECT_LE(trained.model.final_loss, 1.1 * trained.black + 0.02);
    EXPECT_EQ(trained.model.rollbacks, 0);
  }
}

TEST(TrainSvbrdf, GoesBackWhenRatesDiverge) {
  test::TemporaryDirectory folder;
  const std::string list = WriteSet(folder.path(), 4, 8, 8, Stripes);
  SvbrdfOptions options = Quick();
  options.rate_fault = {100, 105, 1e30};
  const Trained first =
      test::Everywhere([&](int threads) { return Train(list, threads, options); }, SameModel);
  EXPECT_GT(first.model.rollbacks, 0);
  EXPECT_LT(first.model.final_loss, first.black);
  // And in the part that trains blocks.
  options.rate_fault = {300, 305, 1e30};
  const Trained second = Train(list, 2, options);
  EXPECT_GT(second.model.rollbacks, 0);
  EXPECT_LT(second.model.final_loss, second.black);
}

TEST(TrainSvbrdf, RefusesShapesOutOfRangeAndStopsWhenTold) {
  test::TemporaryDirectory folder;
  const auto set = ReadImageSet(WriteSet(folder.path(), 2, 4, 4, Stripes));
  ASSERT_TRUE(set);
  ThreadPool pool(1);
  SvbrdfShape shape = Small(4, 4, AddressMode::kClamp);
  TexelPoolOptions drawing;
  drawing.count = 1000;
  drawing.levels = shape.texture.levels;
  drawing.grid = shape.model.grid;
  const auto texels = DrawTexels(*set, drawing, pool);
  ASSERT_TRUE(texels);
  CancelToken cancel;
  cancel.Cancel();
  SvbrdfOptions options = Quick();
  options.cancel = &cancel;
  auto stopped = TrainSvbrdf(*texels, shape, options, pool, NoProgress());
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
  shape.texture.textures = 5;
  auto refused = TrainSvbrdf(*texels, shape, Quick(), pool, NoProgress());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace patina::svbrdf
