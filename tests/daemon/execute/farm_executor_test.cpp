// The farm executor with a farm of little programs (fake_farm.py), to which anything may happen,
// and real workers (fake_worker.cpp).
#include "daemon/execute/farm_executor.h"

#include <gtest/gtest.h>
#include <poll.h>

#include <chrono>
#include <fstream>
#include <functional>
#include <set>

#include "daemon/execute/slurm_commands.h"
#include "daemon/execute/template_commands.h"
#include "pipeline/jobs/run_guards.h"
#include "tests/daemon/execute/attempt_files.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;
using patina::test::MessageOf;

const std::set<std::string>& Programs() {
  static const std::set<std::string> names{"sbatch",      "squeue",      "scancel",  "farm-submit",
                                           "farm-status", "farm-cancel", "farm-find"};
  return names;
}

class FarmTest : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* made : {"bin", "farm/jobs", "farm/faults"})
      fs::create_directories(folder_ / made);
    for (const std::string& name : Programs()) {
      fs::create_symlink(PATINA_SOURCE_DIR "/tests/daemon/execute/fake_farm.py",
                         folder_ / ("bin/" + name));
    }
    std::ofstream(folder_ / "farm/nodes") << "n1\nn2\n";
    path_ = std::getenv("PATH");
    ::setenv("PATH", ((folder_ / "bin:") + path_).c_str(), 1);
    ::setenv("FAKE_FARM", (folder_ / "farm").c_str(), 1);
    options_.worker = std::string(PATINA_BIN_DIR) + "/fake_worker";
    options_.poll_ms = 20;
    options_.result_wait_ms = 100;
    options_.environment = test::SanitizerEnvironment();
    Restart();
  }

  void TearDown() override {
    executor_.reset();
    for (const auto& job : fs::directory_iterator(folder_ / "farm/jobs")) {
      const pid_t pid = std::atoi(Read(job.path() / "pid").c_str());
      if (pid > 0 && !fs::exists(job.path() / "code")) ::kill(-pid, SIGKILL);
    }
    ::setenv("PATH", path_.c_str(), 1);
  }

  virtual std::unique_ptr<FarmCommands> Commands() { return MakeSlurmCommands({}); }

  // As after the end of a daemon: nothing of it is left but its files.
  void Restart() {
    executor_.reset();
    auto executor = MakeFarmExecutor(options_, Commands(), RealFileCalls(), SystemClock(), NoLog());
    ASSERT_TRUE(executor) << MessageOf(executor);
    executor_ = std::move(*executor);
  }

  AttemptSpec Prepare(const std::string& behaviour, int64_t attempt = 1) {
    return test::PrepareAttempt(folder_, behaviour, attempt);
  }
  void Start(const AttemptSpec& spec) {
    events_.clear();
    auto handle = executor_->Start(spec);
    ASSERT_TRUE(handle) << MessageOf(handle);
  }

  void Fault(const std::string& name) { std::ofstream(folder_ / ("farm/faults/" + name)).flush(); }
  void Heal(const std::string& name) { fs::remove(folder_ / ("farm/faults/" + name)); }
  static std::string Read(const std::string& path) {
    auto text = ReadTextFile(path, 1 << 20);
    return text ? *text : "";
  }
  std::string Of(int job, const std::string& what) {
    return Read(folder_ / ("farm/jobs/" + std::to_string(job) + "/" + what));
  }
  int Jobs() {
    return static_cast<int>(std::distance(fs::directory_iterator(folder_ / "farm/jobs"), {}));
  }
  int Calls(const std::string& program) {
    const std::string calls = Read(folder_ / "farm/calls");
    int count = 0;
    for (size_t at = 0; (at = calls.find(program, at)) != std::string::npos; ++at) ++count;
    return count;
  }

  // Until the condition holds; the end of the attempt is kept.
  void Until(const std::function<bool()>& condition) {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!condition()) {
      ASSERT_LT(std::chrono::steady_clock::now(), limit)
          << executor_->problem() << "\n"
          << Read(folder_ / "farm/calls") << Read(folder_ / "job/log");
      for (AttemptReport& report : executor_->Poll()) {
        events_.insert(events_.end(), report.events.begin(), report.events.end());
        if (report.ended) end_ = std::move(report);
      }
      pollfd ready{executor_->poll_fd(), POLLIN, 0};
      const int timeout = executor_->poll_timeout_ms();
      ::poll(&ready, 1, timeout < 0 || timeout > 20 ? 20 : timeout);
    }
  }
  const AttemptReport& UntilEnded() {
    end_.reset();
    Until([this] { return end_.has_value(); });
    static const AttemptReport none;
    return end_ ? *end_ : none;
  }
  // Of the first attempt: it ends when it is asked to, and was submitted once.
  void ExpectToStop() {
    executor_->Stop(7, 1, StopMode::kTerminate);
    EXPECT_NE(UntilEnded().result_json.find("130"), std::string::npos);
    EXPECT_EQ(Jobs(), 1);
  }
  void UntilItTrains() {
    Until([this] {
      return std::any_of(events_.begin(), events_.end(), [](const std::string& line) {
        return line.find("\"train\"") != std::string::npos;
      });
    });
  }
  // Whole rounds of looking at the farm that begin from now on.
  void UntilRounds(int count) {
    const int before = Calls("squeue");
    Until([&] { return Calls("squeue") > before + count; });
  }
  bool Published() { return fs::exists(folder_ / "out/wall/current"); }

  patina::test::TemporaryDirectory folder_;
  std::string path_;
  FarmOptions options_;
  std::unique_ptr<Executor> executor_;
  std::vector<std::string> events_;
  std::optional<AttemptReport> end_;
};

