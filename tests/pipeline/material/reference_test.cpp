#include "pipeline/material/reference.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <numbers>

#include "pipeline/color/color.h"
#include "pipeline/material/normal_convention.h"
#include "tests/pipeline/image/image_files.h"

namespace patina {
namespace {

using test::FileContent;
using test::Flat;
using test::Noise;
using test::Stored;
using test::TempFolder;
using testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

FileContent Fill(int width, int height, int channels, Stored stored,
                 const std::function<float(int, int, int)>& value) {
  FileContent content{width, height, channels, stored, {}, 0, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) content.values.push_back(value(x, y, c));
    }
  }
  return content;
}

class Reference : public testing::Test {
 protected:
  void Add(const std::string& file, const FileContent& content) {
    test::WriteWithLibrary(folder_ / file, content);
  }
  void List(const std::string& role, const std::string& file, const std::string& channels = "",
            bool invert = false, const std::string& space = "auto",
            NormalConvention convention = NormalConvention::kAuto) {
    requests_.push_back({role, file, channels, space, convention, invert});
  }
  Result<SourceReference> Build(int threads = 2) {
    ThreadPool pool(threads);
    MapSet set;
    if (requests_.empty()) {
      auto sets = FindMaps(folder_.path());
      if (!sets) return Fail(sets.error());
      set = sets->front();
    } else {
      auto listed = ResolveMaps(requests_, folder_.path(), "set");
      if (!listed) return Fail(listed.error());
      set = *listed;
    }
    return BuildReference(set, options_, pool, NoProgress());
  }
  SourceReference MustBuild(int threads = 2) {
    auto built = Build(threads);
    EXPECT_TRUE(built) << built.error().message;
    return built ? std::move(*built) : SourceReference();
  }
  static const TargetChannel* Channel(const SourceReference& reference, const std::string& map,
                                      const std::string& component = "") {
    for (const TargetChannel& channel : reference.material.channels) {
      if (channel.map == map && channel.component == component) return &channel;
    }
    ADD_FAILURE() << "no channel " << map << "." << component;
    return &reference.material.channels[0];
  }
  static float At(const SourceReference& reference, size_t mip, int x, int y,
                  const std::string& map, const std::string& component = "") {
    return reference.material.pyramid.levels[mip].At(
        x, y, Channel(reference, map, component)->learned_index);
  }
  static std::string Warnings(const SourceReference& reference) {
    std::string all;
    for (const std::string& warning : reference.warnings) all += warning + "\n";
    return all;
  }

  TempFolder folder_;
  std::vector<MapRequest> requests_;
  ReferenceOptions options_;
};

TEST_F(Reference, HasAllLevelsOfAnySize) {
  for (const auto& [width, height] :
       {std::pair{1, 1}, {1, 7}, {9, 1}, {5, 3}, {16, 16}, {33, 20}}) {
    requests_.clear();
    Add("a.png", Noise(width, height, 3));
    List("albedo", "a.png");
    const SourceReference reference = MustBuild();
    EXPECT_EQ(reference.width, width);
    EXPECT_EQ(reference.height, height);
    int w = width, h = height;
    for (const TargetLevel& level : reference.material.pyramid.levels) {
      EXPECT_EQ(level.width, w);
      EXPECT_EQ(level.height, h);
      EXPECT_EQ(level.channels, reference.material.pyramid.channels);
      w = std::max(1, w / 2);
      h = std::max(1, h / 2);
    }
    EXPECT_EQ(reference.material.pyramid.levels.back().width, 1);
    EXPECT_EQ(reference.material.pyramid.levels.back().height, 1);
  }
}

TEST_F(Reference, StoresCodesOnMip0AndTheirPadding) {
  const FileContent noise = Noise(37, 5, 3, Stored::kUint16);
  Add("a.png", noise);
  List("albedo", "a.png");
  for (const AddressMode mode : {AddressMode::kWrap, AddressMode::kClamp}) {
    options_.address = mode;
    const SourceReference reference = MustBuild();
    const TargetLevel& mip0 = reference.material.pyramid.levels[0];
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < mip0.row_blocks * 16; ++x) {
        const int from = x < 37 ? x : mode == AddressMode::kWrap ? x % 37 : 36;
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(mip0.At(x, y, c), noise.values[(y * 37 + from) * 3 + c], 8e-6);
      }
    }
    EXPECT_EQ(reference.material.pyramid.address, mode);
  }
}

