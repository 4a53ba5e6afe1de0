// The whole trainer on small materials: it learns, it is reproducible, its export is legal and close, hard input stays finite.
#include "pipeline/material/train.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "formats/half.h"
#include "pipeline/base/rng.h"
#include "pipeline/kernels/dispatch.h"
#include "tests/pipeline/material/synthetic_reference.h"

namespace patina {
namespace {

using test::MakeReference;

float Waves(double u, double v, int c) {
  return static_cast<float>(0.5 + 0.3 * std::sin(12.566 * u + c) * std::cos(18.85 * v - 2 * c) + 0.1 * std::sin(62.83 * (u + v) + c));
}

TrainedMaterial MustTrain(const MaterialReference& reference, TrainOptions options, int threads, Profile profile = Profile::kBcf1k) {
  ThreadPool pool(threads);
  const TargetLevel& base = reference.pyramid.levels[0];
  auto result = TrainMaterial(reference, ShapeForProfile(profile, base.width, base.height), options, pool, NoProgress());
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result ? std::move(*result) : TrainedMaterial{};
}

TrainOptions Samples(double samples) {
  TrainOptions options;
  options.samples = samples;
  return options;
}

void ExpectLegalAndFinite(const TrainedMaterial& material) {
  for (int t = 0; t < kFeatureTextures; ++t) {
    ASSERT_EQ(static_cast<int>(material.blocks[t].size()), material.shape[t].levels);
    for (const auto& level : material.blocks[t]) {
      for (const bc6h::Block& block : level) {
        ASSERT_TRUE(bc6h::Unpack(block.data(), bc6h::Format::kUf16));
        uint16_t texels[16][3];
        bc6h::Decode(block.data(), bc6h::Format::kUf16, texels);
        for (const auto& texel : texels) {
          for (const uint16_t half : texel) ASSERT_TRUE(HalfIsFinite(half));
        }
      }
    }
  }
  for (const auto* weights : {&material.w1, &material.b1, &material.w2, &material.b2}) {
    for (const float w : *weights) {
      ASSERT_TRUE(std::isfinite(w));
      ASSERT_EQ(w, HalfToFloat(FloatToHalf(w)));
    }
  }
}

bool SameBytes(const TrainedMaterial& a, const TrainedMaterial& b) {
  return a.blocks == b.blocks && a.w1 == b.w1 && a.b1 == b.b1 && a.w2 == b.w2 && a.b2 == b.b2;
}

// With the grain that photographed maps have; a perfectly smooth one would make every rounded code stand out.
TEST(Train, LearnsAMaterialAndExportsItWithinATenthOfADecibel) {
  Rng grain(4);
  const auto reference = MakeReference(128, 128, 6, AddressMode::kWrap,
                                       [&](double u, double v, int c) { return Waves(u, v, c) + 0.1f * (grain.Uniform() - 0.5f); });
  const TrainedMaterial material = MustTrain(reference, Samples(4e6), 2);
  ExpectLegalAndFinite(material);
  EXPECT_GT(material.exported_psnr_mip0_db, 29);
  EXPECT_GT(material.exported_psnr_mip0_db, material.float_psnr_mip0_db - 0.1);
  EXPECT_GT(material.exported_psnr_off_grid_db, 29);
  // Coarse mips are polished against the very network that is written; without that this loses whole decibels.
  EXPECT_GT(material.exported_psnr_mean_mips_db, material.float_psnr_mean_mips_db - 0.7);
}

TEST(Train, BeatsThePapersRecipeAtEqualSamples) {
  const auto reference = MakeReference(128, 128, 6, AddressMode::kWrap, Waves);
  TrainOptions paper = Samples(1e7);
  paper.recipe = Recipe::kPaper;
  const TrainedMaterial theirs = MustTrain(reference, paper, 2);
  ExpectLegalAndFinite(theirs);
  const TrainedMaterial ours = MustTrain(reference, Samples(1e7), 2);
  EXPECT_GT(ours.exported_psnr_mip0_db, theirs.exported_psnr_mip0_db + 2);
  EXPECT_GT(theirs.exported_psnr_mip0_db, 12) << "the paper's recipe must learn too";
}

TEST(Train, PaperExportUsesTheSixBitModeOnly) {
  const auto reference = MakeReference(64, 64, 4, AddressMode::kWrap, Waves);
  TrainOptions options = Samples(1.5e6);
  options.recipe = Recipe::kPaper;
  const TrainedMaterial material = MustTrain(reference, options, 2);
  for (const auto& texture : material.blocks) {
    for (const auto& level : texture) {
      for (const bc6h::Block& block : level) {
        EXPECT_EQ(bc6h::Unpack(block.data(), bc6h::Format::kUf16)->mode, bc6h::kModeSixBit);
      }
    }
  }
}

TEST(Train, GivesTheSameBytesForAnyThreadCountAndTarget) {
  const auto reference = MakeReference(160, 96, 5, AddressMode::kWrap, Waves);
  for (const Recipe recipe : {Recipe::kPatina, Recipe::kPaper}) {
    TrainOptions options = Samples(1.2e6);
    options.recipe = recipe;
    const TrainedMaterial one = MustTrain(reference, options, 1);
    EXPECT_TRUE(SameBytes(one, MustTrain(reference, options, 2)));
    EXPECT_TRUE(SameBytes(one, MustTrain(reference, options, 3)));
    for (const SimdTarget target : {SimdTarget::kAvx2, SimdTarget::kAvx512}) {
      if (!SimdTargetSupported(target)) continue;
      ASSERT_TRUE(ForceSimdTarget(SimdTargetName(target)));
      EXPECT_EQ(*ActiveSimdTarget(), target);
      EXPECT_TRUE(SameBytes(one, MustTrain(reference, options, 2))) << SimdTargetName(target);
      ASSERT_TRUE(ForceSimdTarget("auto"));
    }
    options.seed = 2;
    EXPECT_FALSE(SameBytes(one, MustTrain(reference, options, 1))) << "the seed must matter";
  }
}

TEST(Train, TakesEveryProfileAndOddShapesWrappedAndClamped) {
  struct Shape { int width, height; };
  for (const Shape shape : {Shape{1, 1}, Shape{2, 3}, Shape{1, 37}, Shape{67, 41}, Shape{130, 1}, Shape{16, 128}}) {
    for (const Profile profile : {Profile::kBcf05k, Profile::kBcf1k, Profile::kBcf2k, Profile::kBcf2kPlus}) {
      for (const AddressMode address : {AddressMode::kWrap, AddressMode::kClamp}) {
        SCOPED_TRACE(std::to_string(shape.width) + "x" + std::to_string(shape.height) + " " + ProfileName(profile));
        const auto reference = MakeReference(shape.width, shape.height, 3, address, Waves);
        const TrainedMaterial material = MustTrain(reference, Samples(2e5), 2, profile);
        ExpectLegalAndFinite(material);
        EXPECT_GT(material.exported_psnr_mip0_db, 13);
      }
    }
  }
}

TEST(Train, RefusesNoChannelsAndTooMany) {
  ThreadPool pool(1);
  MaterialReference reference = MakeReference(4, 4, 1, AddressMode::kWrap, Waves);
  reference.pyramid.channels = 0;
  auto none = TrainMaterial(reference, ShapeForProfile(Profile::kBcf1k, 4, 4), {}, pool, NoProgress());
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kInvalidArgument);
  reference.pyramid.channels = kMaxOutputs + 1;
  EXPECT_FALSE(TrainMaterial(reference, ShapeForProfile(Profile::kBcf1k, 4, 4), {}, pool, NoProgress()));
}

TEST(Train, RefusesWhatHalfWeightsCannotHold) {
  const auto reference = MakeReference(16, 16, 2, AddressMode::kWrap, [](double u, double v, int c) { return 1e6f * Waves(u, v, c); });
  ThreadPool pool(1);
  const auto result = TrainMaterial(reference, ShapeForProfile(Profile::kBcf1k, 16, 16), Samples(1e5), pool, NoProgress());
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kOutOfRange);
}

