#include "daemon/service/daemon_service.h"

#include <chrono>
#include <future>
#include <vector>

#include "formats/base/file_io.h"
#include "tests/daemon/service/service_support.h"

namespace patina::daemon {
namespace {

using patina::test::MessageOf;
using test::ServiceTest;
using ServiceJobs = ServiceTest;
using ServiceRecovery = ServiceTest;
using ServiceStop = ServiceTest;
using ServiceAssets = ServiceTest;

std::string Text(const std::string& path) {
  auto text = ReadTextFile(path, 1 << 20);
  return text ? *text : "";
}

// ---- jobs

TEST_F(ServiceJobs, RunToTheirEnd) {
  const int64_t id = Submit("wall");
  EXPECT_EQ(StateOf(id), JobState::kQueued);
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kRunning);
  const AttemptSpec& spec = executor_.running[id].spec;
  EXPECT_EQ(spec.attempt, 1);
  EXPECT_TRUE(spec.skip_unchanged);
  EXPECT_EQ(spec.inputs, std::vector<std::string>{folder_ / "in/wall"});
  EXPECT_NE(Text(spec.folder + "/job.json").find("\"threads\": 1"), std::string::npos);
  EXPECT_EQ(Text(spec.fence), "1\n");
  EXPECT_EQ(Job(id).handle, "fake:1");
  executor_.running[id].events = {
      R"({"type":"progress","stage":"train","fraction":0.25,"psnr_db":30.5,"gain_10s_db":0.25})", "no json", "[1]"};
  service_->Step();
  const auto view = service_->Get(id);
  ASSERT_TRUE(view->progress);
  EXPECT_EQ(view->progress->stage, "train");
  EXPECT_EQ(view->progress->fraction, 0.25);
  Succeed(id, "wall");
  EXPECT_EQ(StateOf(id), JobState::kSucceeded);
  EXPECT_EQ(Job(id).revision, "r0001");
  EXPECT_EQ(Job(id).container, folder_ / "out/wall/r0001");
  EXPECT_FALSE(service_->Get(id)->progress);
}

TEST_F(ServiceJobs, KeepToTheCoreBudgetInOrder) {
  SubmitRequest wide = RequestFor("wide");
  wide.job.threads = 8;  // more than there are: it gets what there is
  const int64_t a = Submit("a"), b = service_->Submit(wide)->id, c = Submit("c");
  service_->Step();
  EXPECT_EQ(StateOf(a), JobState::kRunning);
  // The wide one does not fit, and nothing overtakes it.
  EXPECT_EQ(StateOf(b), JobState::kQueued);
  EXPECT_EQ(StateOf(c), JobState::kQueued);
  EXPECT_EQ(service_->Get(b)->waiting_reason, "waits for 2 cores: 1 of 2 are in use");
  Succeed(a, "a");
  EXPECT_EQ(StateOf(b), JobState::kRunning);
  EXPECT_EQ(StateOf(c), JobState::kQueued);
  Succeed(b, "wide");
  EXPECT_EQ(StateOf(c), JobState::kRunning);
}

TEST_F(ServiceJobs, OfOneAssetRunOneAfterTheOther) {
  const int64_t first = Submit("wall"), second = Submit("wall");
  service_->Step();
  EXPECT_EQ(StateOf(second), JobState::kQueued);
  Succeed(first, "wall");
  EXPECT_EQ(StateOf(second), JobState::kRunning);
}

TEST_F(ServiceJobs, WithBadInputAreNotTriedAgain) {
  const int64_t id = Submit("wall");
  service_->Step();
  FailBadInput(id);
  EXPECT_EQ(StateOf(id), JobState::kFailed);
  EXPECT_EQ(Job(id).error_code, "corrupt_data");
  EXPECT_EQ(Job(id).error_message, "no good");
  clock_.Advance(1000000);
  service_->Step();
  EXPECT_EQ(executor_.starts, 1);
  ASSERT_OK(service_->Retry(id));
  service_->Step();
  EXPECT_EQ(Job(id).attempt, 2);
}

TEST_F(ServiceJobs, LostToTheMachineWaitLongerEachTimeAndAreBuried) {
  const int64_t id = Submit("wall");
  service_->Step();
  Kill(id);
  EXPECT_EQ(StateOf(id), JobState::kRetryWaiting);
  EXPECT_EQ(Job(id).due_ms, clock_.WallMs() + 1000);
  clock_.Advance(999);
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kRetryWaiting);
  clock_.Advance(1);
  service_->Step();
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kRunning);
  Kill(id);
  EXPECT_EQ(Job(id).due_ms, clock_.WallMs() + 2000);
  clock_.Advance(2000);
  service_->Step();
  service_->Step();
  Kill(id);
  EXPECT_EQ(StateOf(id), JobState::kBuried);
  EXPECT_EQ(Job(id).failures, 3);
  ASSERT_OK(service_->Retry(id));
  EXPECT_EQ(Job(id).failures, 0);
}