TEST_F(Reference, AveragesColourInLinearLight) {
  Add("a.png", Fill(2, 2, 3, Stored::kUint8, [](int x, int, int) { return x == 0 ? 0.0f : 1.0f; }));
  List("albedo", "a.png");
  const SourceReference reference = MustBuild();
  EXPECT_EQ(Channel(reference, "albedo", "r")->encoding, Encoding::kSrgb);
  EXPECT_NEAR(At(reference, 1, 0, 0, "albedo", "r"), LinearToSrgb(0.5), 2e-6);
}

TEST_F(Reference, KeepsLinearColourLinear) {
  Add("a.exr",
      Fill(2, 1, 3, Stored::kHalf, [](int x, int, int) { return x == 0 ? 0.0f : 65504.0f; }));
  List("emissive", "a.exr");
  const SourceReference reference = MustBuild();
  const TargetChannel& channel = *Channel(reference, "emissive", "g");
  EXPECT_EQ(channel.encoding, Encoding::kLinear);
  // Learned divided by a power of two, so that half weights hold it.
  EXPECT_EQ(channel.scale, 65536.0f);
  EXPECT_EQ(channel.max_value * channel.scale, 65504.0f);
  EXPECT_FLOAT_EQ(At(reference, 1, 0, 0, "emissive", "g") * channel.scale, 32752.0f);
}

TEST_F(Reference, TakesAColourSpaceAtItsWord) {
  Add("a.png",
      Fill(2, 1, 3, Stored::kUint8, [](int x, int, int) { return static_cast<float>(x); }));
  List("albedo", "a.png", "", false, "linear");
  SourceReference reference = MustBuild();
  EXPECT_EQ(Channel(reference, "albedo", "r")->encoding, Encoding::kLinear);
  EXPECT_FLOAT_EQ(At(reference, 1, 0, 0, "albedo", "r"), 0.5f);
  requests_.clear();
  Add("r.png",
      Fill(2, 1, 1, Stored::kUint8, [](int x, int, int) { return x == 0 ? 128.0f / 255 : 1.0f; }));
  List("roughness", "r.png", "", false, "srgb");
  reference = MustBuild();
  EXPECT_NEAR(At(reference, 0, 0, 0, "roughness"), SrgbToLinear(128.0 / 255), 1e-6);
}

TEST_F(Reference, FindsConstantChannelsExactly) {
  Add("a.png", Fill(8, 8, 3, Stored::kUint8, [](int x, int y, int c) {
        return c == 0   ? 51.0f / 255
               : c == 1 ? (x == 7 && y == 7 ? 52.0f / 255 : 51.0f / 255)
                        : static_cast<float>(x) / 8;
      }));
  List("albedo", "a.png");
  options_.effects.constant_tolerance = 0;
  const SourceReference reference = MustBuild();
  EXPECT_TRUE(Channel(reference, "albedo", "r")->constant);
  EXPECT_EQ(Channel(reference, "albedo", "r")->constant_value, 51.0f / 255.0f);
  EXPECT_EQ(Channel(reference, "albedo", "r")->learned_index, -1);
  EXPECT_FALSE(Channel(reference, "albedo", "g")->constant);
  EXPECT_EQ(Channel(reference, "albedo", "g")->learned_index, 0);
  EXPECT_EQ(Channel(reference, "albedo", "b")->learned_index, 1);
  EXPECT_EQ(reference.material.pyramid.channels, 2);
}

TEST_F(Reference, TakesASetWithNothingToLearn) {
  Add("a.png", Flat(4, 4, {0.2f, 0.4f, 0.6f}));
  Add("r.png", Flat(16, 2, {0.5f}));
  List("albedo", "a.png");
  List("roughness", "r.png");
  const SourceReference reference = MustBuild();
  EXPECT_EQ(reference.material.pyramid.channels, 0);
  EXPECT_EQ(reference.width, 16);
  EXPECT_EQ(reference.height, 4);
  EXPECT_EQ(reference.material.pyramid.levels.size(), 5u);
  for (const TargetChannel& channel : reference.material.channels) EXPECT_TRUE(channel.constant);
}

