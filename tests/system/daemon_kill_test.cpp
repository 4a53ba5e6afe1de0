// kill -9 of the daemon before any change of a file, and of workers at any step; then a separate
// program (daemon_checker) looks whether anything was lost, doubled or left half done.
//
// $PATINA_KILL_ROUNDS: how many rounds, 25 by default.
#include <gtest/gtest.h>
#include <signal.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/formats/test_support.h"
#include "tests/system/child_process.h"
#include "tests/system/daemon_process.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using patina::test::Random;
using testing_support::DaemonProcess;
using testing_support::Request;

constexpr int kAssets = 5;
constexpr int kLimitMs = 60000;
const char* const kSteps[] = {"begin", "staged", "verified", "fenced", "published", "reported"};

std::string AssetOf(int i) { return "asset" + std::to_string(i); }

class KillRound {
 public:
  KillRound(const std::string& folder, Random* random) : folder_(folder), random_(random) {
    fs::create_directories(folder_ + "/in");
    fs::create_directories(folder_ + "/out");
    for (int i = 0; i < kAssets; ++i) {
      const std::string input = folder_ + "/in/" + AssetOf(i);
      fs::create_directories(input);
      std::ofstream(input + "/input.png") << "input of " << AssetOf(i);
      std::ofstream behaviour(input + "/behaviour");
      behaviour << "0 ok\n";
      if (random_ == nullptr) continue;
      for (int attempt = 1; attempt <= 2; ++attempt) {
        if (random_->Below(2) == 0)
          behaviour << attempt << " die " << kSteps[random_->Below(6)] << "\n";
      }
    }
    std::ofstream(folder_ + "/config.json")
        << json{{"version", 1},
                {"state_dir", folder_ + "/state"},
                {"out", folder_ + "/out"},
                {"worker", std::string(PATINA_BIN_DIR) + "/fake_worker"},
                {"input_roots", {folder_ + "/in"}},
                {"cores", 2},
                {"limits", {{"threads", 1}, {"grace_s", 5}}},
                {"retry", {{"max_attempts", 1000}, {"base_ms", 1}, {"max_ms", 2}}},
                {"retention", {{"revisions", 1000}}},
                {"stop_grace_s", 60}};
  }

  // A daemon that kills itself before the N-th change of a file; -1: never. Until it is dead, or
  // all is done and, where it does not crash, stopped.
  void Live(int crash_at) {
    std::vector<std::string> environment;
    if (crash_at >= 0) environment.push_back("CRASH_AT=" + std::to_string(crash_at));
    DaemonProcess daemon("crashing_patinad", {"--config", folder_ + "/config.json"},
                         folder_ + "/daemon.log", environment);
    int waited = 0;
    // Each request either is answered or shows that the daemon is not there, yet or any more.
    while (!daemon.Ended(0) && (!SubmitAll() || !AllDone())) {
      waited += 5;
      ASSERT_LT(waited, kLimitMs) << "the queue does not drain: " << Log();
      if (daemon.Ended(5)) break;
    }
    if (daemon.Ended(0)) {
      EXPECT_EQ(daemon.exit_code(), 128 + SIGKILL) << Log();
      EXPECT_GE(crash_at, 0);
      ++crashes_;
      return;
    }
    daemon.Signal(SIGTERM);
    ASSERT_TRUE(daemon.Ended(kLimitMs)) << Log();
    // It may also be killed while it stops.
    EXPECT_TRUE(daemon.exit_code() == 0 || (crash_at >= 0 && daemon.exit_code() == 128 + SIGKILL))
        << daemon.exit_code() << Log();
  }

  std::string out() const { return folder_ + "/out"; }
  int crashes() const { return crashes_; }

  void Check(const std::string& reference) {
    std::ofstream acknowledged(folder_ + "/acknowledged");
    for (const auto& [i, id] : ids_) acknowledged << id << " " << AssetOf(i) << "\n";
    acknowledged.close();
    DaemonProcess checker("daemon_checker",
                          {folder_ + "/state", out(), reference, folder_ + "/acknowledged"},
                          folder_ + "/findings");
    ASSERT_TRUE(checker.Ended(kLimitMs));
    EXPECT_EQ(checker.exit_code(), 0) << testing_support::ReadAll(folder_ + "/findings") << "\n"
                                      << Log();
  }

 private:
  std::string Socket() const { return folder_ + "/state/patinad.sock"; }
  std::string Log() const { return testing_support::ReadAll(folder_ + "/daemon.log"); }

  // What is not acknowledged is submitted again, with its key. False: the daemon does not answer.
  bool SubmitAll() {
    for (int i = 0; i < kAssets; ++i) {
      if (ids_.count(i) != 0) continue;
      const json body{{"job",
                       {{"version", 1},
                        {"kind", "material"},
                        {"asset", AssetOf(i)},
                        {"folder", folder_ + "/in/" + AssetOf(i)},
                        {"out", out()}}},
                      // One that must not be taken for done because it is there already.
                      {"force", i == 0}};
      const auto answer = Request(Socket(), "POST", "/v1/jobs", body.dump(),
                                  "Idempotency-Key: key" + std::to_string(i) + "\r\n");
      if (!answer) return false;
      // 200: it was there already.
      EXPECT_TRUE(answer->status == 202 || answer->status == 200) << answer->body;
      const json parsed = json::parse(answer->body, nullptr, false);
      if (!parsed.is_object() || !parsed.contains("id")) return false;
      ids_[i] = parsed["id"].is_string() ? std::stoll(parsed["id"].get<std::string>())
                                         : parsed["id"].get<int64_t>();
    }
    return true;
  }

  bool AllDone() {
    const auto answer = Request(Socket(), "GET", "/v1/jobs?state=succeeded&limit=100");
    if (!answer || answer->status != 200) return false;
    const json parsed = json::parse(answer->body, nullptr, false);
    return parsed.is_object() && parsed.contains("jobs") && parsed["jobs"].size() == kAssets;
  }

  const std::string folder_;
  Random* random_;
  std::map<int, int64_t> ids_;
  int crashes_ = 0;
};

TEST(DaemonKill, NothingIsLostDoubledOrHalfDone) {
  const char* rounds_text = std::getenv("PATINA_KILL_ROUNDS");
  const int rounds = rounds_text != nullptr ? std::atoi(rounds_text) : 25;
  const patina::test::TemporaryDirectory folder;
  KillRound undisturbed(folder / "reference", nullptr);
  undisturbed.Live(-1);
  if (HasFatalFailure()) return;

  Random random(20260);
  int crashes = 0;
  for (int round = 0; round < rounds; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    KillRound disturbed(folder / std::to_string(round), &random);
    // The first lives of different rounds end at different points, the next ones at random.
    for (const int crash_at : {round * 17 % 400, random.Below(300), random.Below(150)}) {
      disturbed.Live(crash_at);
      if (HasFatalFailure()) return;
    }
    disturbed.Live(-1);
    if (HasFatalFailure()) return;
    disturbed.Check(undisturbed.out());
    crashes += disturbed.crashes();
    if (HasFailure()) return;
    fs::remove_all(folder / std::to_string(round));
  }
  std::printf("%d rounds, %d crashes of the daemon\n", rounds, crashes);
  EXPECT_GT(crashes, rounds);
}

}  // namespace
}  // namespace patina
