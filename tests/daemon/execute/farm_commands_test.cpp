// What is said to farms' programs, what their answers mean, and how programs are run.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>

#include "daemon/execute/command_runner.h"
#include "daemon/execute/farm_attempt.h"
#include "daemon/execute/slurm_commands.h"
#include "daemon/execute/template_commands.h"
#include "daemon/execute/worker_command.h"
#include "tests/daemon/base/manual_clock.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

std::vector<FarmJob> Parsed(const FarmCommands& commands, const std::string& out) {
  const auto jobs = commands.ParseStatus({{"status"}, ""}, out);
  EXPECT_TRUE(jobs) << patina::test::MessageOf(jobs);
  return jobs ? *jobs : std::vector<FarmJob>();
}

TEST(SlurmCommands, ReadStatesExitCodesAndSignals) {
  const auto slurm = MakeSlurmCommands({});
  const auto jobs = Parsed(*slurm,
                           "1|FAILED|1792|vm|NonZeroExitCode|patina-1-a1|/a b|c/a1|\n"
                           "2|FAILED|24|vm|JobLaunchFailure|patina-2-a1|/x|\n"
                           "3|FAILED|1||BadConstraints|patina-3-a1|/x|\n"
                           "4|PENDING|0||Resources|patina-4-a1|/x|\n"
                           "5|COMPLETING|0|vm|None|patina-5-a1|/x|\n"
                           "6|SOMETHING_NEW|0|vm|None|patina-6-a1|/x|\n");
  ASSERT_EQ(jobs.size(), 5u) << "what sbatch refused is no job";
  EXPECT_EQ(jobs[0].exit_code, 7);
  EXPECT_EQ(jobs[0].folder, "/a b|c/a1");
  EXPECT_EQ(jobs[1].signal, 24);
  EXPECT_EQ(jobs[1].exit_code, -1);
  EXPECT_EQ(jobs[2].state, FarmState::kWaiting);
  EXPECT_EQ(jobs[2].reason, "Resources");
  EXPECT_EQ(jobs[2].exit_code, -1);
  EXPECT_FALSE(IsOver(jobs[3].state)) << "it may still run";
  EXPECT_FALSE(IsOver(jobs[4].state)) << "who knows";
  EXPECT_FALSE(slurm->ParseStatus({{"squeue"}, ""}, "slurm_load_jobs error\n"));
  EXPECT_FALSE(slurm->ParseStatus({{"squeue"}, ""}, "1|FAILED|"));
  EXPECT_TRUE(Parsed(*slurm, "").empty());
}

TEST(SlurmCommands, KnowWhatWasTheMachinesFault) {
  const auto cause = [](const char* state, const char* code = "0", bool started = true) {
    const auto slurm = MakeSlurmCommands({});
    const auto jobs = Parsed(*slurm, std::string("1|") + state + "|" + code + "|n|None|x|/x|\n");
    return CauseOf(jobs.at(0), started);
  };
  EXPECT_EQ(cause("NODE_FAIL"), EndCause::kNodeFailed);
  EXPECT_EQ(cause("BOOT_FAIL"), EndCause::kNodeFailed);
  EXPECT_EQ(cause("OUT_OF_MEMORY"), EndCause::kOutOfMemory);
  EXPECT_EQ(cause("TIMEOUT"), EndCause::kTimeLimit);
  EXPECT_EQ(cause("DEADLINE"), EndCause::kTimeLimit);
  EXPECT_EQ(cause("PREEMPTED"), EndCause::kPreempted);
  EXPECT_EQ(cause("CANCELLED"), EndCause::kCancelled);
  EXPECT_EQ(cause("COMPLETED"), EndCause::kNone);
  EXPECT_EQ(cause("FAILED", "768"), EndCause::kNone) << "exit code 3 is the program's own";
  EXPECT_EQ(cause("FAILED", "33280"), EndCause::kAskedToEnd) << "130: it was told to end";
  EXPECT_EQ(cause("FAILED", "768", false), EndCause::kNodeFailed) << "it never began";
  EXPECT_EQ(cause("FAILED", "32512"), EndCause::kNodeFailed) << "127: the program is not there";
}

TEST(SlurmCommands, ReadIdsOnly) {
  const auto slurm = MakeSlurmCommands({});
  EXPECT_EQ(slurm->ParseSubmitted("123\n").value_or(""), "123");
  EXPECT_EQ(slurm->ParseSubmitted("123;cluster\n").value_or(""), "123");
  for (const char* out : {"", "\n", "-1\n", "12a\n", "sbatch: warning\n123\n"})
    EXPECT_FALSE(slurm->ParseSubmitted(out)) << out;
}

TEST(SlurmCommands, TakeNoArgumentsThatWouldBreakTheirOwn) {
  for (const char* bad : {"--array=1-3", "-a1-3", "-J", "--job-name=x", "--requeue", "--wrap=true",
                          "--arr=1-3", "script.sh", "", "-M", "--clusters=x", "--time=1"})
    EXPECT_TRUE(SlurmOwnOption(bad)) << bad;
  for (const char* good : {"--constraint=avx2", "--reservation=r", "--exclusive", "--time-min=5",
                           "-Cavx2", "--gres=gpu:1"})
    EXPECT_FALSE(SlurmOwnOption(good)) << good;
}

TEST(SlurmCommands, CancelManyInFewCalls) {
  const std::vector<std::string> ids(450, "1");
  EXPECT_EQ(MakeSlurmCommands({})->Cancel(ids).size(), 3u);
  EXPECT_TRUE(MakeSlurmCommands({})->Cancel({}).empty());
}

