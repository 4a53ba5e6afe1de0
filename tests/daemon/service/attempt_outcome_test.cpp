#include "daemon/service/attempt_outcome.h"

#include <gtest/gtest.h>

#include <csignal>

namespace patina::daemon {
namespace {

constexpr int64_t kNow = 5000;

class Outcome : public testing::Test {
 protected:
  AttemptOutcome Decide(StopReason stop = StopReason::kNone) {
    return DecideOutcome(job_, report_, stop, policy_, kNow, 0,
                         [this](const std::string&) { return exists_; });
  }
  void Result(int exit_code, const std::string& code) {
    report_.exit_code = exit_code;
    report_.result_json = R"({"exit_code": )" + std::to_string(exit_code) +
                          R"(, "error": {"code": ")" + code + R"(", "message": "why"}})";
  }

  JobRecord job_;
  AttemptReport report_;
  OutcomePolicy policy_{{1000, 60000, 0}, 3, 0};
  bool exists_ = true;
};

TEST_F(Outcome, ErrorsThatComeAgainFail) {
  for (const auto& [exit_code, code] :
       std::vector<std::pair<int, std::string>>{{3, "corrupt_data"},
                                                {3, "not_found"},
                                                {3, "io"},
                                                {3, "conflict"},
                                                {4, "quality_gate"},
                                                {1, "internal"},
                                                {1, "unsupported"},
                                                {1, "something new"}}) {
    Result(exit_code, code);
    const AttemptEnd end = Decide().end;
    EXPECT_EQ(end.state, JobState::kFailed) << code;
    EXPECT_EQ(end.error_code, code);
    EXPECT_EQ(end.error_message, "why");
  }
}

TEST_F(Outcome, FailuresOfTheMachineAreTriedAgain) {
  for (const char* code : {"resource_exhausted", "io", "timeout", "conflict", "cancelled"}) {
    Result(1, code);
    const AttemptEnd end = Decide().end;
    EXPECT_EQ(end.state, JobState::kRetryWaiting) << code;
    EXPECT_EQ(end.due_ms, kNow + 1000);
  }
  Result(130, "cancelled");
  EXPECT_EQ(Decide().end.state, JobState::kRetryWaiting);
}

TEST_F(Outcome, WhatAFarmLosesIsTriedAgain) {
  job_.limits.memory_mb = 100;
  for (const auto& [cause, code] :
       std::vector<std::pair<EndCause, std::string>>{{EndCause::kNodeFailed, "node_failed"},
                                                     {EndCause::kOutOfMemory, "out_of_memory"},
                                                     {EndCause::kTimeLimit, "timeout"},
                                                     {EndCause::kPreempted, "preempted"},
                                                     {EndCause::kAskedToEnd, "interrupted"},
                                                     {EndCause::kCancelled, "killed"},
                                                     {EndCause::kRefused, "refused"}}) {
    report_ = {};
    report_.cause = cause;
    report_.detail = "job 5 on n1";
    // Whether or not it could still say that it was interrupted.
    for (const bool interrupted : {false, true}) {
      if (interrupted) Result(130, "cancelled");
      const AttemptEnd end = Decide().end;
      EXPECT_EQ(end.state, JobState::kRetryWaiting) << code;
      EXPECT_EQ(end.error_code, code);
      EXPECT_NE(end.error_message.find("(job 5 on n1)"), std::string::npos);
      EXPECT_EQ(end.memory_mb, cause == EndCause::kOutOfMemory ? 200 : 0);
    }
    // Its own word counts for more.
    Result(3, "corrupt_data");
    EXPECT_EQ(Decide().end.state, JobState::kFailed);
    report_.result_json = R"({"exit_code": 0, "revision": "r0001"})";
    EXPECT_EQ(Decide().end.state, JobState::kSucceeded);
  }
}

TEST_F(Outcome, WithoutAResultTheProcessDecides) {
  report_.signal = SIGSEGV;
  EXPECT_EQ(Decide().end.state, JobState::kRetryWaiting);
  EXPECT_EQ(Decide().end.error_code, "killed");
  EXPECT_NE(Decide().end.error_message.find("SIGSEGV"), std::string::npos);
  report_.signal = SIGXCPU;
  EXPECT_EQ(Decide().end.state, JobState::kFailed);
  report_.signal = 0;
  for (const int exit_code : {0, 1, 127, -1}) {
    report_.exit_code = exit_code;
    EXPECT_EQ(Decide().end.error_code, "lost") << exit_code;
    EXPECT_EQ(Decide().end.state, JobState::kRetryWaiting) << exit_code;
  }
  report_.exit_code = 2;
  EXPECT_EQ(Decide().end.state, JobState::kFailed);
}

TEST_F(Outcome, ResultsThatCannotBeReadAreNone) {
  report_.signal = SIGKILL;
  for (const char* text : {"", "{", "[]", "{}", "null", R"({"exit_code": "0"})",
                           R"({"exit_code": 3})", R"({"exit_code": 3, "error": []})"}) {
    report_.result_json = text;
    EXPECT_EQ(Decide().end.error_code, "killed") << text;
    EXPECT_EQ(Decide().end.result_json, "") << text;
  }
  report_.result_json = std::string(100000, '[');
  EXPECT_EQ(Decide().end.error_code, "killed");
}

TEST_F(Outcome, ASuccessNeedsItsRevision) {
  for (const char* revision : {"r0001", "../../etc", "", "a/b", ".."}) {
    report_.result_json = std::string(R"({"exit_code": 0, "revision": ")") + revision + "\"}";
    exists_ = true;
    const bool plain = std::string(revision) == "r0001";
    EXPECT_EQ(Decide().end.state, plain ? JobState::kSucceeded : JobState::kRetryWaiting)
        << revision;
    exists_ = false;
    EXPECT_EQ(Decide().end.state, JobState::kRetryWaiting);
  }
}

TEST_F(Outcome, WhoAskedForTheEndIsHeardUnlessItSucceeded) {
  report_.result_json = R"({"exit_code": 0, "revision": "r0001", "stopped_by": "unchanged"})";
  for (const StopReason stop :
       {StopReason::kCancel, StopReason::kHandBack, StopReason::kWallTime}) {
    EXPECT_EQ(Decide(stop).end.state, JobState::kSucceeded);
    EXPECT_TRUE(Decide(stop).unchanged);
  }
  Result(3, "corrupt_data");
  EXPECT_EQ(Decide(StopReason::kCancel).end.state, JobState::kCancelled);
  EXPECT_EQ(Decide(StopReason::kHandBack).end.state, JobState::kQueued);
  EXPECT_EQ(Decide(StopReason::kWallTime).end.error_code, "timeout");
}

TEST_F(Outcome, IsBuriedAtTheLastFailure) {
  report_.signal = SIGKILL;
  job_.failures = 1;
  EXPECT_EQ(Decide().end.state, JobState::kRetryWaiting);
  EXPECT_EQ(Decide().end.due_ms, kNow + 2000);
  job_.failures = 2;
  EXPECT_EQ(Decide().end.state, JobState::kBuried);
}

TEST_F(Outcome, GetsMoreMemoryAfterItRanOut) {
  report_.signal = SIGKILL;
  EXPECT_EQ(Decide().end.memory_mb, 0);  // it had no limit
  job_.limits.memory_mb = 100;
  EXPECT_EQ(Decide().end.memory_mb, 200);
  policy_.max_memory_mb = 150;
  EXPECT_EQ(Decide().end.memory_mb, 150);
  policy_.max_memory_mb = 50;
  EXPECT_EQ(Decide().end.memory_mb, 100);
  report_.signal = SIGSEGV;
  EXPECT_EQ(Decide().end.memory_mb, 0);
  policy_.max_memory_mb = 0;
  Result(1, "resource_exhausted");
  EXPECT_EQ(Decide().end.memory_mb, 200);
}

}  // namespace
}  // namespace patina::daemon
