#include "pipeline/jobs/profile_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace patina {
namespace {

using testing::HasSubstr;

const std::vector<ProfileSizes> kSizes = {{Profile::kBcf05k, 100},
                                          {Profile::kBcf1k, 400},
                                          {Profile::kBcf2k, 1600},
                                          {Profile::kBcf2kPlus, 2500}};

TEST(ProfileChoice, TakesTheLargestThatFits) {
  const ManifestChoice choice = ChooseProfile({0, 1600}, kSizes, false);
  EXPECT_EQ(choice.chosen, "bcf-2k");
  EXPECT_TRUE(choice.in_reach);
  EXPECT_THAT(choice.reason, HasSubstr("1600 of 1600 bytes"));
  EXPECT_EQ(ChooseProfile({0, 1599}, kSizes, false).chosen, "bcf-1k");
}

TEST(ProfileChoice, SaysWhatItTakesWhenNothingFits) {
  const ManifestChoice choice = ChooseProfile({30, 99}, kSizes, true);
  EXPECT_EQ(choice.chosen, "bcf-0.5k");
  EXPECT_FALSE(choice.in_reach);
  EXPECT_THAT(choice.reason, HasSubstr("has 100 bytes, and at most 99 are asked for; needed: "));
}

TEST(ProfileChoice, TriesFromTheSmallestToTheLargestThatFits) {
  ManifestChoice choice = ChooseProfile({30, 1600}, kSizes, true);
  EXPECT_EQ(choice.chosen, "bcf-0.5k");
  ASSERT_TRUE(ChooseNextProfile(22.5, true, &choice));
  EXPECT_EQ(choice.chosen, "bcf-1k");
  EXPECT_THAT(choice.reason,
              HasSubstr("bcf-0.5k was given up on the way at 22.50 dB of the 30.00"));
  ASSERT_TRUE(ChooseNextProfile(29.9, false, &choice));
  EXPECT_EQ(choice.chosen, "bcf-2k");
  EXPECT_THAT(choice.reason, HasSubstr("bcf-1k reached 29.90 dB"));
  const std::string reason = choice.reason;
  EXPECT_FALSE(ChooseNextProfile(29.95, false, &choice));  // the next does not fit
  EXPECT_EQ(choice.chosen, "bcf-2k");
  EXPECT_EQ(choice.reason, reason);
  EXPECT_EQ(choice.candidates[0].reached_db, 22.5);
  EXPECT_TRUE(choice.candidates[0].given_up);
  EXPECT_FALSE(choice.candidates[1].given_up);
  EXPECT_FALSE(choice.candidates[2].reached_db);
}

TEST(ProfileChoice, StartsAtTheLargestWhenTimeIsShort) {
  const ManifestChoice choice = ChooseProfile({30, 0}, kSizes, false);
  EXPECT_EQ(choice.chosen, "bcf-2k++");
  EXPECT_THAT(choice.reason, HasSubstr("time budget"));
}

TEST(ProfileChoice, TheStricterOfTwoLimitsCounts) {
  Job job;
  job.size_budget_bytes = 5000;
  job.target_bpp = 2;
  EXPECT_EQ(AimsOfJob(job, 100, 100).most_bytes, 2500u);
  job.target_bpp = 8;
  EXPECT_EQ(AimsOfJob(job, 100, 100).most_bytes, 5000u);
  job.target_bpp = 1e-9;  // less than a byte is not "no limit"
  EXPECT_EQ(AimsOfJob(job, 100, 100).most_bytes, 1u);
}

TEST(ProfileChoice, LeavesOutLevelsThatNoMipReads) {
  const ModelShape all = ShapeOfMips(Profile::kBcf1k, 64, 64, 7);
  const ModelShape fine = ShapeOfMips(Profile::kBcf1k, 64, 64, 2);
  EXPECT_EQ(all[0].levels, 6);
  EXPECT_EQ(fine[0].levels, 1);
  EXPECT_EQ(fine[3].levels, 1);
  // One 32x32, 16x16, 8x8 and 4x4 level in blocks of 16 bytes, and what the network takes.
  EXPECT_EQ(MaterialBytes(fine, 3) - MaterialBytes(fine, 2), 64u);
  EXPECT_EQ(MaterialBytes(all, 3) - MaterialBytes(fine, 3),
            16u * (16 + 4 + 1 + 1 + 1 + 4 + 1 + 1 + 1 + 1 + 1 + 1 + 1 + 1));
}

}  // namespace
}  // namespace patina