TEST_F(Reference, ReadsNormalsOfBothConventions) {
  const float s = std::numbers::sqrt2_v<float> / 2;
  Add("n.png", Fill(2, 1, 3, Stored::kUint16, [&](int x, int, int c) {
        const float n[2][3] = {{s, 0, s}, {0, 0.6f, 0.8f}};
        return 0.5f + 0.5f * n[x][c];
      }));
  for (const NormalConvention convention :
       {NormalConvention::kOpenGl, NormalConvention::kDirectX}) {
    requests_.clear();
    List("normal", "n.png", "", false, "auto", convention);
    const SourceReference reference = MustBuild();
    const float sign = convention == NormalConvention::kDirectX ? -1.0f : 1.0f;
    EXPECT_NEAR(At(reference, 0, 0, 0, "normal", "x"), 0.5 + 0.5 * s, 2e-5);
    EXPECT_NEAR(At(reference, 0, 1, 0, "normal", "y"), 0.5 + 0.5 * sign * 0.6, 2e-5);
    EXPECT_EQ(reference.maps[0].convention, convention);
    // The mean of the two, renormalised.
    const double mean[3] = {s / 2, sign * 0.3, (s + 0.8) / 2};
    const double length = std::hypot(mean[0], mean[1], mean[2]);
    EXPECT_NEAR(At(reference, 1, 0, 0, "normal", "x"), 0.5 + 0.5 * mean[0] / length, 2e-5);
    EXPECT_NEAR(At(reference, 1, 0, 0, "normal", "y"), 0.5 + 0.5 * mean[1] / length, 2e-5);
  }
}

TEST_F(Reference, MendsNormalsWithoutDirection) {
  Add("n.png", Fill(4, 1, 3, Stored::kUint8, [](int x, int, int c) {
        const float texels[4][3] = {
            {0, 0, 0}, {0.5f, 0.5f, 0.5f}, {1, 0.5f, 0.25f}, {0.8f, 0.5f, 0.9f}};
        return texels[x][c];
      }));
  List("normal", "n.png");
  const SourceReference reference = MustBuild();
  EXPECT_EQ(At(reference, 0, 0, 0, "normal", "x"), 0.5f);
  EXPECT_EQ(At(reference, 0, 1, 0, "normal", "x"), 0.5f);
  EXPECT_NEAR(At(reference, 0, 2, 0, "normal", "x"), 1.0f, 1e-4);  // raised to the surface
  EXPECT_THAT(Warnings(reference), HasSubstr("2 normals (50.00 %) have no direction"));
  EXPECT_THAT(Warnings(reference), HasSubstr("1 normals (25.00 %) point below"));
}

TEST_F(Reference, TakesANormalMapOfNothingButZeros) {
  Add("n.png", Flat(8, 8, {0, 0, 0}));
  List("normal", "n.png");
  const SourceReference reference = MustBuild();
  EXPECT_TRUE(Channel(reference, "normal", "x")->constant);
  EXPECT_EQ(Channel(reference, "normal", "x")->constant_value, 0.5f);
  EXPECT_EQ(Channel(reference, "normal", "y")->constant_value, 0.5f);
  EXPECT_THAT(Warnings(reference), HasSubstr("64 normals"));
}

TEST_F(Reference, RebuildsZWhereItIsConstantOrMissing) {
  const auto value = [](int x, int, int c) {
    return c == 2 ? 1.0f : c == 0 ? (x == 0 ? 0.8f : 0.2f) : 0.5f;
  };
  Add("n.png", Fill(2, 1, 3, Stored::kUint16, value));
  List("normal", "n.png");
  SourceReference reference = MustBuild();
  EXPECT_NEAR(At(reference, 0, 0, 0, "normal", "x"), 0.8, 1e-4);
  requests_.clear();
  List("normal", "n.png", "rg");
  reference = MustBuild();
  EXPECT_NEAR(At(reference, 0, 0, 0, "normal", "x"), 0.8, 1e-4);
}