TEST_F(ServiceJobs, AreCancelledWithPatienceAndOnlyWhenDead) {
  const int64_t id = Submit("wall");
  service_->Step();
  EXPECT_EQ(*service_->Cancel(id), JobState::kRunning);
  service_->Step();
  EXPECT_EQ(executor_.running[id].stops, std::vector<StopMode>{StopMode::kTerminate});
  clock_.Advance(9999);
  service_->Step();
  EXPECT_EQ(executor_.running[id].stops.size(), 1u);
  clock_.Advance(1);
  service_->Step();
  EXPECT_EQ(executor_.running[id].stops.back(), StopMode::kKill);
  // Another job of the asset waits until it is known to be dead.
  const int64_t next = Submit("wall");
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kRunning);
  EXPECT_EQ(StateOf(next), JobState::kQueued);
  Kill(id);
  EXPECT_EQ(StateOf(id), JobState::kCancelled);
  EXPECT_EQ(StateOf(next), JobState::kRunning);
}

TEST_F(ServiceJobs, ThatAreDoneBeforeTheyHearOfTheirCancellationAreDone) {
  const int64_t id = Submit("wall");
  service_->Step();
  ASSERT_OK(service_->Cancel(id));
  Succeed(id, "wall");
  EXPECT_EQ(StateOf(id), JobState::kSucceeded);
}

TEST_F(ServiceJobs, OverTheirTimeAreEndedAndTriedAgain) {
  SubmitRequest request = RequestFor("wall");
  request.wall_s = 60;
  const int64_t id = service_->Submit(request)->id;
  service_->Step();
  clock_.Advance(60000);
  service_->Step();
  ASSERT_EQ(executor_.running[id].stops, std::vector<StopMode>{StopMode::kTerminate});
  End(id, 130, R"({"exit_code": 130, "error": {"code": "cancelled", "message": "x"}})");
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kRetryWaiting);
  EXPECT_EQ(Job(id).error_code, "timeout");
}

TEST_F(ServiceJobs, WaitWhileTheyOrTheQueueArePaused) {
  const int64_t id = Submit("wall");
  ASSERT_OK(service_->SetQueuePaused(true));
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kQueued);
  EXPECT_EQ(service_->Get(id)->waiting_reason, "the queue is paused");
  ASSERT_OK(service_->SetHeld(id, true));
  ASSERT_OK(service_->SetQueuePaused(false));
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kQueued);
  EXPECT_EQ(service_->Get(id)->waiting_reason, "paused");
  ASSERT_OK(service_->SetHeld(id, false));
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kRunning);
}

TEST_F(ServiceJobs, AForcedOneBakesOnceHoweverOftenItIsTried) {
  Publish("wall", "r0007");
  SubmitRequest request = RequestFor("wall");
  request.force = true;
  const int64_t id = service_->Submit(request)->id;
  service_->Step();
  EXPECT_FALSE(executor_.running[id].spec.skip_unchanged);
  Publish("wall", "r0008");
  Kill(id);
  clock_.Advance(1000);
  service_->Step();
  service_->Step();
  ASSERT_EQ(executor_.running.count(id), 1u);
  EXPECT_TRUE(executor_.running[id].spec.skip_unchanged);
  EXPECT_EQ(executor_.running[id].spec.force_past, "r0007");
}

TEST_F(ServiceJobs, ReportsOfOtherAttemptsAreNotHeard) {
  const int64_t id = Submit("wall");
  service_->Step();
  AttemptReport stale;
  stale.job = id;
  stale.attempt = 99;
  stale.ended = true;
  stale.result_json = R"({"exit_code": 3, "error": {"code": "x"}})";
  executor_.stray = {stale};
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kRunning);
  EXPECT_EQ(service_->GetMetrics()->stale_reports, 1);
}

