#include "daemon/watch/watcher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>

#include "formats/base/file_io.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

// What the watcher's thread has told, for the test's thread to wait for.
class Told {
 public:
  WatchHandlers Handlers() {
    WatchHandlers handlers;
    handlers.on_ready = [this](const ReadyAsset& asset) { return Note("ready " + asset.name); };
    handlers.on_gone = [this](const ReadyAsset& asset) { (void)Note("gone " + asset.name); };
    handlers.on_scanned = [this] { (void)Note("scanned"); };
    return handlers;
  }

  bool WaitFor(const std::string& line) {
    std::unique_lock<std::mutex> lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(60), [&] {
      return std::find(lines_.begin(), lines_.end(), line) != lines_.end();
    });
  }

 private:
  Status Note(const std::string& line) {
    const std::lock_guard<std::mutex> lock(mutex_);
    lines_.push_back(line);
    changed_.notify_all();
    return {};
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> lines_;
};

TEST(Watcher, TellsOfWhatComesAndGoes) {
  test::TemporaryDirectory folder;
  ASSERT_OK(WriteFileDurably(folder / "old.binary", std::string_view("x")));
  Told told;
  WatchOptions options;
  options.root = folder.path();
  options.settle_ms = 20;
  auto watcher = Watcher::Start(options, told.Handlers());
  ASSERT_OK(watcher);
  EXPECT_TRUE(told.WaitFor("scanned"));
  EXPECT_TRUE(told.WaitFor("ready old"));
  ASSERT_OK(MakeDirectories(folder / "wall"));
  ASSERT_OK(WriteFileDurably(folder / "wall/albedo.png", std::string_view("x")));
  EXPECT_TRUE(told.WaitFor("ready wall"));
  EXPECT_EQ((*watcher)->status().root, folder.path());
  EXPECT_EQ((*watcher)->assets().size(), 2u);
  ASSERT_EQ(unlink((folder / "old.binary").c_str()), 0);
  EXPECT_TRUE(told.WaitFor("gone old"));
}

TEST(Watcher, StopsWhileAssetsWait) {
  test::TemporaryDirectory folder;
  Told told;
  WatchOptions options;
  options.root = folder.path();
  options.settle_ms = 3600 * 1000;
  auto watcher = Watcher::Start(options, told.Handlers());
  ASSERT_OK(watcher);
  ASSERT_OK(WriteFileDurably(folder / "wall.binary", std::string_view("x")));
  (*watcher)->RequestRescan();
  watcher->reset();
}

TEST(Watcher, RefusesAMissingFolder) {
  WatchOptions options;
  options.root = "/nowhere/at/all";
  EXPECT_EQ(Watcher::Start(options, {}).error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace patina::daemon