TEST_F(Reference, ReadsSignedFloatNormals) {
  Add("n.exr", Fill(2, 1, 3, Stored::kFloat, [](int x, int, int c) {
        const float n[2][3] = {{-0.6f, 0, 0.8f}, {0, 0, 1}};
        return n[x][c];
      }));
  List("normal", "n.exr");
  const SourceReference reference = MustBuild();
  EXPECT_NEAR(At(reference, 0, 0, 0, "normal", "x"), 0.2, 1e-6);
  EXPECT_EQ(At(reference, 0, 1, 0, "normal", "x"), 0.5f);
}

TEST_F(Reference, RefusesANormalMapOfOneChannel) {
  Add("n.png", Noise(4, 4, 1));
  List("normal", "n.png");
  const auto built = Build();
  ASSERT_FALSE(built);
  EXPECT_EQ(built.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(built.error().message, HasSubstr("n.png"));
}

// Waves: the height of a bumpy surface and its normals.
class Waves : public Reference {
 protected:
  static float Height(double x, double y) {
    return static_cast<float>(0.5 + 0.2 * std::sin(0.4 * x) * std::cos(0.3 * y) +
                              0.1 * std::sin(0.15 * x + 0.5 * y));
  }
  static float Normal(int x, int y, int c, float sign) {
    constexpr double kScale = 4;
    const double dx = kScale * (Height(x + 0.5, y) - Height(x - 0.5, y));
    const double dy = kScale * (Height(x, y + 0.5) - Height(x, y - 0.5));
    const double length = std::hypot(dx, dy, 1.0);
    // Rows count downwards, so the upward slope is -dy.
    const double n[3] = {-dx / length, sign * dy / length, 1 / length};
    return static_cast<float>(0.5 + 0.5 * n[c]);
  }
  void AddWaves(float sign) {
    Add("w_color.png", Noise(96, 64, 3));
    Add("w_normal.png", Fill(96, 64, 3, Stored::kUint8,
                             [&](int x, int y, int c) { return Normal(x, y, c, sign); }));
  }
  void AddHeight() {
    Add("w_height.png",
        Fill(96, 64, 1, Stored::kUint8, [](int x, int y, int) { return Height(x, y); }));
  }
};

TEST_F(Waves, TellTheConventionWithTheHeight) {
  AddWaves(1);
  AddHeight();
  SourceReference reference = MustBuild();
  EXPECT_EQ(reference.maps[1].convention, NormalConvention::kOpenGl);
  EXPECT_EQ(Warnings(reference), "");
  AddWaves(-1);
  const SourceReference directx = MustBuild();
  EXPECT_EQ(directx.maps[1].convention, NormalConvention::kDirectX);
  EXPECT_THAT(Warnings(directx), HasSubstr("read as a DirectX normal map"));
  // Both give the same material.
  for (int x = 0; x < 96; ++x) {
    EXPECT_NEAR(At(directx, 0, x, 11, "normal", "y"), At(reference, 0, x, 11, "normal", "y"),
                0.005);
  }
}

TEST_F(Waves, OnlyRaiseASuspicionWithoutTheHeight) {
  AddWaves(-1);
  const SourceReference reference = MustBuild();
  EXPECT_EQ(reference.maps[1].convention, NormalConvention::kOpenGl);
  EXPECT_THAT(Warnings(reference), HasSubstr("fit together better as DirectX"));
}

TEST_F(Waves, AreOverriddenByTheOption) {
  AddWaves(-1);
  AddHeight();
  options_.normal_convention = NormalConvention::kOpenGl;
  const SourceReference reference = MustBuild();
  EXPECT_EQ(reference.maps[1].convention, NormalConvention::kOpenGl);
  EXPECT_EQ(Warnings(reference), "");
}

TEST_F(Reference, WidensRoughnessWhereNormalsVary) {
  Add("a_normal.png", Fill(16, 16, 3, Stored::kUint16, [](int x, int y, int c) {
        // Rough on the left, flat on the right.
        const double angle = x < 8 ? ((x + y) % 2 == 0 ? 0.4 : -0.4) : 0;
        return static_cast<float>(c == 0   ? 0.5 + 0.5 * std::sin(angle)
                                  : c == 1 ? 0.5
                                           : 0.5 + 0.5 * std::cos(angle));
      }));
  Add("a_roughness.png",
      Fill(16, 16, 1, Stored::kUint8, [](int x, int, int) { return x % 4 < 2 ? 0.2f : 0.21f; }));
  const SourceReference on = MustBuild();
  options_.widen_roughness = false;
  const SourceReference off = MustBuild();
  const double length = std::cos(0.4);
  const double plain = At(off, 1, 0, 0, "roughness");
  EXPECT_NEAR(At(on, 1, 0, 0, "roughness"),
              std::pow(std::pow(plain, 4) + 2 * (1 - length) / length, 0.25), 1e-4);
  EXPECT_NEAR(At(on, 1, 7, 0, "roughness"), At(off, 1, 7, 0, "roughness"), 1e-6);
  EXPECT_EQ(At(on, 0, 0, 0, "roughness"), At(off, 0, 0, 0, "roughness"));
  // The range covers what filtering adds.
  EXPECT_GT(Channel(on, "roughness")->max_value, Channel(off, "roughness")->max_value);
  for (size_t mip = 1; mip < on.material.pyramid.levels.size(); ++mip) {
    EXPECT_GE(At(on, mip, 0, 0, "roughness"), At(off, mip, 0, 0, "roughness") - 1e-6f);
  }
}

TEST_F(Reference, KeepsTheCoverageOfOpacity) {
  FileContent noise = Noise(64, 64, 1, Stored::kUint16);
  for (float& value : noise.values) value *= value;  // 29 % at or above one half
  Add("o.png", noise);
  List("opacity", "o.png");
  const SourceReference reference = MustBuild();
  const auto coverage = [&](size_t mip) {
    const TargetLevel& level = reference.material.pyramid.levels[mip];
    int visible = 0;
    for (int y = 0; y < level.height; ++y) {
      for (int x = 0; x < level.width; ++x) visible += level.At(x, y, 0) >= kOpacityCutoff;
    }
    return static_cast<double>(visible) / (level.width * level.height);
  };
  for (size_t mip = 1; mip < reference.material.pyramid.levels.size(); ++mip) {
    const TargetLevel& level = reference.material.pyramid.levels[mip];
    EXPECT_NEAR(coverage(mip), coverage(0), 0.51 / (level.width * level.height))
        << mip;  // the nearest number of texels
  }
}

TEST_F(Reference, TakesOpacityThatIsZeroAlmostEverywhere) {
  Add("o.png", Fill(16, 16, 1, Stored::kUint8,
                    [](int x, int y, int) { return x == 3 && y == 3 ? 0.4f : 0.0f; }));
  List("opacity", "o.png");
  const SourceReference reference = MustBuild();
  for (const TargetLevel& level : reference.material.pyramid.levels)
    EXPECT_LT(level.At(0, 0, 0), 0.5f);
  requests_.clear();
  Add("z.png", Flat(16, 16, {0.0f}));
  List("opacity", "z.png");
  const SourceReference zero = MustBuild();
  EXPECT_TRUE(Channel(zero, "opacity")->constant);
  EXPECT_EQ(Channel(zero, "opacity")->constant_value, 0.0f);
}

TEST_F(Reference, MakesOpacityOfAlphaOnlyWhereItSaysSomething) {
  Add("a_basecolor.png", Fill(4, 4, 4, Stored::kUint8, [](int x, int, int c) {
        return c == 3 ? 1.0f : static_cast<float>(x) / 4;
      }));
  SourceReference reference = MustBuild();
  EXPECT_EQ(reference.material.channels.size(), 3u);
  ASSERT_EQ(reference.maps.size(), 1u);
  EXPECT_EQ(reference.files[0].roles, std::vector<std::string>{"albedo"});
  Add("a_basecolor.png",
      Fill(4, 4, 4, Stored::kUint8, [](int x, int, int) { return static_cast<float>(x) / 4; }));
  reference = MustBuild();
  ASSERT_EQ(reference.maps.size(), 2u);
  EXPECT_EQ(reference.maps[1].role, "opacity");
  EXPECT_EQ(reference.maps[1].file_channels, std::vector<int>{3});
  EXPECT_EQ(reference.files.size(), 1u);
  EXPECT_EQ(reference.files[0].roles, (std::vector<std::string>{"albedo", "opacity"}));
}

TEST_F(Reference, InvertsGloss) {
  Add("a_gloss.png",
      Fill(2, 1, 1, Stored::kUint8, [](int x, int, int) { return x == 0 ? 0.2f : 1.0f; }));
  const SourceReference reference = MustBuild();
  EXPECT_NEAR(At(reference, 0, 0, 0, "roughness"), 0.8, 1e-6);
  EXPECT_EQ(At(reference, 0, 1, 0, "roughness"), 0.0f);
  EXPECT_TRUE(reference.maps[0].inverted);
}

TEST_F(Reference, ChoosesTheChannelThatSaysSomething) {
  Add("r.png", Fill(4, 1, 3, Stored::kUint8,
                    [](int x, int, int c) { return c == 1 ? static_cast<float>(x) / 5 : 1.0f; }));
  List("roughness", "r.png");
  SourceReference reference = MustBuild();
  EXPECT_EQ(reference.maps[0].file_channels, std::vector<int>{1});
  EXPECT_THAT(Warnings(reference), HasSubstr("roughness is read from g"));
  requests_.clear();
  Add("m.png", Noise(4, 4, 3));
  List("metalness", "m.png");
  reference = MustBuild();
  EXPECT_EQ(reference.maps[0].file_channels, std::vector<int>{2});  // as glTF packs it
  EXPECT_THAT(Warnings(reference), HasSubstr("channels differ"));
  requests_.clear();
  Add("g.png",
      Fill(4, 4, 3, Stored::kUint8, [](int x, int, int) { return static_cast<float>(x) / 5; }));
  List("ao", "g.png");
  reference = MustBuild();
  EXPECT_EQ(reference.maps[0].file_channels, std::vector<int>{0});
  EXPECT_EQ(Warnings(reference), "");
}

TEST_F(Reference, RepeatsGreyColour) {
  Add("a.png", Noise(8, 8, 1));
  List("albedo", "a.png");
  options_.effects.equal = false;
  const SourceReference reference = MustBuild();
  EXPECT_EQ(reference.material.pyramid.channels, 3);
  EXPECT_EQ(At(reference, 0, 3, 3, "albedo", "r"), At(reference, 0, 3, 3, "albedo", "b"));
}

TEST_F(Reference, EnlargesSmallerMaps) {
  Add("a.png", Noise(32, 16, 3));
  Add("r.png",
      Fill(8, 4, 1, Stored::kUint8, [](int x, int, int) { return static_cast<float>(x) / 8; }));
  Add("m.png", Flat(1, 1, {0.5f}));
  List("albedo", "a.png");
  List("roughness", "r.png");
  List("metalness", "m.png");
  const SourceReference reference = MustBuild();
  EXPECT_EQ(reference.width, 32);
  EXPECT_EQ(reference.height, 16);
  EXPECT_THAT(Warnings(reference), HasSubstr("r.png: 8 x 4 texels are enlarged to 32 x 16"));
  EXPECT_THAT(Warnings(reference), testing::Not(HasSubstr("m.png")));
  EXPECT_NEAR(At(reference, 0, 15, 0, "roughness"), (15.5 / 4 - 0.5) / 8, 0.003);
  EXPECT_TRUE(Channel(reference, "metalness")->constant);
  EXPECT_EQ(Channel(reference, "metalness")->constant_value, 128.0f / 255.0f);
  EXPECT_TRUE(reference.maps[1].resized);
  EXPECT_FALSE(reference.maps[0].resized);
}

TEST_F(Reference, DoesNotGrowForAConstantMap) {
  Add("a.png", Noise(8, 8, 3));
  Add("m.png", Flat(64, 64, {0.5f}));
  List("albedo", "a.png");
  List("metalness", "m.png");
  EXPECT_EQ(MustBuild().width, 8);
}

TEST_F(Reference, RefusesOrRepairsNonFiniteSamples) {
  FileContent content = Noise(8, 8, 3, Stored::kHalf);
  content.values[(2 * 8 + 5) * 3 + 1] = kNan;
  content.values[(6 * 8 + 1) * 3 + 0] = std::numeric_limits<float>::infinity();
  Add("a.exr", content);
  List("albedo", "a.exr");
  const auto refused = Build();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kCorruptData);
  EXPECT_THAT(refused.error().message,
              HasSubstr("2 samples are NaN or infinite, the first at x 5, y 2, channel 1"));
  EXPECT_THAT(refused.error().message, HasSubstr("a.exr"));
  EXPECT_THAT(refused.error().message, HasSubstr("--repair-nonfinite"));
  options_.repair_nonfinite = true;
  const SourceReference repaired = MustBuild();
  EXPECT_THAT(Warnings(repaired), HasSubstr("2 samples"));
  for (const TargetLevel& level : repaired.material.pyramid.levels) {
    for (size_t i = 0; i < level.data.size(); ++i) ASSERT_TRUE(std::isfinite(level.data[i]));
  }
}

