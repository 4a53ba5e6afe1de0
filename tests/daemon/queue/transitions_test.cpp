// Every pair of states, by the table and through the store.
#include <set>

#include "daemon/queue/job_state.h"
#include "tests/daemon/queue/queue_support.h"

namespace patina::daemon {
namespace {

using State = JobState;
using test::QueueTest;

const std::set<std::pair<State, State>>& Legal() {
  static const std::set<std::pair<State, State>> legal{
      {State::kQueued, State::kRunning},      {State::kQueued, State::kCancelled},
      {State::kRunning, State::kSucceeded},   {State::kRunning, State::kFailed},
      {State::kRunning, State::kCancelled},   {State::kRunning, State::kRetryWaiting},
      {State::kRunning, State::kBuried},      {State::kRunning, State::kQueued},
      {State::kRetryWaiting, State::kQueued}, {State::kRetryWaiting, State::kCancelled},
      {State::kFailed, State::kQueued},       {State::kCancelled, State::kQueued},
      {State::kBuried, State::kQueued}};
  return legal;
}

TEST(Transitions, AreThoseOfTheTableAndNoOthers) {
  for (const State from : kJobStates) {
    for (const State to : kJobStates) {
      EXPECT_EQ(IsLegalTransition(from, to), Legal().count({from, to}) != 0)
          << JobStateName(from) << " -> " << JobStateName(to);
    }
  }
}

TEST(Transitions, NamesAreReadBack) {
  std::set<std::string> names;
  for (const State state : kJobStates) {
    EXPECT_EQ(ParseJobState(JobStateName(state)), state);
    names.insert(JobStateName(state));
  }
  EXPECT_EQ(names.size(), kJobStates.size());
  EXPECT_EQ(ParseJobState("done"), std::nullopt);
}

// A call of the store that asks for a transition, for the jobs of all states.
class StoreTransitions : public QueueTest {
 protected:
  template <class Call>
  void ExpectAllowedOnlyFrom(const std::set<State>& allowed, State to, Call call) {
    for (const State from : kJobStates) {
      const int64_t id = AddIn(from);
      ASSERT_EQ(StateOf(id), from);
      const auto range = store_->EventRange();
      ASSERT_OK(range);
      const bool done = call(id);
      EXPECT_EQ(done, allowed.count(from) != 0) << JobStateName(from);
      EXPECT_EQ(StateOf(id), done ? to : from) << JobStateName(from);
      const auto after = store_->EventRange();
      ASSERT_OK(after);
      // What is refused leaves no trace.
      if (!done) {
        EXPECT_EQ(after->second, range->second) << JobStateName(from);
      }
    }
  }
};

TEST_F(StoreTransitions, StartTakesQueuedJobsOnly) {
  ExpectAllowedOnlyFrom({State::kQueued}, State::kRunning, [&](int64_t id) {
    return store_->Start(id, "", now_ + 1000, now_).has_value();
  });
}

TEST_F(StoreTransitions, FinishTakesRunningJobsOnly) {
  for (const State to : {State::kSucceeded, State::kFailed, State::kCancelled, State::kRetryWaiting,
                         State::kBuried, State::kQueued}) {
    ExpectAllowedOnlyFrom({State::kRunning}, to, [&](int64_t id) {
      const auto job = store_->Get(id);
      return job && End({id, job->attempt}, to).has_value();
    });
  }
}

TEST_F(StoreTransitions, FinishDoesNotEndInRunning) {
  const int64_t id = AddIn(State::kRunning);
  EXPECT_EQ(End({id, 1}, State::kRunning).error().code, ErrorCode::kConflict);
}

TEST_F(StoreTransitions, RetryTakesWhatHasEndedWithoutSuccessOrWaits) {
  ExpectAllowedOnlyFrom({State::kFailed, State::kCancelled, State::kBuried, State::kRetryWaiting},
                        State::kQueued,
                        [&](int64_t id) { return store_->Retry(id, now_).has_value(); });
}

TEST_F(StoreTransitions, CancelTakesWhatWaits) {
  for (const State from : kJobStates) {
    const int64_t id = AddIn(from);
    const auto state = store_->Cancel(id, now_);
    if (from == State::kQueued || from == State::kRetryWaiting) {
      ASSERT_OK(state);
      EXPECT_EQ(*state, State::kCancelled);
      EXPECT_EQ(StateOf(id), State::kCancelled);
    } else if (from == State::kRunning) {
      ASSERT_OK(state);
      EXPECT_EQ(*state, State::kRunning);
      EXPECT_TRUE(store_->Get(id)->cancel_requested);
    } else {
      EXPECT_EQ(state.error().code, ErrorCode::kConflict) << JobStateName(from);
      EXPECT_EQ(StateOf(id), from);
    }
  }
}

TEST_F(StoreTransitions, OnlyWaitingJobsArePaused) {
  for (const State from : kJobStates) {
    const bool waits = from == State::kQueued || from == State::kRetryWaiting;
    EXPECT_EQ(store_->SetHeld(AddIn(from), true, now_).has_value(), waits) << JobStateName(from);
  }
}

}  // namespace
}  // namespace patina::daemon