TEST_F(FarmTest, RunsAJobToItsEnd) {
  AttemptSpec spec = Prepare("ok");
  spec.threads = 3;
  // The memory of sanitizers is more than any limit.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  spec.memory_mb = 800;
#endif
  spec.wall_s = 100;
  Start(spec);
  EXPECT_TRUE(executor_->IsAlive(7, 1));
  const AttemptReport& end = UntilEnded();
  EXPECT_NE(end.result_json.find("\"r0001\""), std::string::npos) << Read(spec.log);
  EXPECT_EQ(end.cause, EndCause::kNone);
  EXPECT_FALSE(executor_->IsAlive(7, 1));
  EXPECT_EQ(Jobs(), 1);
  EXPECT_TRUE(Published());
  // Looked for before it was submitted.
  const std::string calls = Read(folder_ / "farm/calls");
  EXPECT_LT(calls.find("squeue"), calls.find("sbatch"));
  for (const char* word :
       {"--parsable", "--no-requeue", "--job-name=patina-7-a1", "--export=NONE",
        "--open-mode=append", "--signal=B:TERM@60", "--cpus-per-task=3", "--time=3"})
    EXPECT_NE(Of(1, "args").find(word), std::string::npos) << word;
  EXPECT_EQ(Of(1, "args").find("--mem=800M") != std::string::npos, spec.memory_mb == 800);
  ASSERT_GE(events_.size(), 3u);
  EXPECT_NE(events_[0].find("job 1 waits on the farm"), std::string::npos) << events_[0];
}

TEST_F(FarmTest, ASubmissionWhoseAnswerIsLostIsFoundByItsName) {
  Fault("sbatch.lost");
  Start(Prepare("ok"));
  EXPECT_NE(UntilEnded().result_json.find("\"r0001\""), std::string::npos);
  EXPECT_EQ(Jobs(), 1);
}

TEST_F(FarmTest, NoAnswerAboutJobsIsNoAnswer) {
  options_.command_timeout_ms = 500;
  Restart();
  Start(Prepare("hang"));
  UntilItTrains();
  Fault("squeue.fail");
  UntilRounds(2);
  Until([this] { return !executor_->problem().empty(); });
  EXPECT_NE(executor_->problem().find("Unable to contact"), std::string::npos);
  Fault("squeue.hang");
  Until([this] { return executor_->problem().find("no answer in time") != std::string::npos; });
  EXPECT_FALSE(end_) << "unknown is not failed";
  EXPECT_TRUE(executor_->IsAlive(7, 1));
  Heal("squeue.hang");
  Heal("squeue.fail");
  Until([this] { return executor_->problem().empty(); });
  ExpectToStop();
}

