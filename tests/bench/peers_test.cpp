#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "pipeline/base/rng.h"
#include "tests/bench/peer_astc.h"
#include "tests/bench/peer_bc.h"
#include "tests/bench/peer_textures.h"

namespace patina::bench {
namespace {

// A reference of albedo (3), normal (2), ao, roughness, constant metalness and displacement, of
// smooth random values.
MaterialReference MakeReference(int width, int height) {
  MaterialReference reference;
  const auto add = [&](const char* map, const char* component, Encoding encoding, bool constant) {
    TargetChannel channel;
    channel.map = map;
    channel.component = component;
    channel.encoding = encoding;
    channel.constant = constant;
    channel.constant_value = 0.25f;
    if (!constant) channel.learned_index = reference.pyramid.channels++;
    reference.channels.push_back(channel);
  };
  for (const char* component : {"r", "g", "b"}) add("albedo", component, Encoding::kSrgb, false);
  for (const char* component : {"x", "y"}) add("normal", component, Encoding::kNormalXy, false);
  add("ao", "", Encoding::kLinear, false);
  add("roughness", "", Encoding::kLinear, false);
  add("metalness", "", Encoding::kLinear, true);
  add("displacement", "", Encoding::kLinear, false);
  reference.channels.back().min_value = -2;
  reference.channels.back().max_value = 3;
  for (int w = width, h = height;; w = std::max(1, w / 2), h = std::max(1, h / 2)) {
    TargetLevel& level = reference.pyramid.levels.emplace_back();
    level.Allocate(w, h, reference.pyramid.channels);
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        for (int c = 0; c < level.channels; ++c) {
          const double u = 6.283 * (x + 0.5) / w, v = 6.283 * (y + 0.5) / h;
          const double wave = 0.5 + 0.2 * std::sin(u + c) + 0.2 * std::cos(v * (1 + c % 2) + c);
          level.Set(x, y, c, static_cast<float>(c == 7 ? -2 + 5 * wave : wave));
        }
      }
    }
    level.FillPadding(AddressMode::kWrap);
    if (w == 1 && h == 1) break;
  }
  return reference;
}

class PassThrough : public PeerCodec {
 public:
  std::string name() const override { return "none"; }
  Result<CodedLevel> RoundTrip(const Rgba8& image, bool, ThreadPool&) override {
    return CodedLevel{image, static_cast<uint64_t>(image.width) * image.height * 3};
  }
};

