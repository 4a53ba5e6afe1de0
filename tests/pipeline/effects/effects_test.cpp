// What has to be learned, from the range of the samples alone.
#include "pipeline/effects/effects.h"

#include <gtest/gtest.h>

#include <cmath>

namespace patina {
namespace {

ChannelVerdict Judge(const ChannelFacts& facts, const EffectSwitches& switches = {}) {
  return JudgeChannels({&facts, 1}, switches)[0];
}

TEST(JudgeChannels, TakesWhatStaysWithinTheToleranceForConstant) {
  const float code = 1.0f / 255;
  EXPECT_EQ(Judge({"metalness", "", 0.25f, 0.25f, 1}).state, EffectState::kConstant);
  EXPECT_EQ(Judge({"metalness", "", 0.25f, 0.25f, 1}).constant, 0.25f);
  const ChannelVerdict near = Judge({"metalness", "", 0, code, 1});
  EXPECT_EQ(near.state, EffectState::kConstant);
  EXPECT_LE(std::abs(near.constant - code), kDefaultConstantTolerance * (1 + 1e-6));
  EXPECT_LE(std::abs(near.constant), kDefaultConstantTolerance * (1 + 1e-6));
  EXPECT_EQ(Judge({"metalness", "", 0, 2 * code, 1}).state, EffectState::kLearned);
}

TEST(JudgeChannels, ComparesWithTheUnitThatChannelsAreLearnedIn) {
  // A tiny range far from 0 is little, the same range of tiny values is everything.
  EXPECT_EQ(Judge({"emissive", "r", 100, 100.25f, 128}).state, EffectState::kConstant);
  EXPECT_EQ(Judge({"thickness", "", 0, 1e-4f, 0x1p-13f}).state, EffectState::kLearned);
  EXPECT_EQ(Judge({"emissive", "r", 65504, 65504, 65536}).constant, 65504);
}

TEST(JudgeChannels, WantsDisplacementToBeExact) {
  EXPECT_EQ(Judge({"displacement", "", 0.5f, 0.5f + 1e-6f, 1}).state, EffectState::kLearned);
  EXPECT_EQ(Judge({"displacement", "", 0.5f, 0.5f, 1}).state, EffectState::kConstant);
}

TEST(JudgeChannels, LearnsConstantsWhereAsked) {
  EffectSwitches switches;
  switches.constant = false;
  EXPECT_EQ(Judge({"ao", "", 1, 1, 1}, switches).state, EffectState::kLearned);
  switches.constant = true;
  switches.constant_tolerance = 0;
  EXPECT_EQ(Judge({"ao", "", 1, std::nextafter(1.0f, 2.0f), 1}, switches).state,
            EffectState::kLearned);
}

TEST(JudgeChannels, LeavesOutWhatAStrengthOfZeroGoverns) {
  const ChannelFacts facts[] = {{"clearcoat", "", 0, 0, 1},
                                {"clearcoat_roughness", "", 0, 1, 1},
                                {"clearcoat_normal", "x", 0, 1, 1},
                                {"clearcoat_normal", "y", 0, 1, 1},
                                {"sheen_color", "r", 0, 0, 1},
                                {"sheen_color", "g", 0, 0.5f, 1},
                                {"sheen_color", "b", 0, 0, 1},
                                {"sheen_roughness", "", 0, 1, 1},
                                {"anisotropy", "", 0, 0, 1},
                                {"anisotropy_direction", "x", 0, 1, 1},
                                {"anisotropy_direction", "y", 0, 1, 1}};
  const auto verdicts = JudgeChannels(facts, {});
  for (const size_t i : {1, 2, 3, 9, 10}) {
    EXPECT_EQ(verdicts[i].state, EffectState::kLeftOut) << facts[i].map;
    EXPECT_FALSE(verdicts[i].reason.empty());
  }
  // One channel of the sheen's colour is not 0.
  EXPECT_EQ(verdicts[7].state, EffectState::kLearned);
  EXPECT_EQ(verdicts[0].state, EffectState::kConstant);
  EffectSwitches switches;
  switches.unused = false;
  for (const size_t i : {1, 2, 3, 9, 10})
    EXPECT_EQ(JudgeChannels(facts, switches)[i].state, EffectState::kLearned);
}

TEST(EffectSwitch, KnowsEveryNameAndNoOther) {
  for (const char* name : EffectNames()) {
    EffectSwitches switches;
    bool* value = EffectSwitch(&switches, name);
    ASSERT_NE(value, nullptr) << name;
    *value = false;
    EXPECT_NE(switches, EffectSwitches()) << name;
  }
  EffectSwitches switches;
  EXPECT_EQ(EffectSwitch(&switches, "layers"), nullptr);
}

TEST(LodRangeOf, CoversWhatTheDensityCallsFor) {
  // 1024 texels on 2 m are 512 texels a metre.
  EXPECT_EQ(LodRangeOf({2, 512, 512}, 1024, 1024, 11), (std::array<int, 2>{0, 0}));
  EXPECT_EQ(LodRangeOf({2, 64, 256}, 1024, 512, 11), (std::array<int, 2>{1, 3}));
  // Between two mips both are needed.
  EXPECT_EQ(LodRangeOf({2, 60, 200}, 1024, 1024, 11), (std::array<int, 2>{1, 4}));
  // Nearer than the texels, farther than the last mip.
  EXPECT_EQ(LodRangeOf({2, 1e-6, 1e9}, 1024, 1024, 11), (std::array<int, 2>{0, 10}));
  EXPECT_EQ(LodRangeOf({1e6, 1e8, 1e9}, 1, 1, 1), (std::array<int, 2>{0, 0}));
}

}  // namespace
}  // namespace patina