TEST_F(Reference, RefusesTooManyTexels) {
  Add("a.png", Noise(64, 64, 3));
  List("albedo", "a.png");
  options_.max_texels = 64 * 63;
  const auto built = Build();
  ASSERT_FALSE(built);
  EXPECT_EQ(built.error().code, ErrorCode::kOutOfRange);
}

TEST_F(Reference, StopsWhenCancelled) {
  Add("a.png", Noise(8, 8, 3));
  List("albedo", "a.png");
  CancelToken cancel;
  cancel.Cancel();
  options_.cancel = &cancel;
  EXPECT_EQ(Build().error().code, ErrorCode::kCancelled);
}

TEST_F(Reference, NamesTheFileThatIsDamaged) {
  Add("a_albedo.png", Noise(32, 32, 3));
  Add("a_roughness.png", Noise(32, 32, 1));
  std::vector<uint8_t> bytes = test::ReadBytes(folder_ / "a_roughness.png");
  bytes.resize(bytes.size() / 2);
  test::WriteBytes(folder_ / "a_roughness.png", bytes);
  const auto built = Build();
  ASSERT_FALSE(built);
  EXPECT_EQ(built.error().code, ErrorCode::kCorruptData);
  EXPECT_THAT(built.error().message, HasSubstr("a_roughness.png"));
}