TEST(Train, GivesUpOnATargetOutOfReach) {
  const auto reference = MakeReference(64, 64, 3, AddressMode::kWrap, Waves);
  ThreadPool pool(2);
  TrainOptions options = Samples(1e6);
  options.target_psnr_db = 90;
  options.give_up = true;
  const auto result = TrainMaterial(reference, ShapeForProfile(Profile::kBcf05k, 64, 64), options, pool, NoProgress());
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->stopped_by, "hopeless");
  EXPECT_LT(result->samples + result->curve.back().samples, 1e6);
  EXPECT_TRUE(result->blocks[0].empty());
  EXPECT_LT(result->curve.back().psnr_mip0_db + GainToCome(1.0 / 16), 90);
}

TEST(Train, SaysThatATargetIsOutOfReachAndGoesOn) {
  const auto reference = MakeReference(64, 64, 3, AddressMode::kWrap, Waves);
  ThreadPool pool(2);
  struct Warnings : ProgressSink {
    void OnProgress(const ProgressEvent&) override {}
    void OnWarning(const std::string& message) override { said.push_back(message); }
    std::vector<std::string> said;
  } sink;
  TrainOptions options = Samples(1e6);
  options.target_psnr_db = 90;
  const auto result = TrainMaterial(reference, ShapeForProfile(Profile::kBcf05k, 64, 64), options, pool, sink);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->stopped_by, "budget");
  ASSERT_EQ(sink.said.size(), 1u);
  EXPECT_NE(sink.said[0].find("out of reach"), std::string::npos);
  EXPECT_FALSE(result->blocks[0].empty());
}

TEST(Train, RecordsTheAccuracyOfEachChannel) {
  const auto reference = MakeReference(32, 32, 3, AddressMode::kWrap, Waves);
  const TrainedMaterial result = MustTrain(reference, Samples(2e5), 1);
  ASSERT_GE(result.curve.size(), 3u);
  for (const CurvePoint& point : result.curve) {
    ASSERT_EQ(point.psnr_channels_db.size(), 3u);
    double mse = 0;
    for (const double db : point.psnr_channels_db) mse += std::pow(10, -0.1 * db) / 3;
    EXPECT_NEAR(-10 * std::log10(mse), point.psnr_mip0_db, 1e-6);
  }
}

TEST(Train, StopsWhenCancelled) {
  const auto reference = MakeReference(64, 64, 3, AddressMode::kWrap, Waves);
  ThreadPool pool(2);
  CancelToken cancel;
  cancel.Cancel();
  TrainOptions options = Samples(1e12);
  options.cancel = &cancel;
  const auto result = TrainMaterial(reference, ShapeForProfile(Profile::kBcf1k, 64, 64), options, pool, NoProgress());
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace patina