TEST_F(FarmTest, AWorkerThatIsDoneNeedsNoWordOfTheFarm) {
  Fault("hold");
  const AttemptSpec spec = Prepare("ok");
  Start(spec);
  Until([this] { return !Of(1, "args").empty(); });
  Fault("squeue.fail");
  ASSERT_EQ(std::system(("sh " + spec.folder + "/submit.sh >/dev/null").c_str()), 0);
  EXPECT_NE(UntilEnded().result_json.find("\"r0001\""), std::string::npos);
}

TEST_F(FarmTest, JobsWaitForAFarmThatIsDown) {
  Fault("sbatch.fail");
  Start(Prepare("ok"));
  Until([this] { return Calls("sbatch") == 1; });
  Fault("squeue.fail");
  UntilRounds(3);
  EXPECT_FALSE(end_);
  EXPECT_FALSE(executor_->problem().empty());
  Heal("sbatch.fail");
  Heal("squeue.fail");
  EXPECT_NE(UntilEnded().result_json.find("\"r0001\""), std::string::npos);
  EXPECT_EQ(Jobs(), 1);
  EXPECT_EQ(executor_->problem(), "");
}

TEST_F(FarmTest, WhatTheFarmRefusesSeveralTimesIsGivenBack) {
  Fault("sbatch.fail");
  Start(Prepare("ok"));
  const AttemptReport& end = UntilEnded();
  EXPECT_EQ(end.cause, EndCause::kRefused);
  EXPECT_NE(end.detail.find("Unable to contact"), std::string::npos) << end.detail;
  EXPECT_EQ(Calls("sbatch"), 3);
}

TEST_F(FarmTest, TheResultOfAForgottenJobMayComeLate) {
  options_.result_wait_ms = 3600000;
  Restart();
  Fault("hold");
  const AttemptSpec spec = Prepare("ok");
  Start(spec);
  Until([this] { return !Of(1, "args").empty(); });
  UntilRounds(1);
  fs::remove_all(folder_ / "farm/jobs/1");
  UntilRounds(0);
  EXPECT_FALSE(end_);
  ASSERT_EQ(std::system(("sh " + spec.folder + "/submit.sh >/dev/null").c_str()), 0);
  EXPECT_NE(UntilEnded().result_json.find("\"r0001\""), std::string::npos);
}

TEST_F(FarmTest, AForgottenJobWithoutAResultIsLostAndCannotPublish) {
  Fault("hold");
  const AttemptSpec spec = Prepare("ok");
  Start(spec);
  Until([this] { return !Of(1, "args").empty(); });
  UntilRounds(1);
  fs::remove_all(folder_ / "farm/jobs/1");
  const AttemptReport& end = UntilEnded();
  EXPECT_EQ(end.result_json, "");
  EXPECT_EQ(end.exit_code, -1);
  // It was alive all the same, only late.
  const int status = std::system(("sh " + spec.folder + "/submit.sh >/dev/null").c_str());
  EXPECT_EQ(WEXITSTATUS(status), 77);
  EXPECT_FALSE(FenceHold::Acquire(spec.fence, 1));
  EXPECT_FALSE(Published());
  // The next attempt can.
  Heal("hold");
  Start(Prepare("ok", 2));
  EXPECT_NE(UntilEnded().result_json.find("\"r0001\""), std::string::npos);
}

TEST_F(FarmTest, AnAttemptRunsOnceHoweverOftenItIsSubmitted) {
  const AttemptSpec spec = Prepare("ok");
  Start(spec);
  UntilEnded();
  const int status = std::system(("sh " + spec.folder + "/submit.sh 2>/dev/null").c_str());
  EXPECT_EQ(WEXITSTATUS(status), 76);
  EXPECT_FALSE(fs::exists(folder_ / "out/wall/r0002"));
}