TEST_F(ServiceJobs, ThatSayTheyPublishedWhatIsNotThereAreLost) {
  const int64_t id = Submit("wall");
  service_->Step();
  End(id, 0, R"({"exit_code": 0, "revision": "r0001"})");
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kRetryWaiting);
  EXPECT_EQ(Job(id).error_code, "lost");
}

TEST_F(ServiceJobs, AreNotStartedWhileTheMachineHasNoRoom) {
  executor_.start_error = Error{ErrorCode::kResourceExhausted, "no processes left"};
  const int64_t a = Submit("a"), b = Submit("b");
  service_->Step();
  EXPECT_EQ(StateOf(a), JobState::kQueued);
  EXPECT_EQ(Job(a).failures, 0);
  ASSERT_EQ(service_->GetStatus()->problems.size(), 1u);
  executor_.start_error.reset();
  clock_.Advance(1000);
  service_->Step();
  EXPECT_EQ(StateOf(a), JobState::kRunning);
  EXPECT_EQ(StateOf(b), JobState::kRunning);
  EXPECT_TRUE(service_->GetStatus()->problems.empty());
}

TEST_F(ServiceJobs, KeepTheirLogs) {
  const int64_t id = Submit("wall");
  EXPECT_EQ(service_->ReadLog(id, 0, 100)->text, "");
  service_->Step();
  std::ofstream(executor_.running[id].spec.log, std::ios::app) << "hello\n";
  const auto all = service_->ReadLog(id, 0, 1000);
  ASSERT_OK(all);
  EXPECT_NE(all->text.find("attempt 1 at "), std::string::npos);
  EXPECT_FALSE(all->complete);
  const auto tail = service_->ReadLog(id, -6, 1000);
  EXPECT_EQ(tail->text, "hello\n");
  EXPECT_EQ(tail->next_offset, all->next_offset);
  FailBadInput(id);
  const auto rest = service_->ReadLog(id, tail->next_offset, 1000);
  EXPECT_NE(rest->text.find("failed: no good"), std::string::npos);
  EXPECT_TRUE(rest->complete);
  EXPECT_EQ(service_->ReadLog(99, 0, 10).error().code, ErrorCode::kNotFound);
}

// ---- what jobs may name

TEST_F(ServiceJobs, OutsideTheRootsAreRefused) {
  std::filesystem::create_directories(folder_ / "secret");
  std::filesystem::create_directory_symlink(folder_ / "secret", folder_ / "in/link");
  for (const std::string& path :
       {folder_ / "secret", folder_ / "in/link", folder_ / "in/../secret", std::string("in/wall"),
        std::string("/"), folder_ / "in/wall/../../secret/x", folder_ / "in2"}) {
    SubmitRequest request = RequestFor("wall");
    request.job.folder = path;
    const auto refused = service_->Submit(request);
    ASSERT_FALSE(refused) << path;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(MessageOf(refused).rfind("/folder: ", 0), 0u) << MessageOf(refused);
  }
  SubmitRequest request = RequestFor("wall");
  request.job.out = folder_ / "elsewhere";
  EXPECT_EQ(MessageOf(service_->Submit(request)).rfind("/out: ", 0), 0u);
  request = RequestFor("wall");
  request.priority = 101;
  EXPECT_EQ(MessageOf(service_->Submit(request)).rfind("/priority: ", 0), 0u);
  request = RequestFor("wall");
  request.job.asset = "../x";
  EXPECT_EQ(MessageOf(service_->Submit(request)).rfind("/asset: ", 0), 0u);
}

// ---- recovery

TEST_F(ServiceRecovery, AdoptsWhatRuns) {
  const int64_t id = Submit("wall");
  service_->Step();
  Restart();
  EXPECT_EQ(StateOf(id), JobState::kRunning);
  EXPECT_EQ(service_->GetMetrics()->attempts_adopted, 1);
  Succeed(id, "wall");
  EXPECT_EQ(StateOf(id), JobState::kSucceeded);
  EXPECT_EQ(executor_.starts, 1);
}

TEST_F(ServiceRecovery, GivesUpAnAttemptThatNobodyKnowsWhenItsLeaseIsOver) {
  const int64_t id = Submit("wall");
  service_->Step();
  executor_.running.clear();
  executor_.adoptable = false;
  Restart();
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kRunning);
  clock_.Advance(61000);
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kRetryWaiting);
  EXPECT_EQ(Job(id).error_code, "lost");
}

