// The commands against the daemon's own API, with a service behind it that runs nothing.
#include "pipeline/client/client_commands.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/api/api_server.h"
#include "formats/base/file_io.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/job_result.h"
#include "tests/daemon/api/fake_service.h"
#include "tests/formats/test_support.h"

namespace patina {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;
using Json = nlohmann::json;

int Submit(const ClientOptions& options, const CancelToken& cancel) {
  return SubmitCommand(options, PlanSubmit, cancel);
}

class ClientCommands : public ::testing::Test {
 protected:
  ClientCommands() {
    daemon::ApiConfig config;
    config.socket = options_.socket = folder_ / "s";
    auto server = daemon::ApiServer::Start(config, "/out", &service_, nullptr, &daemon::NoLog());
    EXPECT_TRUE(server) << test::MessageOf(server);
    server_ = std::move(*server);
  }
  ~ClientCommands() override { service_.Close(); }

  int Run(int (*command)(const ClientOptions&, const CancelToken&)) {
    ::testing::internal::CaptureStdout();
    ::testing::internal::CaptureStderr();
    const int code = command(options_, cancel_);
    out_ = ::testing::internal::GetCapturedStdout();
    err_ = ::testing::internal::GetCapturedStderr();
    return code;
  }

  // A job that the service has been given ends when the client listens.
  std::thread EndJobOnceWatched(int64_t id, daemon::JobState state) {
    return std::thread([this, id, state] {
      while (service_.subscribers() == 0) std::this_thread::yield();
      service_.Change(id, state);
      service_.Publish(daemon::JobStateName(state), id, "{\"asset\":\"wall\"}");
    });
  }