TEST(PlanTextures, GivesColourAndNormalsTheirOwnAndPacksTheRest) {
  const auto textures = PlanTextures(MakeReference(8, 8));
  ASSERT_EQ(textures.size(), 3u);
  EXPECT_EQ(textures[0].channels, (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(textures[1].channels, (std::vector<int>{3, 4}));
  EXPECT_TRUE(textures[1].normal);
  EXPECT_EQ(textures[2].channels, (std::vector<int>{5, 6, 8}));  // the constant needs none
}

TEST(MeasurePeer, WithoutACodecLosesOnlyTheRoundingToBytes) {
  ThreadPool pool(2);
  PassThrough codec;
  const auto result = MeasurePeer(MakeReference(40, 24), codec, 0, pool);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->bytes, 3u * 3u * (40 * 24 + 20 * 12 + 10 * 6 + 5 * 3 + 2 * 1 + 1 * 1));
  // Rounding to 1/255 alone is 58.9 dB; displacement, with a range of five, is 14 dB worse in one
  // of ten channels.
  EXPECT_GT(result->quality.maps[0].psnr.mip0_db, 58.0);
  EXPECT_GT(result->quality.maps[2].psnr.mip0_db, 58.0);
  EXPECT_NEAR(result->quality.maps[5].psnr.mip0_db, 58.9 - 14.0, 1.5);
  EXPECT_TRUE(result->quality.flip.has_value());
  EXPECT_LT(*result->quality.normal_angle_deg, 0.5);
}

TEST(MeasurePeer, MagnifiesWhatAHalfSizedTextureLacks) {
  ThreadPool pool(2);
  PassThrough codec;
  const auto reference = MakeReference(64, 64);
  const auto full = MeasurePeer(reference, codec, 0, pool);
  const auto half = MeasurePeer(reference, codec, 1, pool);
  ASSERT_TRUE(full && half);
  EXPECT_LT(half->bytes * 3, full->bytes);
  EXPECT_EQ(half->quality.psnr.psnr_db.size(), full->quality.psnr.psnr_db.size());
  EXPECT_LT(half->quality.psnr.mip0_db, full->quality.psnr.mip0_db);
  EXPECT_GT(half->quality.psnr.mip0_db, 30.0);  // smooth waves survive
  EXPECT_EQ(half->quality.psnr.psnr_db[1], full->quality.psnr.psnr_db[1]);
}

TEST(MeasurePeer, OfOneTexelHasNothingToMagnify) {
  ThreadPool pool(1);
  PassThrough codec;
  const auto result = MeasurePeer(MakeReference(1, 1), codec, 1, pool);
  ASSERT_TRUE(result);
  EXPECT_GT(result->quality.maps[0].psnr.mip0_db, 50.0);
}

TEST(RoundTripBc4, KeepsWhatTwoEndpointsCanSay) {
  uint8_t in[16], out[16];
  for (int t = 0; t < 16; ++t)
    in[t] = static_cast<uint8_t>(30 + 14 * (t % 8));  // an exact ramp of eight
  RoundTripBc4(in, out);
  EXPECT_EQ(std::vector<int>(in, in + 16), std::vector<int>(out, out + 16));
  for (int t = 0; t < 16; ++t) in[t] = 200;
  RoundTripBc4(in, out);
  EXPECT_EQ(std::vector<int>(in, in + 16), std::vector<int>(out, out + 16));
}

TEST(RoundTripBc4, UsesTheConstantsOfItsSecondMode) {
  uint8_t in[16], out[16];
  for (int t = 0; t < 16; ++t)
    in[t] = static_cast<uint8_t>(100 + 10 * (t % 6));  // a ramp of six, and both extremes
  in[3] = 0;
  in[7] = 255;
  RoundTripBc4(in, out);
  EXPECT_EQ(std::vector<int>(in, in + 16), std::vector<int>(out, out + 16));
}

TEST(RoundTripBc4, StaysWithinHalfAStepOfAnyValue) {
  Rng rng(1);
  for (int round = 0; round < 200; ++round) {
    uint8_t in[16], out[16];
    int low = 255, high = 0, error = 0;
    for (int t = 0; t < 16; ++t) {
      in[t] = static_cast<uint8_t>(rng.Below(256));
      low = std::min<int>(low, in[t]);
      high = std::max<int>(high, in[t]);
    }
    RoundTripBc4(in, out);
    for (int t = 0; t < 16; ++t) error += (in[t] - out[t]) * (in[t] - out[t]);
    // Plain endpoints at the extremes already do this well.
    const double half_step = (high - low) / 14.0 + 0.5;
    EXPECT_LE(error, 16 * half_step * half_step);
  }
}

TEST(BcCodec, CodesOddSizesAndCountsWholeBlocks) {
  ThreadPool pool(2);
  BcCodec codec;
  Rgba8 image(5, 3);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 5; ++x) {
      uint8_t* texel = image.Texel(x, y);
      texel[0] = static_cast<uint8_t>(40 * x);
      texel[1] = static_cast<uint8_t>(200 - 30 * x);
      texel[2] = 128;
    }
  }
  const auto color = codec.RoundTrip(image, false, pool);
  const auto normal = codec.RoundTrip(image, true, pool);
  ASSERT_TRUE(color && normal);
  EXPECT_EQ(color->bytes, 2u * 8u);
  EXPECT_EQ(normal->bytes, 2u * 16u);
  for (size_t i = 0; i < image.texels.size(); i += 4) {
    for (int c = 0; c < 2; ++c) {
      EXPECT_NEAR(color->decoded.texels[i + c], image.texels[i + c], 20);
      EXPECT_NEAR(normal->decoded.texels[i + c], image.texels[i + c], 10);
    }
  }
}

TEST(NearestAstcBlock, FindsTheSizeOnALogarithmicScale) {
  const auto reference = MakeReference(256, 256);
  // Three textures of 256x256 and their mips in blocks of 16 bytes.
  const AstcBlock finest = NearestAstcBlock(reference, 1000000);
  EXPECT_EQ(finest.width, 4);
  const AstcBlock coarsest = NearestAstcBlock(reference, 100);
  EXPECT_EQ(coarsest.width * coarsest.height, 144);
  const AstcBlock eight = NearestAstcBlock(reference, 3 * 65536 / 64 * 16 * 4 / 3);
  EXPECT_EQ(eight.width, 8);
  EXPECT_EQ(eight.height, 8);
}

TEST(AstcCodec, RoundTripsColourAndNormals) {
  ThreadPool pool(1);
  const std::string scratch =
      (std::filesystem::temp_directory_path() / ("patina_peers_test_" + std::to_string(getpid())))
          .string();
  std::filesystem::create_directories(scratch);
  AstcCodec codec({6, 6}, "fast", scratch);
  const auto reference = MakeReference(48, 48);
  const auto result = MeasurePeer(reference, codec, 0, pool);
  std::filesystem::remove_all(scratch);
  if (!result && result.error().code == ErrorCode::kNotFound)
    GTEST_SKIP() << result.error().message;
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_GT(result->quality.maps[0].psnr.mip0_db, 30.0);
  EXPECT_GT(result->quality.maps[1].psnr.mip0_db, 30.0);
  EXPECT_EQ(result->bytes, 3u * 16u * (64 + 16 + 4 + 1 + 1 + 1));
}

}  // namespace
}  // namespace patina::bench