TEST_F(ServiceRecovery, AHeartbeatKeepsTheLease) {
  const int64_t id = Submit("wall");
  service_->Step();
  const int64_t lease = Job(id).lease_ms;
  clock_.Advance(30000);
  service_->Step();
  EXPECT_GE(Job(id).lease_ms, lease + 20000);
}

TEST_F(ServiceRecovery, RemembersACancellation) {
  const int64_t id = Submit("wall");
  service_->Step();
  ASSERT_OK(service_->Cancel(id));
  Restart();
  ASSERT_EQ(executor_.running.count(id), 1u);
  EXPECT_EQ(executor_.running[id].stops, std::vector<StopMode>{StopMode::kTerminate});
  Kill(id);
  EXPECT_EQ(StateOf(id), JobState::kCancelled);
}

TEST_F(ServiceRecovery, RemovesFoldersOfJobsThatAreNotKnown) {
  std::filesystem::create_directories(folder_ / "state/jobs/777/a1");
  const int64_t id = Submit("wall");
  service_->Step();
  Restart();
  EXPECT_FALSE(std::filesystem::exists(folder_ / "state/jobs/777"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / ("state/jobs/" + std::to_string(id))));
}

// ---- stopping

TEST_F(ServiceStop, HandsBackWhatRunsTooLong) {
  const int64_t id = Submit("wall"), waiting = Submit("wall");
  service_->Step();
  service_->BeginStop();
  EXPECT_EQ(service_->Submit(RequestFor("x")).error().code, ErrorCode::kCancelled);
  EXPECT_FALSE(service_->Ready());
  service_->Step();
  EXPECT_TRUE(executor_.running[id].stops.empty());
  clock_.Advance(30000);
  service_->Step();
  EXPECT_EQ(executor_.running[id].stops, std::vector<StopMode>{StopMode::kTerminate});
  End(id, 130, R"({"exit_code": 130, "error": {"code": "cancelled", "message": "x"}})");
  service_->Step();
  EXPECT_EQ(StateOf(id), JobState::kQueued);
  EXPECT_EQ(Job(id).failures, 0);
  EXPECT_EQ(StateOf(waiting), JobState::kQueued);
}

TEST_F(ServiceStop, LetsJobsFinishWithinTheGrace) {
  const int64_t id = Submit("wall");
  service_->Step();
  service_->BeginStop();
  clock_.Advance(29000);
  Succeed(id, "wall");
  EXPECT_EQ(StateOf(id), JobState::kSucceeded);
}

TEST_F(ServiceStop, ASecondRequestDoesNotWait) {
  const int64_t id = Submit("wall");
  service_->Step();
  service_->BeginStop();
  service_->HandBackNow();
  service_->Step();
  EXPECT_EQ(executor_.running[id].stops.size(), 1u);
}

// ---- assets of drop folders

TEST_F(ServiceAssets, AreBakedOnceForEachContent) {
  EXPECT_EQ(Offer("wall", "s1"), OfferOutcome::kQueued);
  EXPECT_EQ(Offer("wall", "s1"), OfferOutcome::kUnchanged);
  service_->Step();
  EXPECT_EQ(Offer("wall", "s1"), OfferOutcome::kUnchanged);
  Succeed(1, "wall");
  EXPECT_EQ(Offer("wall", "s1"), OfferOutcome::kUnchanged);
  Restart();
  EXPECT_EQ(Offer("wall", "s1"), OfferOutcome::kUnchanged);
  EXPECT_EQ(Offer("wall", "s2"), OfferOutcome::kQueued);
  EXPECT_EQ(service_->GetAsset("wall")->state, "queued");
  EXPECT_EQ(service_->GetAsset("wall")->revision, "r0001");
}

TEST_F(ServiceAssets, WhoseContainerIsGoneAreBakedAgain) {
  Offer("wall", "s1");
  service_->Step();
  Succeed(1, "wall");
  std::filesystem::remove_all(folder_ / "out/wall");
  EXPECT_EQ(Offer("wall", "s1"), OfferOutcome::kQueued);
}

TEST_F(ServiceAssets, ThatChangeWhileTheyWaitAreBakedOnce) {
  Offer("wall", "s1");
  EXPECT_EQ(Offer("wall", "s2"), OfferOutcome::kQueued);
  EXPECT_EQ(service_->List({})->jobs.size(), 1u);
  service_->Step();
  // It may have read the old content already.
  EXPECT_EQ(Offer("wall", "s3"), OfferOutcome::kQueued);
  EXPECT_EQ(service_->List({})->jobs.size(), 2u);
}

