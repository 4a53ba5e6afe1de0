// The N-th file call of the daemon fails, and where wanted all that follow, for every N.
#include "tests/daemon/service/service_support.h"

namespace patina::daemon {
namespace {

// A whole life with one good and one bad asset.
class ServiceFailure : public test::ServiceTest, public testing::WithParamInterface<bool> {};

TEST_P(ServiceFailure, LosesNothingAndGoesOn) {
  for (int fail_at = 0;; ++fail_at) {
    SCOPED_TRACE(fail_at);
    const patina::test::TemporaryDirectory folder;
    std::filesystem::create_directories(folder / "in/good");
    std::filesystem::create_directories(folder / "in/bad");
    std::filesystem::create_directories(folder / "state/jobs");
    std::filesystem::create_directories(folder / "out");
    Config config = config_;
    config.state_dir = folder / "state";
    config.out = folder / "out";
    config.watch[0].path = folder / "in";
    config.retry.max_attempts = 100;
    test::FailingFileCalls files(fail_at, GetParam());
    test::FakeExecutor executor;
    auto store = JobStore::Open(folder / "state/queue.db");
    ASSERT_OK(store);
    auto service = DaemonService::Create({**store, executor, files, clock_, NoLog()}, config, 1);
    ASSERT_OK(service);
    std::vector<int64_t> ids;
    for (const char* asset : {"good", "bad"}) {
      AssetOffer offer;
      offer.job.asset = asset;
      offer.job.folder = folder / ("in/" + std::string(asset));
      offer.signature = "s";
      offer.failed_folder = folder / "in";
      const auto outcome = (*service)->OfferAsset(offer);
      ASSERT_OK(outcome);
    }
    bool reached = false;
    bool done = false;
    for (int step = 0; step < 200 && !done; ++step) {
      (*service)->Step();
      for (auto& [job, attempt] : executor.running) {
        AttemptReport end;
        const std::string asset = attempt.spec.asset;
        if (asset == "good") {
          std::filesystem::create_directories(folder / "out/good/r0001");
          std::ofstream(folder / "out/good/r0001/manifest.json") << "{}";
          std::filesystem::remove(folder / "out/good/current");
          std::filesystem::create_symlink("r0001", folder / "out/good/current");
          end.result_json = R"({"exit_code": 0, "revision": "r0001"})";
        } else {
          end.result_json =
              R"({"exit_code": 3, "error": {"code": "corrupt_data", "message": "m"}})";
        }
        attempt.end = end;
      }
      clock_.Advance(70000);
      reached = reached || files.calls() > fail_at;
      // A disk that stays full gets its space back after a while.
      if (step == 20) files.Mend();
      const auto counts = (*service)->GetStatus();
      ASSERT_OK(counts);
      done =
          counts->counts.of(JobState::kSucceeded) == 1 && counts->counts.of(JobState::kFailed) == 1;
    }
    EXPECT_TRUE(done);
    // What could not be written beside the asset is written by the next daemon.
    const std::string failed = folder / "in/bad.failed.json";
    if (!std::filesystem::exists(failed)) {
      service->reset();
      files.Mend();
      service = DaemonService::Create({**store, executor, files, clock_, NoLog()}, config, 1);
      ASSERT_OK(service);
    }
    EXPECT_TRUE(std::filesystem::exists(failed));
    if (!reached) break;
    ASSERT_LT(fail_at, 1000);
  }
}

INSTANTIATE_TEST_SUITE_P(OneOrAll, ServiceFailure, testing::Bool());

}  // namespace
}  // namespace patina::daemon
