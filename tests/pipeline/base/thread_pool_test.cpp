#include "pipeline/base/thread_pool.h"

#include <gtest/gtest.h>
#include <xmmintrin.h>

#include <atomic>
#include <numeric>
#include <set>
#include <vector>

namespace patina {
namespace {

TEST(ThreadPool, CallsEachIndexOnce) {
  for (int threads = 1; threads <= 4; ++threads) {
    ThreadPool pool(threads);
    EXPECT_EQ(pool.threads(), threads);
    for (const int count : {0, 1, 2, 3, 100, 10000}) {
      std::vector<std::atomic<int>> calls(static_cast<size_t>(count));
      pool.ParallelFor(count, [&](int index, int) { calls[index].fetch_add(1); });
      for (const auto& n : calls)
        ASSERT_EQ(n.load(), 1) << threads << " threads, " << count << " items";
    }
  }
}

TEST(ThreadPool, TakesNegativeCountsAsNone) {
  ThreadPool pool(2);
  bool called = false;
  pool.ParallelFor(-3, [&](int, int) { called = true; });
  EXPECT_FALSE(called);
}

TEST(ThreadPool, ZeroThreadsMeansOneForEachCpu) {
  ThreadPool pool(0);
  EXPECT_GE(pool.threads(), 1);
}

TEST(ThreadPool, NumbersWorkersBelowTheirCount) {
  ThreadPool pool(3);
  std::atomic<bool> outside{false};
  pool.ParallelFor(5000, [&](int, int worker) {
    if (worker < 0 || worker >= 3) outside = true;
  });
  EXPECT_FALSE(outside);
}

TEST(ThreadPool, NeverRunsOneWorkerTwiceAtATime) {
  ThreadPool pool(4);
  std::vector<std::atomic<int>> inside(4);
  std::atomic<bool> overlap{false};
  pool.ParallelFor(20000, [&](int, int worker) {
    if (inside[worker].fetch_add(1) != 0) overlap = true;
    inside[worker].fetch_sub(1);
  });
  EXPECT_FALSE(overlap);
}

TEST(ThreadPool, SeesWritesOfTheCallerAndShowsThoseOfTheWorkers) {
  ThreadPool pool(3);
  std::vector<int> in(1000), out(1000);
  for (int round = 1; round <= 200; ++round) {
    std::iota(in.begin(), in.end(), round);
    pool.ParallelFor(1000, [&](int index, int) { out[index] = 2 * in[index]; });
    for (int i = 0; i < 1000; ++i) ASSERT_EQ(out[i], 2 * (i + round));
  }
}

// Short loops in a row: a worker that wakes late must not take part in the next loop with the last
// one's body.
TEST(ThreadPool, SurvivesManyShortLoops) {
  ThreadPool pool(4);
  for (int round = 0; round < 3000; ++round) {
    std::atomic<int> calls{0};
    pool.ParallelFor(1 + round % 5, [&](int, int) { calls.fetch_add(1); });
    ASSERT_EQ(calls.load(), 1 + round % 5);
  }
}

TEST(ThreadPool, FlushesDenormalsOnEveryWorkerAndRestoresTheCaller) {
  const unsigned before = _mm_getcsr();
  ThreadPool pool(3);
  std::atomic<int> kept{0};
  pool.ParallelFor(3000, [&](int, int) {
    volatile float tiny = 1e-30f;
    volatile float product = tiny * 1e-12f;
    if (product != 0.0f) kept.fetch_add(1);
  });
  EXPECT_EQ(kept.load(), 0);
  // The sticky exception flags (low six bits) are the caller's own business.
  EXPECT_EQ(_mm_getcsr() & ~0x3Fu, before & ~0x3Fu);
}

TEST(ThreadPool, JoinsItsWorkersWithoutEverHavingRun) {
  for (int i = 0; i < 50; ++i) ThreadPool pool(4);
}

}  // namespace
}  // namespace patina