  test::TemporaryDirectory folder_;
  daemon::FakeService service_;
  std::unique_ptr<daemon::ApiServer> server_;
  ClientOptions options_;
  CancelToken cancel_;
  std::string out_, err_;
};

TEST_F(ClientCommands, ListJobs) {
  EXPECT_EQ(Run(JobsCommand), kExitDone);
  EXPECT_THAT(out_, HasSubstr("2   running"));
  EXPECT_THAT(out_, HasSubstr("albedo.png is cut off"));
  options_.state = "failed";
  options_.json = true;
  EXPECT_EQ(Run(JobsCommand), kExitDone);
  EXPECT_EQ(Json::parse(out_)["jobs"].size(), 1u);
  options_.state = "no&such=state";
  EXPECT_EQ(Run(JobsCommand), kExitBadInput);
  EXPECT_THAT(err_, HasSubstr("\"no&such=state\" is no state"));
}

TEST_F(ClientCommands, SubmitJobFilesAndFolders) {
  ASSERT_OK(MakeDirectories(folder_ / "maps"));
  ASSERT_OK(WriteFileDurably(
      folder_ / "job.json",
      std::string_view(
          R"({"version": 1, "kind": "material", "asset": "wall", "folder": "maps", "out": "o"})")));
  ASSERT_OK(WriteFileDurably(folder_ / "gold.bsdf", std::string_view("x")));
  options_.inputs = {folder_ / "job.json", folder_ / "gold.bsdf"};
  options_.priority = 7;
  options_.force = true;
  EXPECT_EQ(Run(Submit), kExitDone);
  EXPECT_EQ(out_, "100 wall\n101 gold\n");
  ASSERT_EQ(service_.submitted.size(), 2u);
  EXPECT_EQ(service_.submitted[0].job.folder, folder_ / "maps");
  EXPECT_EQ(service_.submitted[0].job.out, folder_ / "o");
  EXPECT_EQ(service_.submitted[0].priority, 7);
  EXPECT_TRUE(service_.submitted[0].force);
  EXPECT_EQ(service_.submitted[1].job.file, folder_ / "gold.bsdf");
  EXPECT_EQ(service_.submitted[1].job.out, "/out");
}

TEST_F(ClientCommands, SubmitWhatCanBeSubmitted) {
  ASSERT_OK(WriteFileDurably(folder_ / "gold.bsdf", std::string_view("x")));
  options_.inputs = {folder_ / "missing", folder_ / "gold.bsdf"};
  options_.json = true;
  EXPECT_EQ(Run(Submit), kExitBadInput);
  const Json jobs = Json::parse(out_)["jobs"];
  ASSERT_EQ(jobs.size(), 2u);
  EXPECT_THAT(jobs[0]["error"].get<std::string>(), HasSubstr("no folder or file"));
  EXPECT_EQ(jobs[1]["id"], 100);
}

TEST_F(ClientCommands, SubmitWhatIsWatchedUnderTheNameThatItHasThere) {
  ASSERT_OK(MakeDirectories(folder_ / "drop/metals"));
  ASSERT_OK(WriteFileDurably(folder_ / "drop/metals/gold.bsdf", std::string_view("x")));
  ASSERT_OK(WriteFileDurably(
      folder_ / "drop/job.json",
      std::string_view(
          R"({"version": 1, "kind": "brdf", "asset": "own", "file": "metals/gold.bsdf", "out": "o"})")));
  service_.roots = {{folder_ / "other", "inotify", "", 1, 0},
                    {folder_ / "drop", "inotify", "", 1, 0}};
  options_.inputs = {folder_ / "drop/metals", folder_ / "drop/metals/gold.bsdf",
                     folder_ / "drop/job.json"};
  EXPECT_EQ(Run(Submit), kExitDone);
  EXPECT_EQ(out_, "100 metals_gold\n101 metals_gold\n102 own\n");
}

TEST_F(ClientCommands, SubmitSetsAsReflectance) {
  const float pixels[12] = {0, 0.2f, 0.4f, 0.6f, 0.8f, 1, 0, 0.3f, 0.6f, 0.9f, 0.1f, 0.5f};
  ASSERT_OK(MakeDirectories(folder_ / "wall"));
  ASSERT_OK(WriteImage(folder_ / "wall/wall_albedo.png", WriteFormat::kPng8, 2, 2, 3, pixels));
  ASSERT_OK(WriteFileDurably(folder_ / "gold.bsdf", std::string_view("x")));
  options_.inputs = {folder_ / "wall", folder_ / "gold.bsdf"};
  options_.as = "svbrdf";
  options_.color_space = "linear";
  EXPECT_EQ(Run(Submit), kExitDone);
  ASSERT_EQ(service_.submitted.size(), 2u);
  EXPECT_EQ(service_.submitted[0].job.kind, JobKind::kSvbrdf);
  EXPECT_EQ(service_.submitted[0].job.folder, folder_ / "wall");
  EXPECT_EQ(service_.submitted[0].job.color_space, "linear");
  EXPECT_EQ(service_.submitted[1].job.kind, JobKind::kBrdf);
  // A drop folder of reflectance says so itself, and does not insist.
  service_.roots = {{folder_.path(), "inotify", "", 1, 0, true}};
  for (const auto& [as, kind] : {std::pair("", JobKind::kSvbrdf),
                                 {"svbrdf", JobKind::kSvbrdf},
                                 {"material", JobKind::kMaterial}}) {
    options_.inputs = {folder_ / "wall"};
    options_.as = as;
    EXPECT_EQ(Run(Submit), kExitDone);
    EXPECT_EQ(service_.submitted.back().job.kind, kind) << as;
  }
}

TEST_F(ClientCommands, SubmitOnceForAKey) {
  ASSERT_OK(WriteFileDurably(folder_ / "gold.bsdf", std::string_view("x")));
  options_.inputs = {folder_ / "gold.bsdf"};
  options_.idempotency_key = "key";
  EXPECT_EQ(Run(Submit), kExitDone);
  EXPECT_EQ(Run(Submit), kExitDone);
  EXPECT_EQ(out_, "100 gold\n");
  EXPECT_EQ(service_.submitted.size(), 1u);
  options_.inputs.push_back(folder_ / "gold.bsdf");
  EXPECT_EQ(Run(Submit), kExitUsage);
}

TEST_F(ClientCommands, WaitForAJobAndReturnItsExitCode) {
  service_.Add(100);
  ASSERT_OK(WriteFileDurably(folder_ / "gold.bsdf", std::string_view("x")));
  options_.inputs = {folder_ / "gold.bsdf"};
  options_.wait = true;
  std::thread end = EndJobOnceWatched(100, daemon::JobState::kFailed);
  EXPECT_EQ(Run(Submit), kExitFailed);
  end.join();
  EXPECT_THAT(err_, HasSubstr("100 wall100: failed"));
}

TEST_F(ClientCommands, WatchAJobToItsEnd) {
  options_.ids = {2};
  std::thread end = EndJobOnceWatched(2, daemon::JobState::kSucceeded);
  EXPECT_EQ(Run(WatchCommand), kExitDone);
  end.join();
  EXPECT_THAT(err_, HasSubstr("2 wall2: running, train 50 %"));
  EXPECT_THAT(err_, HasSubstr("2 wall2: succeeded"));
  // One that has ended already.
  options_.ids = {3};
  EXPECT_EQ(Run(WatchCommand), kExitFailed);
  options_.ids = {99};
  EXPECT_EQ(Run(WatchCommand), kExitBadInput);
}

TEST_F(ClientCommands, WatchEventsAsJson) {
  options_.ids = {2};
  options_.json = true;
  std::thread end = EndJobOnceWatched(2, daemon::JobState::kCancelled);
  EXPECT_EQ(Run(WatchCommand), kExitInterrupted);
  end.join();
  // Events, unless the job was found ended first, and at last the job.
  const size_t last = out_.rfind('\n', out_.size() - 2);
  EXPECT_EQ(Json::parse(out_.substr(last == std::string::npos ? 0 : last + 1))["state"],
            "cancelled");
}

TEST_F(ClientCommands, WatchAgainWhenTheDaemonWasStartedAnew) {
  options_.ids = {2};
  std::thread restart([this] {
    while (service_.subscribers() == 0) std::this_thread::yield();
    server_.reset();
    service_.Change(2, daemon::JobState::kSucceeded);
    daemon::ApiConfig config;
    config.socket = options_.socket;
    server_ =
        std::move(*daemon::ApiServer::Start(config, "/out", &service_, nullptr, &daemon::NoLog()));
  });
  EXPECT_EQ(Run(WatchCommand), kExitDone);
  restart.join();
}

TEST_F(ClientCommands, CancelAndRetry) {
  options_.ids = {1, 2, 3};
  EXPECT_EQ(Run(CancelCommand), kExitBadInput);
  EXPECT_EQ(out_, "1: cancelled\n2: being cancelled\n");
  EXPECT_THAT(err_, HasSubstr("the job has ended"));
  options_.ids = {3};
  options_.json = true;
  EXPECT_EQ(Run(RetryCommand), kExitDone);
  EXPECT_EQ(Json::parse(out_)["jobs"][0]["id"], 3);
}

TEST_F(ClientCommands, PrintLogs) {
  options_.ids = {3};
  EXPECT_EQ(Run(LogsCommand), kExitDone);
  EXPECT_EQ(out_, "line 1\nline 2\n");
  options_.tail_bytes = 7;
  options_.follow = true;
  EXPECT_EQ(Run(LogsCommand), kExitDone);
  EXPECT_EQ(out_, "line 2\n");
  options_.follow = false;
  options_.tail_bytes = 0;
  options_.json = true;
  EXPECT_EQ(Run(LogsCommand), kExitDone);
  EXPECT_EQ(Json::parse(out_)["text"], "line 1\nline 2\n");
  options_.ids = {99};
  EXPECT_EQ(Run(LogsCommand), kExitBadInput);
}

TEST_F(ClientCommands, TellTheStatus) {
  EXPECT_EQ(Run(StatusCommand), kExitDone);
  EXPECT_THAT(out_, StartsWith("patinad 0.1.0, running"));
  EXPECT_THAT(out_, HasSubstr("the disk is nearly full; make room"));
  options_.json = true;
  EXPECT_EQ(Run(StatusCommand), kExitDone);
  EXPECT_EQ(Json::parse(out_)["pid"], 1);
}

TEST_F(ClientCommands, SayWhatToDoWithoutADaemon) {
  server_.reset();
  options_.ids = {1};
  options_.inputs = {folder_ / "gold.bsdf"};
  ASSERT_OK(WriteFileDurably(folder_ / "gold.bsdf", std::string_view("x")));
  for (auto* command : {JobsCommand, WatchCommand, CancelCommand, RetryCommand, LogsCommand,
                        StatusCommand, Submit}) {
    EXPECT_EQ(Run(command), kExitFailed);
    EXPECT_THAT(err_, HasSubstr("no daemon listens on"));
    EXPECT_THAT(err_, HasSubstr("patinad --watch DIR --out DIR"));
  }
}

TEST_F(ClientCommands, StopWhenInterrupted) {
  options_.ids = {2};
  std::thread interrupt([this] {
    while (service_.subscribers() == 0) std::this_thread::yield();
    cancel_.Cancel();
  });
  EXPECT_EQ(Run(WatchCommand), kExitInterrupted);
  interrupt.join();
  EXPECT_THAT(err_, HasSubstr("the jobs go on"));
}

TEST(ClientSocket, IsFoundInTheEnvironment) {
  setenv("PATINA_SOCKET", "/elsewhere/s", 1);
  EXPECT_EQ(DefaultSocketPath(), "/elsewhere/s");
  unsetenv("PATINA_SOCKET");
  setenv("XDG_STATE_HOME", "/state", 1);
  EXPECT_EQ(DefaultSocketPath(), "/state/patina/patinad.sock");
  unsetenv("XDG_STATE_HOME");
  setenv("HOME", "/house", 1);
  EXPECT_EQ(DefaultSocketPath(), "/house/.local/state/patina/patinad.sock");
}

}  // namespace
}  // namespace patina
