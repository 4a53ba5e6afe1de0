// Real processes: the fake worker (fake_worker.cpp) under the local executor.
#include "daemon/execute/local_executor.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <functional>

#include "daemon/execute/sandbox.h"
#include "pipeline/jobs/run_guards.h"
#include "tests/daemon/execute/attempt_files.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

using patina::test::MessageOf;

class LocalExecutorTest : public testing::Test {
 protected:
  void SetUp() override { executor_ = Make(); }

  static std::unique_ptr<Executor> Make() {
    LocalExecutorOptions options;
    options.worker = std::string(PATINA_BIN_DIR) + "/fake_worker";
    options.environment = test::SanitizerEnvironment();
    auto executor = MakeLocalExecutor(options, RealFileCalls(), NoLog());
    EXPECT_TRUE(executor) << MessageOf(executor);
    return std::move(*executor);
  }

  AttemptSpec Prepare(const std::string& behaviour, int64_t attempt = 1) {
    return test::PrepareAttempt(folder_, behaviour, attempt);
  }

  std::string Start(const AttemptSpec& spec) {
    auto handle = executor_->Start(spec);
    EXPECT_TRUE(handle) << MessageOf(handle);
    return handle ? *handle : "";
  }

  // Waits on the executor's descriptor, as the scheduler does.
  AttemptReport Until(const std::function<bool(const AttemptReport&)>& wanted) {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (std::chrono::steady_clock::now() < limit) {
      for (AttemptReport& report : executor_->Poll()) {
        events_.insert(events_.end(), report.events.begin(), report.events.end());
        if (wanted(report)) return report;
      }
      pollfd ready{executor_->poll_fd(), POLLIN, 0};
      const int timeout = executor_->poll_timeout_ms();
      ::poll(&ready, 1, timeout < 0 ? 1000 : timeout);
    }
    ADD_FAILURE() << "nothing came within a minute";
    return {};
  }
  AttemptReport UntilEnded() {
    return Until([](const AttemptReport& report) { return report.ended; });
  }
  void UntilItTrains() {
    Until([](const AttemptReport& report) {
      for (const std::string& line : report.events) {
        if (line.find("train") != std::string::npos) return true;
      }
      return false;
    });
  }

  std::string Log() {
    auto text = ReadTextFile(folder_ / "job/log", 1 << 20);
    return text ? *text : "";
  }

  patina::test::TemporaryDirectory folder_;
  std::unique_ptr<Executor> executor_;
  std::vector<std::string> events_;
};

TEST_F(LocalExecutorTest, RunsAJobToItsEnd) {
  Start(Prepare("ok"));
  EXPECT_TRUE(executor_->IsAlive(7, 1));
  const AttemptReport report = UntilEnded();
  EXPECT_EQ(report.exit_code, 0);
  EXPECT_EQ(report.signal, 0);
  EXPECT_NE(report.result_json.find("\"r0001\""), std::string::npos) << report.result_json << Log();
  EXPECT_EQ(events_.size(), 2u);
  EXPECT_NE(Log().find("worker of wall"), std::string::npos);
  EXPECT_FALSE(executor_->IsAlive(7, 1));
  EXPECT_TRUE(executor_->Poll().empty());
}

TEST_F(LocalExecutorTest, TellsHowAProcessEnded) {
  Start(Prepare("exit 42"));
  EXPECT_EQ(UntilEnded().exit_code, 42);
  Start(Prepare("signal 11", 2));
  EXPECT_EQ(UntilEnded().signal, SIGSEGV);
  Start(Prepare("die staged", 3));
  const AttemptReport report = UntilEnded();
  EXPECT_EQ(report.signal, SIGKILL);
  EXPECT_EQ(report.result_json, "");
}

TEST_F(LocalExecutorTest, AsksToEndAndThenEnds) {
  Start(Prepare("hang"));
  UntilItTrains();
  executor_->Stop(7, 1, StopMode::kTerminate);
  EXPECT_EQ(UntilEnded().exit_code, 130);

  Start(Prepare("stubborn", 2));
  UntilItTrains();
  executor_->Stop(7, 2, StopMode::kTerminate);
  executor_->Stop(7, 2, StopMode::kKill);
  EXPECT_EQ(UntilEnded().signal, SIGKILL);
}

TEST_F(LocalExecutorTest, IsNotDeadWhileAnythingOfItLives) {
  // The child ignores TERM and outlives its parent; only when it is killed, too, is the end told.
  const AttemptSpec spec = Prepare("child");
  Start(spec);
  const AttemptReport report = UntilEnded();
  EXPECT_EQ(report.exit_code, 0);
  auto later = Make();
  ASSERT_TRUE(*later->Adopt(spec, ""));
  const auto reports = later->Poll();
  ASSERT_EQ(reports.size(), 1u);
  EXPECT_TRUE(reports[0].ended);
}

TEST_F(LocalExecutorTest, LimitsMemory) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's own memory is beyond any limit";
#endif
  AttemptSpec spec = Prepare("memory 3000");
  spec.memory_mb = 200;
  Start(spec);
  const AttemptReport report = UntilEnded();
  EXPECT_NE(report.result_json.find("resource_exhausted"), std::string::npos)
      << report.result_json << " exit " << report.exit_code << " signal " << report.signal;
  spec = Prepare("memory 100", 2);
  spec.memory_mb = 2000;
  Start(spec);
  EXPECT_EQ(UntilEnded().exit_code, 0);
}