TEST(TemplateCommands, FillInWhatThereIs) {
  TemplateOptions options;
  options.submit = {"qsub",       "-N{name}", "-l",          "mem={memory_mb}M",
                    "x{exclude}", "{",        "{cpus}{cpus}"};
  options.status = {"qstat", "-x", "{ids}", "end"};
  options.find = {"qfind", "{name}"};
  options.cancel = {"qdel", "{id}"};
  const auto farm = MakeTemplateCommands(options);
  FarmSubmission job;
  job.name = "patina-1-a1";
  job.cpus = 4;
  EXPECT_EQ(farm->Submit(job), (Words{"qsub", "-Npatina-1-a1", "-l", "{", "44"}));
  job.memory_mb = 5;
  job.excluded = {"a", "b"};
  EXPECT_EQ(farm->Submit(job), (Words{"qsub", "-Npatina-1-a1", "-l", "mem=5M", "xa,b", "{", "44"}));
  const auto calls = farm->Status({"1", "2"}, {"n"});
  ASSERT_EQ(calls.size(), 2u);
  EXPECT_EQ(calls[0].words, (Words{"qstat", "-x", "1", "2", "end"}));
  EXPECT_EQ(calls[1].words, (Words{"qfind", "n"}));
  EXPECT_EQ(farm->Status(std::vector<std::string>(1001, "1"), {}).size(), 3u);
  EXPECT_EQ(farm->Cancel({"1", "2"}), (std::vector<Words>{{"qdel", "1"}, {"qdel", "2"}}));
  EXPECT_EQ(UnknownPlaceholder({"a{id}", "{nme}"}, {"id", "name"}).value_or(""), "{nme}");
  EXPECT_FALSE(UnknownPlaceholder({"a{id}", "{", "}{"}, {"id"}));
}

TEST(TemplateCommands, ReadStates) {
  TemplateOptions options;
  options.status = {"qstat"};
  const auto farm = MakeTemplateCommands(options);
  const auto jobs = Parsed(*farm, "a.1 running n3\n\nb failed n4 7\nc strange\n");
  ASSERT_EQ(jobs.size(), 3u);
  EXPECT_EQ(jobs[0].state, FarmState::kRunning);
  EXPECT_EQ(jobs[0].node, "n3");
  EXPECT_EQ(jobs[1].exit_code, 7);
  EXPECT_EQ(jobs[2].state, FarmState::kUnknown);
  EXPECT_FALSE(farm->ParseStatus({{"qstat"}, ""}, "only-an-id\n"));
  EXPECT_FALSE(farm->ParseStatus({{"qstat"}, ""}, "--force running\n"));
  EXPECT_EQ(farm->ParseSubmitted("Your job is\n 12.server \n").value_or(""), "12.server");
  EXPECT_FALSE(farm->ParseSubmitted("job $(reboot)"));
  EXPECT_FALSE(farm->ParseSubmitted(""));
}

TEST(WorkerScript, QuotesWhatAShellWouldRead) {
  AttemptSpec spec;
  spec.folder = "/a'b $(x)/a1";
  spec.fence = "/f`e";
  const std::string text = WorkerScript("/w", {"X=$HOME"}, spec);
  EXPECT_NE(text.find("cd '/a'\\''b $(x)/a1' ||"), std::string::npos) << text;
  EXPECT_NE(text.find("'X=$HOME'"), std::string::npos) << text;
}

class CommandRunnerTest : public testing::Test {
 protected:
  CommandOutcome Run(const Words& words, int64_t timeout_ms = 60000) {
    auto runner = CommandRunner::Create(clock_);
    EXPECT_TRUE(runner);
    runner->Start(words, timeout_ms);
    for (std::vector<CommandOutcome> ended;;) {
      if (!(ended = runner->Poll()).empty()) return ended[0];
      pollfd ready{runner->poll_fd(), POLLIN, 0};
      EXPECT_GE(::poll(&ready, 1, 60000), 1) << "nothing within a minute";
    }
  }
  test::ManualClock clock_;
};

TEST_F(CommandRunnerTest, TellsHowProgramsEnd) {
  const CommandOutcome fine = Run({"sh", "-c", "echo out; echo err >&2; exit 3"});
  EXPECT_EQ(fine.exit_code, 3);
  EXPECT_EQ(fine.out, "out\n");
  EXPECT_EQ(fine.error, "err\n");
  EXPECT_EQ(FailureOf("sh", fine), "sh: exit code 3: err");
  EXPECT_FALSE(fine.not_started);
  const CommandOutcome killed = Run({"sh", "-c", "kill -9 $$"});
  EXPECT_EQ(killed.exit_code, -1);
  EXPECT_FALSE(killed.not_started);
  const CommandOutcome none = Run({"no-such-program-of-ours"});
  EXPECT_EQ(none.exit_code, -1);
  EXPECT_TRUE(none.not_started);
  EXPECT_NE(none.error.find("no-such-program-of-ours"), std::string::npos);
  // More than fits into a pipe.
  EXPECT_EQ(Run({"sh", "-c", "head -c 1000000 /dev/zero"}).out.size(), 1000000u);
}

TEST_F(CommandRunnerTest, EndsWhatTakesTooLongWithAllThatItStarted) {
  auto runner = CommandRunner::Create(clock_);
  ASSERT_TRUE(runner);
  runner->Start({"sh", "-c", "sleep 1000 & wait"}, 50);
  EXPECT_EQ(runner->timeout_ms(), 50);
  EXPECT_TRUE(runner->Poll().empty());
  clock_.Advance(50);
  const auto ended = runner->Poll();
  ASSERT_EQ(ended.size(), 1u);
  EXPECT_TRUE(ended[0].timed_out);
  EXPECT_EQ(runner->timeout_ms(), -1);
}

}  // namespace
}  // namespace patina::daemon