TEST_F(ServiceAssets, OtherSettingsBakeThemAgain) {
  Offer("wall", "s1");
  service_->Step();
  Succeed(1, "wall");
  config_.job.quality = Quality::kReference;
  Restart();
  EXPECT_EQ(Offer("wall", "s1"), OfferOutcome::kQueued);
}

TEST_F(ServiceAssets, ThatFailSaySoBesideThemUntilTheyAreGood) {
  const std::string failed = folder_ / "in/wall.failed.json";
  Offer("wall", "s1");
  service_->Step();
  FailBadInput(1);
  EXPECT_NE(Text(failed).find("no good"), std::string::npos);
  EXPECT_EQ(service_->GetAsset("wall")->state, "failed");
  EXPECT_EQ(service_->GetAsset("wall")->reason, "no good");
  EXPECT_EQ(Offer("wall", "s1"), OfferOutcome::kUnchanged);
  EXPECT_EQ(Offer("wall", "s2"), OfferOutcome::kQueued);
  service_->Step();
  Succeed(2, "wall");
  EXPECT_FALSE(std::filesystem::exists(failed));
}

TEST_F(ServiceAssets, ThatFailedBeforeACrashSaySoAfterIt) {
  Offer("wall", "s1");
  service_->Step();
  FailBadInput(1);
  std::filesystem::remove(folder_ / "in/wall.failed.json");
  Restart();
  EXPECT_TRUE(std::filesystem::exists(folder_ / "in/wall.failed.json"));
}

TEST_F(ServiceAssets, ThatDisappearAreNotBaked) {
  Offer("wall", "s1");
  ASSERT_OK(service_->WithdrawAsset("wall"));
  EXPECT_EQ(StateOf(1), JobState::kCancelled);
  EXPECT_EQ(service_->GetAsset("wall")->state, "gone");
  // And when they are back:
  EXPECT_EQ(Offer("wall", "s1"), OfferOutcome::kQueued);
  EXPECT_EQ(service_->GetAsset("wall")->state, "queued");
  ASSERT_OK(service_->WithdrawAsset("never seen"));
}

TEST_F(ServiceAssets, KeepAsManyRevisionsAsAreConfigured) {
  config_.retention.revisions = 2;
  Restart();
  for (int i = 1; i <= 4; ++i) {
    Offer("wall", "s" + std::to_string(i));
    service_->Step();
    Succeed(i, "wall", "r000" + std::to_string(i));
  }
  for (int i = 1; i <= 4; ++i) {
    EXPECT_EQ(std::filesystem::exists(folder_ / ("out/wall/r000" + std::to_string(i))), i > 2) << i;
  }
  EXPECT_EQ(service_->GetMetrics()->revisions_pruned, 2);
}

// A watcher whose list of assets waits for a disk.
class StuckSource : public AssetSource {
 public:
  std::vector<PendingAsset> Pending() const override {
    asked_.set_value();
    released_.get_future().wait();
    return {};
  }
  WatchHealth Health() const override { return {}; }
  void RequestRescan() override {}

  mutable std::promise<void> asked_, released_;
};

TEST_F(ServiceAssets, AListThatWaitsForADiskDoesNotKeepBackTheMetrics) {
  StuckSource source;
  service_->AttachSource(&source);
  auto status = std::async(std::launch::async, [&] { return service_->GetStatus().has_value(); });
  source.asked_.get_future().wait();
  auto metrics = std::async(std::launch::async, [&] { return service_->GetMetrics().has_value(); });
  EXPECT_EQ(metrics.wait_for(std::chrono::seconds(30)), std::future_status::ready);
  source.released_.set_value();
  EXPECT_TRUE(status.get());
  EXPECT_TRUE(metrics.get());
  service_->AttachSource(nullptr);
}

TEST_F(ServiceAssets, NamesThatJobsCannotHoldAreRefusedWithAReason) {
  AssetOffer offer = OfferOf("odd", "s");
  offer.job.folder = folder_ / "in/\xff\xfe";
  std::filesystem::create_directories(offer.job.folder);
  const auto refused = service_->OfferAsset(offer);
  ASSERT_FALSE(refused);
  EXPECT_NE(MessageOf(refused).find("not UTF-8"), std::string::npos);
}

}  // namespace
}  // namespace patina::daemon