TEST_F(LocalExecutorTest, LimitsCpuTime) {
  AttemptSpec spec = Prepare("cpu");
  spec.cpu_s = 1;
  Start(spec);
  EXPECT_EQ(UntilEnded().signal, SIGXCPU);
}

TEST_F(LocalExecutorTest, KeepsAJobToItsInputAndOutput) {
  if (Sandbox::LandlockVersion() == 0) GTEST_SKIP() << "this kernel has no Landlock";
  std::ofstream(folder_ / "secret") << "x";
  AttemptSpec spec = Prepare("reach " + (folder_ / "secret"));
  Start(spec);
  const AttemptReport report = UntilEnded();
  EXPECT_EQ(report.exit_code, 0) << Log();
  for (const char* what : {"file refused", "out refused"})
    EXPECT_NE(report.result_json.find(what), std::string::npos) << what << report.result_json;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/stray"));
}

TEST_F(LocalExecutorTest, KeepsAJobFromSocketsAndPrivileges) {
  AttemptSpec spec = Prepare("reach " + (folder_ / "nothing"));
  Start(spec);
  const AttemptReport report = UntilEnded();
  EXPECT_EQ(report.exit_code, 0) << Log();
  for (const char* what : {"socket refused", "x32 refused", "privileges refused"})
    EXPECT_NE(report.result_json.find(what), std::string::npos) << what << report.result_json;
}

TEST_F(LocalExecutorTest, AWorkerThatIsNotThereIsAnError) {
  LocalExecutorOptions options;
  options.worker = folder_ / "nothing";
  auto executor = MakeLocalExecutor(options, RealFileCalls(), NoLog());
  ASSERT_OK(executor);
  const AttemptSpec spec = Prepare("ok");
  const auto handle = (*executor)->Start(spec);
  ASSERT_FALSE(handle);
  EXPECT_EQ(handle.error().code, ErrorCode::kNotFound);
  EXPECT_NE(MessageOf(handle).find("nothing"), std::string::npos);
  EXPECT_TRUE((*executor)->Poll().empty());
}

// ---- after a crash of the daemon

TEST_F(LocalExecutorTest, AdoptsWhatStillRuns) {
  const AttemptSpec spec = Prepare("hang");
  // Another process starts it and is gone, as a daemon that was killed.
  const pid_t starter = ::fork();
  if (starter == 0) {
    auto dying = Make();
    ::_exit(dying->Start(spec) ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(starter, &status, 0), starter);
  ASSERT_EQ(status, 0);
  ASSERT_TRUE(*executor_->Adopt(spec, ""));
  EXPECT_TRUE(executor_->IsAlive(7, 1));
  UntilItTrains();
  executor_->Stop(7, 1, StopMode::kTerminate);
  const AttemptReport report = UntilEnded();
  // Nobody else's child tells its exit code, but its result does.
  EXPECT_EQ(report.exit_code, -1);
  EXPECT_NE(report.result_json.find("\"exit_code\": 130"), std::string::npos);
}

TEST_F(LocalExecutorTest, AdoptsWhatHasEndedMeanwhile) {
  const AttemptSpec spec = Prepare("ok");
  const std::string handle = Start(spec);
  UntilEnded();
  auto later = Make();
  ASSERT_TRUE(*later->Adopt(spec, handle));
  const auto reports = later->Poll();
  ASSERT_EQ(reports.size(), 1u);
  EXPECT_TRUE(reports[0].ended);
  EXPECT_NE(reports[0].result_json.find("\"done\""), std::string::npos);
}

TEST_F(LocalExecutorTest, AdoptsWhatNeverBegan) {
  const AttemptSpec spec = Prepare("ok");
  ASSERT_TRUE(*executor_->Adopt(spec, ""));
  const auto reports = executor_->Poll();
  ASSERT_EQ(reports.size(), 1u);
  EXPECT_TRUE(reports[0].ended);
  EXPECT_EQ(reports[0].result_json, "");
}

TEST_F(LocalExecutorTest, DoesNotTakeAForeignProcessForItsOwn) {
  const AttemptSpec spec = Prepare("ok");
  // The file names this process, which does not hold it; and nobody holds its lock.
  std::ofstream(spec.folder + "/alive") << ::getpid() << "\n";
  ASSERT_TRUE(*executor_->Adopt(spec, ""));
  executor_->Stop(7, 1, StopMode::kKill);
  EXPECT_TRUE(executor_->Poll().at(0).ended);
}

TEST_F(LocalExecutorTest, AStaleAttemptDoesNotPublish) {
  const AttemptSpec spec = Prepare("ok");
  ASSERT_OK(MoveFence(spec.fence, 2));
  Start(spec);
  const AttemptReport report = UntilEnded();
  EXPECT_NE(report.result_json.find("\"conflict\""), std::string::npos) << report.result_json;
  EXPECT_FALSE(std::filesystem::exists(spec.out + "/wall/current"));
  EXPECT_EQ(MoveFence(spec.fence, 1).error().code, ErrorCode::kConflict);
}

}  // namespace
}  // namespace patina::daemon