TEST_F(Reference, IsTheSameForAnyThreadCount) {
  Add("a_albedo.png", Noise(75, 50, 4));
  Add("a_normal.png", Noise(75, 50, 3, Stored::kUint8, 2));
  Add("a_orm.png", Noise(30, 20, 3, Stored::kUint8, 3));
  const SourceReference one = MustBuild(1);
  for (const int threads : {2, 3}) {
    const SourceReference other = MustBuild(threads);
    ASSERT_EQ(other.material.pyramid.levels.size(), one.material.pyramid.levels.size());
    for (size_t mip = 0; mip < one.material.pyramid.levels.size(); ++mip) {
      const auto& a = one.material.pyramid.levels[mip].data;
      const auto& b = other.material.pyramid.levels[mip].data;
      ASSERT_EQ(a.size(), b.size());
      EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(float)), 0) << mip;
    }
    EXPECT_EQ(other.warnings, one.warnings);
  }
}

TEST_F(Reference, KeepsTheMeanOfDataOnEveryMip) {
  Add("h.png", Noise(45, 77, 1));
  List("displacement", "h.png");
  const SourceReference reference = MustBuild();
  double expected = -1;
  for (const TargetLevel& level : reference.material.pyramid.levels) {
    double sum = 0;
    for (int y = 0; y < level.height; ++y) {
      for (int x = 0; x < level.width; ++x) sum += level.At(x, y, 0);
    }
    const double mean = sum / level.width / level.height;
    if (expected < 0) expected = mean;
    EXPECT_NEAR(mean, expected, 2e-6);
  }
}

