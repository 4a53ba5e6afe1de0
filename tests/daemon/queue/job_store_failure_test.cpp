// The N-th write, sync, truncation or creation of the queue's files fails, for every N.
#include "tests/daemon/queue/failing_vfs.h"
#include "tests/daemon/queue/queue_support.h"

namespace patina::daemon {
namespace {

using test::SampleJob;

// What a life in the queue acknowledged.
struct Acknowledged {
  std::vector<int64_t> submitted;
  std::optional<JobState> state;  // of the first, as last acknowledged
  bool failed = false;            // some call reported an error
};

template <class T>
bool Good(const Result<T>& result, Acknowledged* seen) {
  if (result) return true;
  seen->failed = true;
  EXPECT_TRUE(result.error().code == ErrorCode::kIo ||
              result.error().code == ErrorCode::kResourceExhausted)
      << result.error().message;
  EXPECT_FALSE(result.error().message.empty());
  return false;
}

Acknowledged Live(const std::string& path) {
  Acknowledged seen;
  auto store = JobStore::Open(path);
  if (!Good(store, &seen)) return seen;
  for (int i = 0; i < 4; ++i) {
    const auto submitted = (*store)->Submit(SampleJob("a" + std::to_string(i)), 1);
    if (Good(submitted, &seen)) seen.submitted.push_back(submitted->id);
  }
  if (seen.submitted.empty()) return seen;
  const int64_t id = seen.submitted[0];
  seen.state = JobState::kQueued;
  const auto started = (*store)->Start(id, "", 10, 2);
  if (!Good(started, &seen)) return seen;
  seen.state = JobState::kRunning;
  const AttemptKey key{id, started->attempt};
  (void)Good((*store)->SetHandle(key, "h"), &seen);
  (void)Good((*store)->Heartbeat({key}, 20), &seen);
  AttemptEnd end;
  end.state = JobState::kFailed;
  if (Good((*store)->Finish(key, end, 3), &seen)) seen.state = JobState::kFailed;
  return seen;
}

class JobStoreFailure : public testing::TestWithParam<bool> {
 protected:
  void TearDown() override { test::UseRealVfs(); }
};

TEST_P(JobStoreFailure, LosesNothingThatWasAcknowledged) {
  int failing = 0;
  for (int fail_at = 0;; ++fail_at) {
    const patina::test::TemporaryDirectory folder;
    test::UseFailingVfs(fail_at, GetParam());
    const Acknowledged seen = Live(folder / "q");
    const bool reached = test::VfsCalls() > fail_at;
    test::UseFailingVfs(-1, false);
    auto store = JobStore::Open(folder / "q");
    SCOPED_TRACE(fail_at);
    ASSERT_OK(store);
    for (const int64_t id : seen.submitted) EXPECT_TRUE((*store)->Get(id)) << fail_at;
    if (seen.state) {
      const JobState state = (*store)->Get(seen.submitted[0])->state;
      // A commit whose sync failed may be there all the same; it is never behind.
      EXPECT_TRUE(state == *seen.state || (seen.failed && IsLegalTransition(*seen.state, state)))
          << fail_at << ": " << JobStateName(*seen.state) << " " << JobStateName(state);
    }
    ASSERT_OK((*store)->Submit(SampleJob("after"), 9));
    failing += seen.failed ? 1 : 0;
    if (!reached) break;
  }
  EXPECT_GT(failing, 10);
}

TEST_P(JobStoreFailure, GoesOnOnceThereIsSpaceAgain) {
  const patina::test::TemporaryDirectory folder;
  test::UseFailingVfs(-1, false);
  auto store = JobStore::Open(folder / "q");
  ASSERT_OK(store);
  ASSERT_OK((*store)->Submit(SampleJob("a"), 1));
  test::UseFailingVfs(0, true);
  const auto refused = (*store)->Submit(SampleJob("b"), 2);
  ASSERT_FALSE(refused);
  test::MendVfs();
  ASSERT_OK((*store)->Submit(SampleJob("c"), 3));
  const auto page = (*store)->List({});
  ASSERT_OK(page);
  EXPECT_EQ(page->jobs.size(), 2u);
}

INSTANTIATE_TEST_SUITE_P(OneOrAll, JobStoreFailure, testing::Bool());

}  // namespace
}  // namespace patina::daemon
