#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <vector>

#include "pipeline/base/rng.h"
#include "pipeline/kernels/dispatch.h"
#include "tests/pipeline/bc6/block_samples.h"

namespace patina::bc6 {
namespace {

struct Outcome {
  SoftBlock fit;
  EncodedBlock encoded, refined;
};

// Samples, every third with something extreme in it.
std::vector<BlockSample> MixedSamples() {
  std::vector<BlockSample> samples;
  for (uint64_t seed = 0; seed < 240; ++seed) {
    BlockSample sample = MakeBlockSample(1000 + seed);
    Rng rng(seed, 5);
    const int c = static_cast<int>(rng.Below(3)), t = static_cast<int>(rng.Below(16));
    switch (seed % 12) {
      case 0:
        sample.target.value[c][t] = std::numeric_limits<float>::quiet_NaN();
        break;
      case 3:
        sample.target.value[c][t] = 0.0f;
        break;
      case 6:
        sample.target.hessian[0][t] = 1e9f;
        break;
      case 9:
        for (auto& row : sample.target.hessian) row[t] = 0;
        sample.target.value[c][t] = 60000.0f;
        break;
      default:
        break;
    }
    samples.push_back(sample);
  }
  return samples;
}

std::vector<Outcome> RunAll(const std::vector<BlockSample>& samples) {
  std::vector<Outcome> outcomes;
  for (const BlockSample& sample : samples) {
    Outcome outcome;
    outcome.fit = FitTexels(sample.texels);
    outcome.encoded = Encode(sample.target, outcome.fit);
    outcome.refined = Refine(sample.target, outcome.encoded.fields);
    outcomes.push_back(outcome);
  }
  return outcomes;
}

bool SameBits(const SoftBlock& a, const SoftBlock& b) {
  return a.partition == b.partition &&
         std::memcmp(a.endpoint, b.endpoint, sizeof a.endpoint) == 0 &&
         std::memcmp(a.index, b.index, sizeof a.index) == 0;
}

bool SameBits(const EncodedBlock& a, const EncodedBlock& b) {
  return a.bytes == b.bytes && SameBits(a.soft, b.soft) &&
         std::memcmp(&a.error, &b.error, sizeof a.error) == 0;
}

class SimdTargets : public testing::Test {
 protected:
  void TearDown() override { ASSERT_TRUE(ForceSimdTarget("auto").has_value()); }
};

TEST_F(SimdTargets, GiveTheSameBits) {
  if (!SimdTargetSupported(SimdTarget::kAvx512))
    GTEST_SKIP() << "this CPU has no AVX-512 to compare with";
  const std::vector<BlockSample> samples = MixedSamples();
  ASSERT_TRUE(ForceSimdTarget("avx2").has_value());
  const std::vector<Outcome> narrow = RunAll(samples);
  ASSERT_TRUE(ForceSimdTarget("avx512").has_value());
  const std::vector<Outcome> wide = RunAll(samples);
  for (size_t n = 0; n < samples.size(); ++n) {
    EXPECT_TRUE(SameBits(narrow[n].fit, wide[n].fit)) << n;
    EXPECT_TRUE(SameBits(narrow[n].encoded, wide[n].encoded)) << n;
    EXPECT_TRUE(SameBits(narrow[n].refined, wide[n].refined)) << n;
  }
}

TEST_F(SimdTargets, DoNotRememberEarlierBlocks) {
  std::vector<BlockSample> samples = MixedSamples();
  samples.resize(60);
  const std::vector<Outcome> forward = RunAll(samples);
  for (size_t n = samples.size(); n-- > 0;) {
    const std::vector<Outcome> alone = RunAll({samples[n]});
    EXPECT_TRUE(SameBits(alone[0].encoded, forward[n].encoded)) << n;
    EXPECT_TRUE(SameBits(alone[0].refined, forward[n].refined)) << n;
  }
}

}  // namespace
}  // namespace patina::bc6