TEST_F(FarmTest, NodesThatFailedAreLeftOutUnlessThatLeavesNone) {
  for (int attempt = 1; attempt <= 2; ++attempt) {
    Start(Prepare("hang", attempt));
    Until([&] { return !Of(attempt, "pid").empty(); });
    EXPECT_EQ(Of(attempt, "node"), "n" + std::to_string(attempt));
    std::ofstream(folder_ / ("farm/jobs/" + std::to_string(attempt) + "/state")) << "NODE_FAIL";
    const AttemptReport& end = UntilEnded();
    EXPECT_EQ(end.cause, EndCause::kNodeFailed);
    EXPECT_NE(end.detail.find("on n"), std::string::npos) << end.detail;
  }
  EXPECT_NE(Of(2, "args").find("--exclude=n1\n"), std::string::npos);
  Start(Prepare("hang", 3));
  Until([this] { return !Of(3, "args").empty(); });
  EXPECT_EQ(Of(3, "args").find("--exclude"), std::string::npos);
  EXPECT_NE(Read(folder_ / "farm/calls").find("--exclude=n1,n2"), std::string::npos);
  EXPECT_FALSE(end_->job == 7 && end_->attempt == 3);
}

TEST_F(FarmTest, ANodeWithoutTheSharedDiskHasFailed) {
  Fault("no_disk");
  Start(Prepare("ok"));
  EXPECT_EQ(UntilEnded().cause, EndCause::kNodeFailed);
  EXPECT_EQ(Read(folder_ / "job/failed_nodes"), "n1\n");
}

TEST_F(FarmTest, HowTheProgramEndedIsTold) {
  Start(Prepare("bad"));
  EXPECT_NE(UntilEnded().result_json.find("\"exit_code\": 3"), std::string::npos);
  Start(Prepare("exit 42", 2));
  const AttemptReport& left = UntilEnded();
  EXPECT_EQ(left.exit_code, 42);
  EXPECT_EQ(left.cause, EndCause::kNone);
  EXPECT_EQ(left.result_json, "");
  Start(Prepare("die staged", 3));
  EXPECT_EQ(UntilEnded().signal, SIGKILL);
}

TEST_F(FarmTest, AStoppedJobHasEndedWhenTheFarmSaysSo) {
  Fault("keep");
  Start(Prepare("hang"));
  UntilItTrains();
  executor_->Stop(7, 1, StopMode::kTerminate);
  Until([this] { return Calls("scancel") >= 1; });
  UntilRounds(3);
  EXPECT_FALSE(end_) << "it still runs";
  Heal("keep");
  executor_->Stop(7, 1, StopMode::kKill);
  const AttemptReport& end = UntilEnded();
  EXPECT_EQ(end.cause, EndCause::kNone);
  EXPECT_FALSE(Of(1, "code").empty());
}

TEST_F(FarmTest, AJobThatIsStoppedBeforeItIsSubmittedNeverIs) {
  Fault("squeue.fail");
  Start(Prepare("ok"));
  UntilRounds(1);
  executor_->Stop(7, 1, StopMode::kTerminate);
  UntilEnded();
  EXPECT_EQ(Calls("sbatch"), 0);
}

TEST_F(FarmTest, AJobThatIsStoppedWhileItIsSubmittedIsCancelled) {
  Fault("sbatch.lost");
  Fault("hold");
  Start(Prepare("ok"));
  Until([this] { return Jobs() == 1; });
  executor_->Stop(7, 1, StopMode::kTerminate);
  UntilEnded();
  EXPECT_EQ(Calls("scancel 1"), 1);
  EXPECT_FALSE(Published());
}

TEST_F(FarmTest, ALaterDaemonTakesOver) {
  const AttemptSpec spec = Prepare("hang");
  Start(spec);
  UntilItTrains();
  for (const bool noted : {true, false}) {
    // Not noted: the daemon died between submission and note.
    if (!noted) fs::remove(spec.folder + "/farm_id");
    Restart();
    const auto adopted = executor_->Adopt(spec, "");
    ASSERT_TRUE(adopted && *adopted);
    UntilRounds(2);
    EXPECT_FALSE(end_);
    EXPECT_EQ(Read(spec.folder + "/farm_id"), "1\n");
  }
  ExpectToStop();
}