TEST_F(Reference, DescribesItsFiles) {
  Add("a_basecolor.png", Noise(8, 8, 3));
  Add("a_orm.png", Noise(8, 8, 3, Stored::kUint16));
  const SourceReference reference = MustBuild();
  ASSERT_EQ(reference.files.size(), 2u);
  EXPECT_EQ(reference.files[1].file, "a_orm.png");
  EXPECT_EQ(reference.files[1].roles, (std::vector<std::string>{"ao", "roughness", "metalness"}));
  EXPECT_EQ(reference.files[1].type, SampleType::kUint16);
  EXPECT_EQ(reference.files[1].format, "png");
  ASSERT_EQ(reference.maps.size(), 4u);
  EXPECT_TRUE(reference.maps[0].srgb);
  EXPECT_EQ(reference.maps[2].role, "roughness");
  EXPECT_EQ(reference.maps[2].file, 1);
  EXPECT_EQ(reference.maps[2].file_channels, std::vector<int>{1});
  EXPECT_FALSE(reference.maps[2].srgb);
}

TEST(BuildReference, RefusesAnEmptySet) {
  ThreadPool pool(1);
  EXPECT_EQ(BuildReference(MapSet(), ReferenceOptions(), pool, NoProgress()).error().code,
            ErrorCode::kInvalidArgument);
}

