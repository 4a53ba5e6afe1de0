#include "pipeline/brdf/grid_trainer.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <vector>

namespace patina::brdf {
namespace {

constexpr int kCorners = 24;

class GridTrainerTest : public testing::Test {
 protected:
  GridTrainerTest()
      : layout_(16, 3, 16, 2),
        pool_(2),
        trainer_(layout_, kCorners, KernelsFor(*ActiveSimdTarget()), pool_, 1),
        samples_(300) {
    Rng rng(2);
    for (size_t s = 0; s < samples_.size(); ++s) {
      PoolSample& sample = samples_[s];
      for (int c = 0; c < 8; ++c) {
        sample.corner[c] =
            static_cast<int32_t>(rng.Below(kCorners / 2)) + (c < 4 ? 0 : kCorners / 2);
        sample.weight[c] = 0.25f;
      }
      for (float& v : sample.value) v = 1 + rng.Uniform();
      sample.cosine = 0.5f;
      sample.importance = 1;
    }
  }

  std::vector<float> Everything() {
    std::vector<float> all(trainer_.features().data(),
                           trainer_.features().data() + trainer_.features().size());
    all.insert(all.end(), trainer_.parameters().data(),
               trainer_.parameters().data() + trainer_.parameters().size());
    all.insert(all.end(), trainer_.codebook().data(),
               trainer_.codebook().data() + trainer_.codebook().size());
    return all;
  }
  bool Step() {
    return trainer_.Step(samples_.data(), static_cast<int>(samples_.size()), {0.01f, 0.01f});
  }

  NetworkLayout layout_;
  ThreadPool pool_;
  GridTrainer trainer_;
  AlignedBuffer<PoolSample> samples_;
};

TEST_F(GridTrainerTest, LeavesOutAStepThatIsNotFiniteAndGoesOn) {
  for (const bool with_codebook : {false, true}) {
    if (with_codebook) {
      std::vector<int32_t> index(kCorners);
      for (int c = 0; c < kCorners; ++c) index[c] = c % 4;
      trainer_.UseCodebook(std::vector<float>(4 * 16, 0.1f), index);
    }
    ASSERT_TRUE(Step());
    const auto before = Everything();
    const PoolSample good = samples_[200];
    samples_[200].value[1] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_FALSE(Step());
    samples_[200] = good;
    samples_[200].importance = 3e38f;  // overflows the gradient
    EXPECT_FALSE(Step());
    samples_[200] = good;
    const auto after = Everything();
    EXPECT_EQ(0, std::memcmp(before.data(), after.data(), before.size() * sizeof(float)));
    EXPECT_TRUE(Step());
    for (const float v : Everything()) ASSERT_TRUE(v - v == 0.0f);
  }
}

TEST_F(GridTrainerTest, MovesOnlyTheCornersThatSamplesTouch) {
  for (size_t s = 0; s < samples_.size(); ++s) {
    for (int c = 0; c < 8; ++c) {
      if (samples_[s].corner[c] == 5) samples_[s].corner[c] = 6;
    }
  }
  const auto before = Everything();
  ASSERT_TRUE(Step());
  const auto after = Everything();
  for (int corner = 0; corner < kCorners; ++corner) {
    const bool same = std::memcmp(before.data() + 16 * corner, after.data() + 16 * corner, 64) == 0;
    EXPECT_EQ(same, corner == 5) << corner;
  }
}

}  // namespace
}  // namespace patina::brdf
