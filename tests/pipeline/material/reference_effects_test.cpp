// What is not learned: constants within a tolerance, equal channels, channels without meaning, mips
// that nobody looks at.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/material/reference.h"
#include "tests/pipeline/image/image_files.h"

namespace patina {
namespace {

using test::FileContent;
using test::Noise;
using test::Stored;
using testing::Contains;
using testing::Field;

class ReferenceEffects : public testing::Test {
 protected:
  void Add(const std::string& role, const std::string& file, const FileContent& content,
           const std::string& channels = "") {
    test::WriteWithLibrary(folder_ / file, content);
    requests_.push_back(
        {role, file, channels, "auto", NormalConvention::kOpenGl, false});
  }
  SourceReference Build() {
    ThreadPool pool(2);
    MapSet set;
    if (!requests_.empty()) {
      auto listed = ResolveMaps(requests_, folder_.path(), "set");
      EXPECT_TRUE(listed) << listed.error().message;
      set = std::move(*listed);
    }
    auto built = BuildReference(set, options_, pool, NoProgress());
    EXPECT_TRUE(built) << built.error().message;
    return built ? std::move(*built) : SourceReference();
  }
  static const TargetChannel* Channel(const SourceReference& reference, const std::string& name) {
    for (const TargetChannel& channel : reference.material.channels) {
      if (ChannelName(channel.map, channel.component) == name) return &channel;
    }
    return nullptr;
  }
  static EffectState StateOf(const SourceReference& reference, const std::string& name) {
    for (const Effect& effect : reference.effects) {
      if (effect.what == name) return effect.state;
    }
    ADD_FAILURE() << "no effect " << name;
    return EffectState::kLearned;
  }

  test::TempFolder folder_;
  std::vector<MapRequest> requests_;
  ReferenceOptions options_;
};

FileContent Grey(const std::function<float(int, int)>& value, int side = 16) {
  FileContent content{side, side, 1, Stored::kUint8, {}, 0, {}};
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) content.values.push_back(value(x, y));
  }
  return content;
}

TEST_F(ReferenceEffects, StoresWhatIsNearlyConstantAsANumberWithinTheTolerance) {
  Add("albedo", "a.png", Noise(16, 16, 3));
  Add("metalness", "m.png", Grey([](int x, int y) { return (x + y) % 2 == 0 ? 0 : 1.0f / 255; }));
  const SourceReference reference = Build();
  const TargetChannel* metalness = Channel(reference, "metalness");
  ASSERT_TRUE(metalness->constant);
  EXPECT_EQ(metalness->min_value, metalness->constant_value);
  EXPECT_LE(std::abs(metalness->constant_value - 1.0f / 255), kDefaultConstantTolerance * 1.0001);
  EXPECT_EQ(StateOf(reference, "metalness"), EffectState::kConstant);
  EXPECT_EQ(reference.material.pyramid.channels, 3);
  options_.effects.constant_tolerance = 0;
  EXPECT_FALSE(Channel(Build(), "metalness")->constant);
  options_.effects.constant_tolerance = 0.5;
  EXPECT_EQ(Build().material.pyramid.channels, 0);
}

TEST_F(ReferenceEffects, LearnsConstantsWhenAskedTo) {
  Add("albedo", "a.png", Noise(16, 16, 3));
  Add("metalness", "m.png", Grey([](int, int) { return 0.0f; }));
  options_.effects.constant = false;
  const SourceReference reference = Build();
  EXPECT_EQ(reference.material.pyramid.channels, 4);
  const TargetChannel* metalness = Channel(reference, "metalness");
  EXPECT_FALSE(metalness->constant);
  EXPECT_EQ(metalness->scale, 1.0f);
  EXPECT_EQ(metalness->min_value, metalness->max_value);
  for (const TargetLevel& level : reference.material.pyramid.levels)
    EXPECT_EQ(level.At(0, 0, metalness->learned_index), 0.0f);
}

TEST_F(ReferenceEffects, LearnsEqualChannelsOnce) {
  const FileContent grey = Noise(16, 16, 1);
  Add("albedo", "a.png", grey);  // grey as colour
  Add("transmission", "t.png", Noise(16, 16, 3), "g");
  Add("thickness", "t.png", Noise(16, 16, 3), "g");
  Add("ao", "o.png", Noise(16, 16, 3), "b");
  const SourceReference reference = Build();
  EXPECT_EQ(reference.material.channels.size(), 6u);
  EXPECT_EQ(reference.material.pyramid.channels, 3);
  EXPECT_EQ(Channel(reference, "albedo.r")->learned_index,
            Channel(reference, "albedo.b")->learned_index);
  EXPECT_EQ(Channel(reference, "transmission")->learned_index,
            Channel(reference, "thickness")->learned_index);
  EXPECT_NE(Channel(reference, "transmission")->learned_index,
            Channel(reference, "ao")->learned_index);
  EXPECT_EQ(Channel(reference, "transmission")->max_value,
            Channel(reference, "thickness")->max_value);
  EXPECT_EQ(StateOf(reference, "albedo.g"), EffectState::kDerived);
  EXPECT_EQ(StateOf(reference, "albedo.r"), EffectState::kLearned);
  options_.effects.equal = false;
  EXPECT_EQ(Build().material.pyramid.channels, 6);
}