TargetPyramid Ramp(AddressMode mode) {
  TargetPyramid pyramid;
  pyramid.channels = 1;
  pyramid.address = mode;
  for (const int side : {8, 4, 2, 1}) {
    TargetLevel level;
    level.Allocate(side, side, 1);
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x)
        level.Set(x, y, 0,
                  static_cast<float>((x + 0.5) / side) + 100.0f * static_cast<float>(side));
    }
    level.FillPadding(mode);
    pyramid.levels.push_back(std::move(level));
  }
  return pyramid;
}

TEST(SampleReference, MeetsTexelCentres) {
  const TargetPyramid pyramid = Ramp(AddressMode::kWrap);
  double value;
  for (int x = 0; x < 8; ++x) {
    SampleReference(pyramid, (x + 0.5) / 8, 0.5 / 8, 0, &value);
    EXPECT_EQ(value, pyramid.levels[0].At(x, 0, 0));
  }
}

TEST(SampleReference, IsExactOnRampsAndLinearBetweenMips) {
  const TargetPyramid pyramid = Ramp(AddressMode::kClamp);
  double value;
  SampleReference(pyramid, 0.43, 0.6, 0, &value);
  EXPECT_NEAR(value, 800.43, 1e-4);
  SampleReference(pyramid, 0.5, 0.6, 0.25, &value);
  EXPECT_NEAR(value, 0.75 * 800.5 + 0.25 * 400.5, 1e-4);
  SampleReference(pyramid, 0.5, 0.5, 2.5, &value);
  EXPECT_NEAR(value, 150.5, 1e-4);
}

TEST(SampleReference, ClampsTheLevelAndAddressesTheEdge) {
  double a, b;
  const TargetPyramid wrap = Ramp(AddressMode::kWrap);
  SampleReference(wrap, 0.3, 0.7, -5, &a);
  SampleReference(wrap, 0.3, 0.7, 0, &b);
  EXPECT_EQ(a, b);
  SampleReference(wrap, 0.3, 0.7, 50, &a);
  EXPECT_NEAR(a, 100.5, 1e-5);
  SampleReference(wrap, 0.3, 0.7, 1.5, &a);
  SampleReference(wrap, 2.3, -4.3, 1.5, &b);
  EXPECT_NEAR(a, b, 1e-9);
  const TargetPyramid clamp = Ramp(AddressMode::kClamp);
  SampleReference(clamp, 3.0, 0.5, 0, &a);
  EXPECT_NEAR(a, 800.9375, 1e-4);
  SampleReference(clamp, -3.0, 0.5, 0, &a);
  EXPECT_NEAR(a, 800.0625, 1e-4);
}

TEST(RealNormalMaps, TellTheirConvention) {
  const std::string root = test::SharedData("pbr");
  if (root.empty()) GTEST_SKIP() << "the shared texture sets are not here";
  ThreadPool pool(2);
  const std::vector<std::pair<std::string, NormalConvention>> folders = {
      {"acg1k_Rock020", NormalConvention::kDirectX},
      {"acg1k_Tiles036", NormalConvention::kDirectX},
      {"acg1k_Bricks102", NormalConvention::kOpenGl},
      {"acg1k_Facade005", NormalConvention::kOpenGl}};
  for (const auto& [folder, convention] : folders) {
    auto sets = FindMaps(root + "/" + folder);
    ASSERT_TRUE(sets) << sets.error().message;
    for (MapSource& map : sets->front().maps) map.convention = NormalConvention::kAuto;
    const auto reference = BuildReference(sets->front(), ReferenceOptions(), pool, NoProgress());
    ASSERT_TRUE(reference) << reference.error().message;
    EXPECT_EQ(reference->maps[1].convention, convention) << folder;
  }
}

}  // namespace
}  // namespace patina
