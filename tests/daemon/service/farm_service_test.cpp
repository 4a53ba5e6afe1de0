// What is different in the service when jobs run on a farm.
#include <thread>

#include "tests/daemon/service/service_support.h"

namespace patina::daemon {
namespace {

class ServiceOnFarm : public test::ServiceTest {
 protected:
  void SetUp() override {
    config_.executor.kind = ExecutorKind::kSlurm;
    config_.executor.jobs = 3;
    config_.executor.shared_dir = folder_ / "shared";
    std::filesystem::create_directories(folder_ / "shared/jobs");
    test::ServiceTest::SetUp();
    config_.cores = 8;
    config_.limits.threads = 0;
    config_.limits.wall_s = 100;
    Restart();
  }
};

TEST_F(ServiceOnFarm, CountsJobsAndNotCores) {
  std::vector<int64_t> jobs;
  for (int i = 0; i < 5; ++i) jobs.push_back(Submit("asset" + std::to_string(i)));
  service_->Step();
  EXPECT_EQ(executor_.running.size(), 3u);
  for (const auto& [id, running] : executor_.running) {
    EXPECT_EQ(running.spec.threads, 8);
    EXPECT_EQ(running.spec.wall_s, 100);
    EXPECT_EQ(running.spec.folder.rfind(folder_ / "shared/jobs/", 0), 0u) << running.spec.folder;
  }
  EXPECT_EQ(service_->Get(jobs[4])->waiting_reason,
            "waits for a place on the farm: 3 of 3 jobs are there");
  const auto status = service_->GetStatus();
  ASSERT_OK(status);
  EXPECT_EQ(status->executor, "slurm");
  EXPECT_EQ(status->cores, 3);
  EXPECT_EQ(status->cores_used, 3);
  Succeed(jobs[0], "asset0");
  service_->Step();
  EXPECT_EQ(StateOf(jobs[3]), JobState::kRunning);
}

TEST_F(ServiceOnFarm, StartsManyJobsInSteps) {
  config_.executor.jobs = 1000;
  Restart();
  for (int i = 0; i < 150; ++i) Submit("asset" + std::to_string(i));
  EXPECT_EQ(service_->Step(), 0) << "there is more to start";
  EXPECT_LT(executor_.running.size(), 150u);
  for (int i = 0; i < 40; ++i) service_->Step();
  EXPECT_EQ(executor_.running.size(), 150u);
}

TEST_F(ServiceOnFarm, LeavesTheTimeLimitToTheFarm) {
  const int64_t job = Submit("wall");
  service_->Step();
  clock_.Advance(1000000);  // most of it waiting there
  service_->Step();
  EXPECT_TRUE(executor_.running[job].stops.empty());
}

TEST_F(ServiceOnFarm, AStopOfTheDaemonLeavesJobsThere) {
  const int64_t job = Submit("wall");
  service_->StartThread();
  while (StateOf(job) != JobState::kRunning) std::this_thread::yield();
  service_->BeginStop();
  service_->Join();
  EXPECT_TRUE(executor_.running[job].stops.empty());
  // It ends while nobody is there, and long after its lease.
  clock_.Advance(3600000);
  Publish("wall", "r0001");
  End(job, 0, R"({"exit_code": 0, "revision": "r0001"})");
  Restart();
  EXPECT_EQ(StateOf(job), JobState::kRunning);
  service_->Step();
  EXPECT_EQ(StateOf(job), JobState::kSucceeded);
  EXPECT_EQ(executor_.starts, 1);
}

TEST_F(ServiceOnFarm, SaysWhatIsWrongWithTheFarm) {
  executor_.trouble = "the farm does not answer";
  service_->Step();
  EXPECT_EQ(service_->GetStatus()->problems, std::vector<std::string>{"the farm does not answer"});
  executor_.trouble.clear();
  service_->Step();
  EXPECT_TRUE(service_->GetStatus()->problems.empty());
}

}  // namespace
}  // namespace patina::daemon