TEST_F(ReferenceEffects, DoesNotTakeChannelsForEqualThatDifferInOneTexel) {
  Add("transmission", "t.png", Grey([](int x, int) { return static_cast<float>(x) / 15; }));
  Add("thickness", "u.png",
      Grey([](int x, int y) { return y == 15 && x == 7 ? 0.5f : static_cast<float>(x) / 15; }));
  EXPECT_EQ(Build().material.pyramid.channels, 2);
}

TEST_F(ReferenceEffects, DoesNotShareWhatIsFilteredDifferently) {
  // The same samples; but mips of opacity keep the coverage, those of roughness grow with normals.
  const FileContent ramp = Grey([](int x, int y) { return static_cast<float>((x * y) % 7) / 6; });
  Add("ao", "x.png", ramp);
  Add("opacity", "x.png", ramp);
  Add("roughness", "x.png", ramp);
  Add("normal", "n.png", Noise(16, 16, 3));
  const SourceReference reference = Build();
  EXPECT_EQ(reference.material.pyramid.channels, 5);
}

TEST_F(ReferenceEffects, DoesNotTrainIsotropicDataAsAnisotropic) {
  Add("albedo", "a.png", Noise(16, 16, 3));
  Add("anisotropy", "s.png", Grey([](int, int) { return 0.0f; }));
  Add("anisotropy_direction", "d.png", Noise(16, 16, 3), "rg");
  const SourceReference reference = Build();
  EXPECT_EQ(reference.material.pyramid.channels, 3);
  EXPECT_EQ(Channel(reference, "anisotropy_direction.x"), nullptr);
  EXPECT_NE(Channel(reference, "anisotropy"), nullptr);
  EXPECT_EQ(StateOf(reference, "anisotropy_direction.y"), EffectState::kLeftOut);
  for (const ReferenceMap& map : reference.maps) EXPECT_NE(map.role, "anisotropy_direction");
  options_.effects.unused = false;
  EXPECT_EQ(Build().material.pyramid.channels, 5);
}

TEST_F(ReferenceEffects, SaysThatTheZOfNormalsIsDerived) {
  Add("normal", "n.png", Noise(16, 16, 3));
  EXPECT_EQ(StateOf(Build(), "normal.z"), EffectState::kDerived);
}

TEST_F(ReferenceEffects, KeepsTheMipsThatAreLookedAt) {
  Add("albedo", "a.png", Noise(32, 16, 3));
  const SourceReference full = Build();
  options_.lod_range = {1, 3};
  const SourceReference part = Build();
  EXPECT_EQ(part.width, 32);
  EXPECT_EQ(part.material.pyramid.first_mip, 1);
  ASSERT_EQ(part.material.pyramid.levels.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    const TargetLevel &a = part.material.pyramid.levels[i],
                      &b = full.material.pyramid.levels[i + 1];
    ASSERT_EQ(a.width, b.width);
    EXPECT_EQ(a.At(1, 1, 2), b.At(1, 1, 2));
  }
  EXPECT_EQ(StateOf(part, "mip 0"), EffectState::kLeftOut);
  EXPECT_EQ(StateOf(part, "mips 4 to 5"), EffectState::kLeftOut);
  options_.effects.mips = false;
  EXPECT_EQ(Build().material.pyramid.levels.size(), 6u);
  options_.effects.mips = true;
  options_.lod_range = {7, 31};  // beyond the last
  EXPECT_EQ(Build().material.pyramid.levels.size(), 1u);
  options_.lod_range.reset();
  options_.density = TexelDensity{1, 2, 16};  // 32 texels a metre
  EXPECT_EQ(Build().lod_range, (std::array<int, 2>{1, 4}));
}

TEST_F(ReferenceEffects, AddsMapsWithoutFilesInTheirPlace) {
  options_.constants = {{"emissive", {16, 8, 0.5f}}, {"roughness", {0.25f}}};
  Add("albedo", "a.png", Noise(8, 8, 3));
  Add("metalness", "m.png", Noise(8, 8, 1));
  const SourceReference reference = Build();
  std::string order;
  for (const TargetChannel& channel : reference.material.channels)
    order += ChannelName(channel.map, channel.component) + " ";
  EXPECT_EQ(order,
            "albedo.r albedo.g albedo.b roughness metalness emissive.r emissive.g emissive.b ");
  EXPECT_EQ(Channel(reference, "emissive.r")->constant_value, 16.0f);
  EXPECT_EQ(Channel(reference, "emissive.r")->encoding, Encoding::kLinear);
  EXPECT_EQ(reference.material.pyramid.channels, 4);
  EXPECT_THAT(reference.maps, Contains(Field(&ReferenceMap::file, -1)));
  requests_.clear();
  const SourceReference constants = Build();
  EXPECT_EQ(constants.width, 1);
  EXPECT_EQ(constants.material.pyramid.channels, 0);
  EXPECT_EQ(constants.material.channels.size(), 4u);
}

}  // namespace
}  // namespace patina
