// What the watcher does where the kernel does not tell it everything.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "daemon/watch/watch_core.h"
#include "tests/daemon/watch/drop_folder_rig.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

constexpr int64_t kSettle = DropFolderRig::kSettleMs;

WatchCore::KindAt NetworkBelow(const std::string& part) {
  return [part](const std::string& path) {
    const bool network = path.find(part) != std::string::npos;
    return FileSystemKind{network ? "nfs" : "ext4", network};
  };
}

TEST(WatchLoss, MissesNothingOfABurstOf20000Creations) {
  int queued = 0;
  std::ifstream("/proc/sys/fs/inotify/max_queued_events") >> queued;
  DropFolderRig rig;
  rig.MakeFolder("brdfs");
  rig.Advance(kSettle);
  // Nobody reads meanwhile.
  for (int i = 0; i < 20000; ++i) rig.Write("brdfs/m" + std::to_string(i) + ".binary", "");
  rig.Advance(10 * kSettle);
  std::vector<std::string> names = rig.TakeReady();
  EXPECT_EQ(names.size(), 20000u);
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), 20000u);
  if (queued < 40000) {
    EXPECT_GE(rig.core->status().overflows, 1u);
  }
  rig.Advance(600 * 1000);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
}

TEST(WatchLoss, LooksAtEverythingWhenEventsAreLost) {
  DropFolderRig rig;
  rig.Write("old/albedo.png", "o");
  rig.Write("moved/albedo.png", "m");
  rig.Write("deleted/albedo.png", "d");
  rig.Advance(2 * kSettle);
  rig.TakeReady();
  rig.Write("new/albedo.png", "n");
  rig.Write("old/albedo.png", "changed");
  rig.Rename("moved", "elsewhere");
  rig.Remove("deleted");
  rig.events.lose_all = true;
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("new", "old", "elsewhere"));
  EXPECT_THAT(rig.TakeGone(), UnorderedElementsAre("moved", "deleted"));
  EXPECT_EQ(rig.core->status().overflows, 1u);
  // The folder that moved is heard of under its new name, though its watch is the old one.
  rig.Write("elsewhere/albedo.png", "changed");
  rig.Advance(kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("elsewhere"));
}

TEST(WatchLoss, PollsBeyondTheLimitOnWatchesAndSaysSo) {
  DropFolderRig rig;
  rig.events.limit = 2;
  for (const char* name : {"a", "b", "c", "d"}) rig.Write(std::string(name) + "/albedo.png", "x");
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("a", "b", "c", "d"));
  WatchStatus status = rig.core->status();
  EXPECT_EQ(status.mode, "mixed");
  EXPECT_EQ(status.folders, 5);
  EXPECT_EQ(status.folders_polled, 3);
  ASSERT_EQ(status.problems.size(), 1u);
  EXPECT_EQ(status.problems[0].code, "watch_limit");
  EXPECT_THAT(status.problems[0].cure, HasSubstr("sysctl fs.inotify.max_user_watches="));
  for (const char* name : {"a", "d"}) rig.Write(std::string(name) + "/albedo.png", "changed");
  rig.Advance(3 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("a", "d"));
  rig.events.limit = 100;
  rig.Advance(600 * 1000);
  status = rig.core->status();
  EXPECT_EQ(status.mode, "inotify");
  EXPECT_THAT(status.problems, IsEmpty());
}

