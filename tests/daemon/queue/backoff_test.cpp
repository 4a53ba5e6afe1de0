#include "daemon/queue/backoff.h"

#include <gtest/gtest.h>

namespace patina::daemon {
namespace {

constexpr BackoffPolicy kPolicy{1000, 60000, 0.5};

TEST(Backoff, DoublesUpToItsLimit) {
  // Random bits of zero take nothing off.
  EXPECT_EQ(BackoffMs(kPolicy, 1, 0), 1000);
  EXPECT_EQ(BackoffMs(kPolicy, 2, 0), 2000);
  EXPECT_EQ(BackoffMs(kPolicy, 6, 0), 32000);
  EXPECT_EQ(BackoffMs(kPolicy, 7, 0), 60000);
  EXPECT_EQ(BackoffMs(kPolicy, 1000000, 0), 60000);
}

TEST(Backoff, StaysWithinItsJitter) {
  uint64_t random = 1;
  bool differs = false;
  for (int i = 0; i < 1000; ++i) {
    random = random * 6364136223846793005u + 1442695040888963407u;
    const int64_t wait = BackoffMs(kPolicy, 3, random);
    EXPECT_GE(wait, 2000);
    EXPECT_LE(wait, 4000);
    differs = differs || wait != BackoffMs(kPolicy, 3, 0);
  }
  EXPECT_TRUE(differs);
}

TEST(Backoff, TakesABaseAboveItsLimit) {
  EXPECT_EQ(BackoffMs({5000, 100, 0}, 1, 7), 100);
  EXPECT_EQ(BackoffMs({5000, 100, 0}, 9, 7), 100);
}

TEST(Backoff, DoesNotOverflow) {
  const BackoffPolicy huge{INT64_MAX / 2, INT64_MAX, 0};
  EXPECT_GT(BackoffMs(huge, 100, 0), 0);
}

}  // namespace
}  // namespace patina::daemon
