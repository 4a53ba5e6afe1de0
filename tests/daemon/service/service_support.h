// A service with a queue of its own, an executor that does what the test says, and a clock that the
// test winds.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/service/daemon_service.h"
#include "tests/daemon/base/failing_file_calls.h"
#include "tests/daemon/base/manual_clock.h"
#include "tests/formats/test_support.h"

namespace patina::daemon::test {

class FakeExecutor : public Executor {
 public:
  struct Running {
    AttemptSpec spec;
    std::vector<StopMode> stops;
    std::vector<std::string> events;
    std::optional<AttemptReport> end;
  };

  Result<std::string> Start(const AttemptSpec& spec) override {
    if (start_error) return Fail(*start_error);
    running[spec.job] = {spec, {}, {}, std::nullopt};
    ++starts;
    return "fake:" + std::to_string(spec.job);
  }
  Result<bool> Adopt(const AttemptSpec& spec, const std::string&) override {
    if (!adoptable) return false;
    Running& attempt = running[spec.job];
    attempt.spec = spec;
    return true;
  }
  void Stop(int64_t job, int64_t, StopMode mode) override {
    const auto found = running.find(job);
    if (found != running.end()) found->second.stops.push_back(mode);
  }
  std::vector<AttemptReport> Poll() override {
    std::vector<AttemptReport> reports = std::move(stray);
    stray.clear();
    for (auto it = running.begin(); it != running.end();) {
      Running& attempt = it->second;
      AttemptReport report = attempt.end.value_or(AttemptReport());
      report.job = attempt.spec.job;
      report.attempt = attempt.spec.attempt;
      report.ended = attempt.end.has_value();
      report.events = std::move(attempt.events);
      attempt.events.clear();
      if (report.ended || !report.events.empty()) reports.push_back(report);
      it = report.ended ? running.erase(it) : std::next(it);
    }
    return reports;
  }
  bool IsAlive(int64_t job, int64_t) const override { return running.count(job) != 0; }
  int poll_fd() const override { return -1; }
  int poll_timeout_ms() const override { return -1; }
  std::string problem() const override { return trouble; }

  std::map<int64_t, Running> running;
  std::vector<AttemptReport> stray;
  std::optional<Error> start_error;
  std::string trouble;
  bool adoptable = true;
  int starts = 0;
};

class ServiceTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder_ / "in");
    std::filesystem::create_directories(folder_ / "out");
    std::filesystem::create_directories(folder_ / "state/jobs");
    config_.state_dir = folder_ / "state";
    config_.out = folder_ / "out";
    WatchConfig watch;
    watch.path = folder_ / "in";
    config_.watch = {watch};
    config_.cores = 2;
    config_.limits.threads = 1;
    config_.limits.grace_s = 10;
    config_.stop_grace_s = 30;
    config_.retry = {3, 1000, 60000, 0};
    Restart();
  }

  // A new daemon on what the last one left.
  void Restart() {
    service_.reset();
    store_.reset();
    auto store = JobStore::Open(folder_ / "state/queue.db");
    ASSERT_OK(store);
    store_ = std::move(*store);
    auto service = DaemonService::Create({*store_, executor_, files_, clock_, NoLog()}, config_, 1);
    ASSERT_OK(service);
    service_ = std::move(*service);
  }

  std::string MakeInput(const std::string& asset) {
    std::filesystem::create_directories(folder_ / ("in/" + asset));
    return folder_ / ("in/" + asset);
  }

  SubmitRequest RequestFor(const std::string& asset) {
    SubmitRequest request;
    request.job.asset = asset;
    request.job.folder = MakeInput(asset);
    return request;
  }

  int64_t Submit(const std::string& asset) {
    auto submitted = service_->Submit(RequestFor(asset));
    EXPECT_TRUE(submitted) << patina::test::MessageOf(submitted);
    return submitted ? submitted->id : 0;
  }

  AssetOffer OfferOf(const std::string& asset, const std::string& signature) {
    AssetOffer offer;
    offer.job.asset = asset;
    offer.job.folder = MakeInput(asset);
    offer.signature = signature;
    offer.failed_folder = folder_ / "in";
    return offer;
  }
  OfferOutcome Offer(const std::string& asset, const std::string& signature) {
    auto outcome = service_->OfferAsset(OfferOf(asset, signature));
    EXPECT_TRUE(outcome) << patina::test::MessageOf(outcome);
    return outcome ? *outcome : OfferOutcome::kUnchanged;
  }

  // What a bake would leave.
  void Publish(const std::string& asset, const std::string& revision) {
    const std::string folder = folder_ / ("out/" + asset);
    std::filesystem::create_directories(folder + "/" + revision);
    std::ofstream(folder + "/" + revision + "/manifest.json") << "{}";
    std::filesystem::remove(folder + "/current");
    std::filesystem::create_symlink(revision, folder + "/current");
  }

  void End(int64_t job, int exit_code, const std::string& result, int signal = 0) {
    ASSERT_EQ(executor_.running.count(job), 1u);
    AttemptReport report;
    report.exit_code = exit_code;
    report.signal = signal;
    report.result_json = result;
    executor_.running[job].end = report;
  }
  void Succeed(int64_t job, const std::string& asset, const std::string& revision = "r0001") {
    Publish(asset, revision);
    End(job, 0, R"({"exit_code": 0, "revision": ")" + revision + R"("})");
    service_->Step();
  }
  void FailBadInput(int64_t job) {
    End(job, 3, R"({"exit_code": 3, "error": {"code": "corrupt_data", "message": "no good"}})");
    service_->Step();
  }
  void Kill(int64_t job) {
    End(job, -1, "", 9);
    service_->Step();
  }

  JobRecord Job(int64_t id) {
    auto view = service_->Get(id);
    EXPECT_TRUE(view) << patina::test::MessageOf(view);
    return view ? view->record : JobRecord();
  }
  JobState StateOf(int64_t id) { return Job(id).state; }

  patina::test::TemporaryDirectory folder_;
  Config config_;
  FailingFileCalls files_{-1};
  ManualClock clock_;
  FakeExecutor executor_;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<DaemonService> service_;
};

}  // namespace patina::daemon::test