TEST(WatchLoss, PollsNetworkFileSystems) {
  DropFolderRig rig({}, NetworkBelow("drop"));
  EXPECT_EQ(rig.events.watches, 0);
  EXPECT_EQ(rig.core->status().mode, "polling");
  EXPECT_EQ(rig.core->status().mode_reason, "the folder is on nfs");
  EXPECT_THAT(rig.core->status().problems, IsEmpty());
  rig.Write("wall/albedo.png", "a");
  rig.Advance(kSettle - 1);
  rig.Write("wall/normal.png", "a");
  rig.Advance(kSettle);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  rig.Advance(kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
  rig.Write("wall/albedo.png", "changed");
  rig.Write("chrome.binary", "c");
  rig.Advance(4 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("wall", "chrome"));
  rig.Remove("wall");
  rig.Remove("chrome.binary");
  rig.Advance(4 * kSettle);
  EXPECT_THAT(rig.TakeGone(), UnorderedElementsAre("wall", "chrome"));
}

TEST(WatchLoss, TakesTheConfigurationsWordForHowToWatch) {
  DropFolderRig listening([](WatchOptions* options) { options->mode = WatchMode::kInotify; },
                          NetworkBelow("drop"));
  EXPECT_EQ(listening.core->status().mode, "inotify");
  EXPECT_THAT(listening.core->status().mode_reason, HasSubstr("configuration"));
  DropFolderRig polling([](WatchOptions* options) { options->mode = WatchMode::kPolling; });
  EXPECT_EQ(polling.core->status().mode, "polling");
  polling.Write("wall/albedo.png", "a");
  polling.Advance(3 * kSettle);
  EXPECT_THAT(polling.TakeReady(), ElementsAre("wall"));
}

TEST(WatchLoss, PollsEverythingWithoutInotify) {
  test::TemporaryDirectory folder;
  WatchOptions options;
  options.root = folder.path();
  WatchCore core(options, nullptr, FileSystemKindAt);
  ASSERT_OK(core.Open(0));
  ASSERT_EQ(core.status().problems.size(), 1u);
  EXPECT_EQ(core.status().problems[0].code, "no_inotify");
  EXPECT_EQ(core.status().mode, "polling");
}

TEST(WatchLoss, WaitsForARootThatWentAway) {
  DropFolderRig rig;
  rig.Write("wall/albedo.png", "a");
  rig.Advance(2 * kSettle);
  rig.TakeReady();
  fs::rename(rig.root, rig.folder / "away");
  rig.Advance(kSettle);
  ASSERT_EQ(rig.core->status().problems.size(), 1u);
  EXPECT_EQ(rig.core->status().problems[0].code, "root_missing");
  EXPECT_THAT(rig.TakeGone(), IsEmpty());
  rig.Advance(600 * 1000);
  fs::rename(rig.folder / "away", rig.root);
  rig.Advance(10 * kSettle);
  EXPECT_THAT(rig.core->status().problems, IsEmpty());
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
}

TEST(WatchLoss, StopsAtItsLimitOfFoldersAndSaysSo) {
  DropFolderRig rig([](WatchOptions* options) { options->max_folders = 3; });
  for (int i = 0; i < 6; ++i) rig.Write(std::to_string(i) + "/albedo.png", "x");
  rig.Advance(2 * kSettle);
  EXPECT_EQ(rig.TakeReady().size(), 2u);
  ASSERT_EQ(rig.core->status().problems.size(), 1u);
  EXPECT_EQ(rig.core->status().problems[0].code, "too_many_folders");
}

TEST(WatchLoss, KeepsUpWithEventsWhileItLooksAtEverything) {
  DropFolderRig rig;
  for (int i = 0; i < 500; ++i) rig.Write("s" + std::to_string(i) + "/albedo.png", "x");
  // One part of the look, then changes to what was and what was not looked at.
  rig.core->OnTime(rig.now_ns);
  rig.Rename("s0", "r0");
  rig.Rename("s499", "r499");
  rig.Remove("s1");
  rig.Remove("s498");
  rig.Advance(3 * kSettle);
  const std::vector<std::string> names = rig.TakeReady();
  EXPECT_EQ(names.size(), 498u);
  EXPECT_THAT(names, ::testing::IsSupersetOf({"r0", "r499", "s2", "s497"}));
  EXPECT_EQ(rig.core->assets(rig.now_ns).size(), 498u);
}

}  // namespace
}  // namespace patina::daemon
