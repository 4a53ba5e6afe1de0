// A queue in a folder of its own, and jobs to put into it.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "daemon/queue/job_store.h"
#include "tests/formats/test_support.h"

namespace patina::daemon::test {

inline NewJob SampleJob(const std::string& asset) {
  NewJob job;
  job.asset = asset;
  job.kind = "material";
  job.out = "/out";
  job.source = "/in/" + asset;
  job.job_json = "{\"asset\": \"" + asset + "\"}";
  return job;
}

class QueueTest : public testing::Test {
 protected:
  void SetUp() override { Reopen(); }

  void Reopen() {
    store_.reset();
    auto store = JobStore::Open(folder_ / "queue.db");
    ASSERT_OK(store);
    store_ = std::move(*store);
  }

  int64_t Add(const NewJob& job) {
    auto submitted = store_->Submit(job, now_);
    EXPECT_TRUE(submitted) << patina::test::MessageOf(submitted);
    return submitted ? submitted->id : 0;
  }
  int64_t Add(const std::string& asset) { return Add(SampleJob(asset)); }

  // Starts the next attempt.
  AttemptKey Run(int64_t id) {
    auto job = store_->Start(id, "r0001", now_ + 1000, now_);
    EXPECT_TRUE(job) << patina::test::MessageOf(job);
    return {id, job ? job->attempt : 0};
  }

  Status End(const AttemptKey& key, JobState state) {
    AttemptEnd end;
    end.state = state;
    end.due_ms = now_ + 100;
    return store_->Finish(key, end, now_);
  }

  JobState StateOf(int64_t id) {
    auto job = store_->Get(id);
    EXPECT_TRUE(job) << patina::test::MessageOf(job);
    return job ? job->state : JobState::kQueued;
  }

  // A job in a state.
  int64_t AddIn(JobState state) {
    const int64_t id = Add("asset_" + std::to_string(++assets_));
    if (state == JobState::kQueued) return id;
    if (state == JobState::kCancelled) {
      EXPECT_TRUE(store_->Cancel(id, now_));
      return id;
    }
    const AttemptKey key = Run(id);
    if (state != JobState::kRunning) {
      EXPECT_TRUE(End(key, state));
    }
    return id;
  }

  patina::test::TemporaryDirectory folder_;
  std::unique_ptr<JobStore> store_;
  int64_t now_ = 1000000;
  int assets_ = 0;
};

}  // namespace patina::daemon::test