TEST_F(FarmTest, ALaterDaemonSubmitsWhatWasDescribedAndNotSubmitted) {
  Fault("squeue.fail");
  const AttemptSpec spec = Prepare("ok");
  Start(spec);
  UntilRounds(1);
  Restart();
  Heal("squeue.fail");
  ASSERT_TRUE(executor_->Adopt(spec, ""));
  EXPECT_NE(UntilEnded().result_json.find("\"r0001\""), std::string::npos);
  EXPECT_EQ(Jobs(), 1);
}

TEST_F(FarmTest, ALaterDaemonDoesNotRunAgainWhatRanMeanwhile) {
  const AttemptSpec spec = Prepare("exit 9");
  Start(spec);
  Until([this] { return !Of(1, "code").empty(); });
  executor_.reset();
  end_.reset();
  fs::remove_all(folder_ / "farm/jobs/1");
  fs::remove(spec.folder + "/farm_id");
  Restart();
  ASSERT_TRUE(executor_->Adopt(spec, ""));
  UntilEnded();
  EXPECT_EQ(Jobs(), 0);
}

TEST_F(FarmTest, WhatWasNeverDescribedIsLost) {
  ASSERT_TRUE(executor_->Adopt(Prepare("ok"), ""));
  EXPECT_EQ(UntilEnded().result_json, "");
  EXPECT_EQ(Calls("sbatch"), 0);
}

TEST_F(FarmTest, JobsOfAnotherDaemonThatHaveTheSameNameAreNotTaken) {
  fs::create_directories(folder_ / "farm/jobs/1");
  std::ofstream(folder_ / "farm/jobs/1/name") << "patina-7-a1";
  std::ofstream(folder_ / "farm/jobs/1/folder") << "/elsewhere/a1";
  std::ofstream(folder_ / "farm/jobs/1/state") << "RUNNING";
  Start(Prepare("ok"));
  EXPECT_NE(UntilEnded().result_json.find("\"r0001\""), std::string::npos);
  EXPECT_EQ(Jobs(), 2);
}

class TemplateFarmTest : public FarmTest {
 protected:
  std::unique_ptr<FarmCommands> Commands() override {
    TemplateOptions options;
    options.submit = {"farm-submit", "{name}", "{folder}", "{script}", "{log}", "mem={memory_mb}"};
    options.status = {"farm-status", "{ids}"};
    if (can_find_) options.find = {"farm-find", "{name}"};
    options.cancel = {"farm-cancel", "{id}"};
    return MakeTemplateCommands(options);
  }
  bool can_find_ = false;
};

TEST_F(TemplateFarmTest, RunsAndCancelsJobs) {
  Start(Prepare("ok"));
  EXPECT_NE(UntilEnded().result_json.find("\"r0001\""), std::string::npos);
  EXPECT_EQ(Of(1, "args").find("mem="), std::string::npos) << "there is no limit";
  Start(Prepare("hang", 2));
  UntilItTrains();
  executor_->Stop(7, 2, StopMode::kTerminate);
  EXPECT_NE(UntilEnded().result_json.find("130"), std::string::npos);
  Start(Prepare("exit 42", 3));
  EXPECT_EQ(UntilEnded().exit_code, 42);
}

TEST_F(TemplateFarmTest, ASubmissionWhoseAnswerIsLostIsFoundWhereThatCanBe) {
  can_find_ = true;
  Restart();
  Fault("farm-submit.lost");
  Start(Prepare("ok"));
  EXPECT_NE(UntilEnded().result_json.find("\"r0001\""), std::string::npos);
  EXPECT_EQ(Jobs(), 1);
}

TEST_F(TemplateFarmTest, ElseItIsLostAndCannotPublish) {
  Fault("farm-submit.lost");
  Fault("hold");
  const AttemptSpec spec = Prepare("ok");
  Start(spec);
  EXPECT_EQ(UntilEnded().result_json, "");
  const int status = std::system(("sh " + spec.folder + "/submit.sh >/dev/null").c_str());
  EXPECT_EQ(WEXITSTATUS(status), 77);
}

}  // namespace
}  // namespace patina::daemon
