#include "daemon/watch/watch_core.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "formats/base/file_io.h"
#include "pipeline/jobs/job.h"
#include "tests/daemon/watch/drop_folder_rig.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

constexpr int64_t kSettle = DropFolderRig::kSettleMs;

TEST(WatchCore, OffersAFolderOnceTheSettleTimeAfterItsLastFile) {
  DropFolderRig rig;
  rig.Step();
  rig.Write("wall/albedo.png", "a");
  rig.Advance(500);
  rig.Write("wall/normal.png", "n");
  rig.Advance(kSettle - 1);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  EXPECT_EQ(rig.Asset("wall").state, AssetState::kChanging);
  EXPECT_THAT(rig.Asset("wall").reason, HasSubstr("\"normal.png\" changed 1.9 s ago"));
  rig.Advance(1);
  ASSERT_EQ(rig.ready.size(), 1u);
  EXPECT_EQ(rig.ready[0].name, "wall");
  EXPECT_EQ(rig.ready[0].path, rig.Path("wall"));
  EXPECT_FALSE(rig.ready[0].is_file);
  EXPECT_EQ(rig.ready[0].files, 2);
  EXPECT_EQ(rig.ready[0].bytes, 2u);
  EXPECT_EQ(rig.Asset("wall").state, AssetState::kReady);
  EXPECT_EQ(rig.Asset("wall").reason, "");
  rig.TakeReady();
  rig.Advance(3600 * 1000);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
}

TEST(WatchCore, FindsAtItsStartWhatWasThereBefore) {
  DropFolderRig rig;
  rig.Write("a/albedo.png", "a");
  rig.Write("deep/er/b/albedo.png", "b");
  rig.Write("chrome.binary", "c");
  rig.Write("notes.txt", "n");
  rig.MakeFolder("empty");
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("a", "deep_er_b", "chrome"));
  EXPECT_EQ(rig.core->status().mode, "inotify");
  EXPECT_THAT(rig.core->status().problems, IsEmpty());
}

TEST(WatchCore, MakesOneOfCopyRenameAndCloseAfterWriting) {
  DropFolderRig rig;
  rig.Step();
  rig.Write("wall/.albedo.png.Xy12", "part");
  rig.Advance(1000);
  rig.Rename("wall/.albedo.png.Xy12", "wall/albedo.png");
  rig.Write("wall/normal.png", "n");
  rig.Advance(20 * kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
}

TEST(WatchCore, WaitsForAWriterWhoTakesAMinute) {
  DropFolderRig rig;
  rig.Step();
  rig.Write("wall/albedo.png", "a");
  for (int second = 0; second < 60; ++second) {
    const int fd = open(rig.Path("wall/albedo.png").c_str(), O_WRONLY | O_APPEND);
    ASSERT_EQ(write(fd, "x", 1), 1);
    close(fd);
    rig.Advance(1000);
    ASSERT_THAT(rig.TakeReady(), IsEmpty()) << second;
  }
  rig.Advance(1000);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
}

TEST(WatchCore, WaitsForAWriterWhoPausesForHours) {
  DropFolderRig rig;
  rig.Step();
  rig.Write("chrome.binary", "");
  const int fd = open(rig.Path("chrome.binary").c_str(), O_WRONLY);
  ASSERT_EQ(write(fd, "half", 4), 4);
  if (WriterOf(rig.Path("chrome.binary")) == WriterState::kUnknown) {
    close(fd);
    GTEST_SKIP() << "this file system does not say who is writing";
  }
  rig.Advance(3 * 3600 * 1000);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  EXPECT_EQ(rig.Asset("chrome").state, AssetState::kOpen);
  EXPECT_THAT(rig.Asset("chrome").reason, HasSubstr("still open for writing"));
  ASSERT_EQ(write(fd, "half", 4), 4);
  close(fd);
  rig.Advance(kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("chrome"));
}

TEST(WatchCore, WaitsForAFileThatIsWrittenThroughAMapping) {
  DropFolderRig rig;
  rig.Write("chrome.binary", "0123456789");
  const int fd = open(rig.Path("chrome.binary").c_str(), O_RDWR);
  void* mapped = mmap(nullptr, 10, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  close(fd);
  ASSERT_NE(mapped, MAP_FAILED);
  if (WriterOf(rig.Path("chrome.binary")) == WriterState::kUnknown)
    GTEST_SKIP() << "this file system does not say who is writing";
  rig.Advance(100 * kSettle);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  munmap(mapped, 10);
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("chrome"));
}

TEST(WatchCore, WaitsForAPreallocatedFileToBeFilled) {
  DropFolderRig rig;
  rig.Step();
  const int size = 1 << 16;
  ASSERT_EQ(truncate((rig.Write("wall/albedo.png", ""), rig.Path("wall/albedo.png").c_str()), size),
            0);
  for (int part = 0; part < 16; ++part) {
    const int fd = open(rig.Path("wall/albedo.png").c_str(), O_WRONLY);
    ASSERT_EQ(pwrite(fd, "x", 1, part * 4096), 1);
    close(fd);
    rig.Advance(kSettle - 1);
    ASSERT_THAT(rig.TakeReady(), IsEmpty()) << part;
  }
  rig.Advance(1);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
}

TEST(WatchCore, SeesChangesThatNoEventTellsOf) {
  DropFolderRig rig;
  rig.Step();
  rig.Write("wall/albedo.png", "a");
  rig.Advance(1000);
  rig.events.deaf = true;
  rig.Write("wall/albedo.png", "ab");
  rig.Advance(1000);  // the settle time after the event is over
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  rig.Advance(kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
  rig.Write("wall/albedo.png", "abc");
  rig.Advance(600 * 1000 + 2 * kSettle);  // a look at everything finds it
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
}

TEST(WatchCore, OffersOnlyTheAssetOfAChangedMapAgain) {
  DropFolderRig rig;
  rig.Write("a/albedo.png", "a");
  rig.Write("b/albedo.png", "b");
  rig.Advance(2 * kSettle);
  ASSERT_EQ(rig.ready.size(), 2u);
  const std::string token = rig.ready[0].token;
  rig.TakeReady();
  rig.Write("a/albedo.png", "A");
  rig.Advance(kSettle);
  ASSERT_EQ(rig.ready.size(), 1u);
  EXPECT_EQ(rig.ready[0].name, "a");
  EXPECT_NE(rig.ready[0].token, token);
}

TEST(WatchCore, OffersASceneAgainWhenATextureBelowItChanges) {
  DropFolderRig rig;
  rig.Write("shop/shop.gltf", "{}");
  rig.Write("shop/textures/wood/albedo.png", "a");
  rig.Write("other/albedo.png", "o");
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("shop", "shop_textures_wood", "other"));
  rig.Advance(10 * kSettle);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  rig.Write("shop/textures/wood/albedo.png", "A");
  rig.Advance(kSettle - 1);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  rig.Advance(kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("shop", "shop_textures_wood"));
  // A folder that is taken away, and one that no event tells of.
  rig.Rename("shop/textures/wood", "other/wood");
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("shop", "other_wood"));
  rig.events.deaf = true;
  rig.Write("shop/textures/stone/albedo.png", "s");
  rig.Advance(600 * 1000 + 2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("shop", "shop_textures_stone"));
}

TEST(WatchCore, WaitsForTexturesBelowAScene) {
  DropFolderRig rig;
  rig.Step();
  rig.Write("shop/shop.gltf", "{}");
  for (int i = 0; i < 5; ++i) {
    rig.Advance(kSettle - 500);
    rig.Write("shop/textures/map" + std::to_string(i) + ".png", "x");
  }
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("shop", "shop_textures"));
}

TEST(WatchCore, OffersAFileReplacedByRename) {
  DropFolderRig rig;
  rig.Write("chrome.binary", "old");
  rig.Advance(2 * kSettle);
  rig.TakeReady();
  // Of the same size and time, as a careful copy is.
  const auto time = fs::last_write_time(rig.Path("chrome.binary"));
  rig.Write("chrome.tmp", "new");
  fs::last_write_time(rig.Path("chrome.tmp"), time);
  rig.Advance(1);
  rig.Rename("chrome.tmp", "chrome.binary");
  rig.Advance(kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("chrome"));
  EXPECT_THAT(rig.TakeGone(), IsEmpty());
}

TEST(WatchCore, ForgetsWhatIsDeletedBeforeItIsReady) {
  DropFolderRig rig;
  rig.Step();
  rig.Write("wall/albedo.png", "a");
  rig.Write("chrome.binary", "c");
  rig.Advance(1000);
  rig.Remove("wall");
  rig.Remove("chrome.binary");
  rig.Advance(10 * kSettle);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  EXPECT_THAT(rig.TakeGone(), IsEmpty());
  EXPECT_THAT(rig.core->assets(rig.now_ns), IsEmpty());
}

TEST(WatchCore, TellsWhatIsGone) {
  DropFolderRig rig;
  rig.Write("wall/albedo.png", "a");
  rig.Write("floor/albedo.png", "a");
  rig.Write("group/stone/albedo.png", "a");
  rig.Write("chrome.binary", "c");
  rig.Advance(2 * kSettle);
  EXPECT_EQ(rig.TakeReady().size(), 4u);
  rig.Remove("wall");
  rig.Remove("floor/albedo.png");
  rig.Remove("chrome.binary");
  rig.Rename("group", "new group");
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeGone(), UnorderedElementsAre("wall", "floor", "chrome", "group_stone"));
  EXPECT_THAT(rig.TakeReady(), ElementsAre("new_group_stone"));
}

TEST(WatchCore, FollowsFoldersThatMove) {
  DropFolderRig rig;
  rig.Step();
  const std::string outside = rig.folder / "outside";
  fs::create_directories(outside + "/wall");
  rig.Write("../outside/wall/albedo.png", "a");
  fs::rename(outside + "/wall", rig.Path("wall"));
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
  rig.Rename("wall", "tower");
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("tower"));
  rig.Write("tower/albedo.png", "changed");  // heard under its new name
  rig.Advance(kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("tower"));
  rig.TakeGone();
  fs::rename(rig.Path("tower"), outside + "/tower");
  rig.Write("../outside/tower/albedo.png", "out of sight");
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeGone(), ElementsAre("tower"));
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  EXPECT_EQ(rig.events.watches, 1);
}

TEST(WatchCore, FindsWhatIsWrittenIntoFoldersBeforeTheyAreWatched) {
  DropFolderRig rig;
  rig.Step();
  rig.Write("a/b/c/d/albedo.png", "a");  // the events of a's content have no listener
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("a_b_c_d"));
}

TEST(WatchCore, FollowsNoLinkOutOfTheRoot) {
  DropFolderRig rig;
  const std::string outside = rig.folder / "outside";
  fs::create_directories(outside);
  rig.Write("../outside/albedo.png", "secret");
  rig.Write("../outside/secret.binary", "secret");
  fs::create_directory_symlink(outside, rig.Path("linked"));
  fs::create_directory_symlink(rig.root, rig.Path("loop"));
  fs::create_symlink(outside + "/secret.binary", rig.Path("secret.binary"));
  fs::create_symlink("nowhere", rig.Path("dangling.binary"));
  rig.MakeFolder("wall");
  fs::create_symlink(outside + "/albedo.png", rig.Path("wall/albedo.png"));
  rig.Write("floor/albedo.png", "mine");
  rig.MakeFolder("roof");
  fs::create_symlink(rig.Path("floor/albedo.png"), rig.Path("roof/albedo.png"));
  rig.Advance(10 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("floor", "roof"));
  const std::vector<std::string> passed_over = rig.core->status().passed_over;
  EXPECT_THAT(passed_over, ::testing::Contains(HasSubstr("linked\": a link to a folder")));
  EXPECT_THAT(passed_over,
              ::testing::Contains(HasSubstr("secret.binary\": a link that leads out")));
  EXPECT_THAT(passed_over, ::testing::Contains(HasSubstr("wall/albedo.png\": a link that leads")));
}

TEST(WatchCore, PassesOverTheOutputFolderAndContainers) {
  std::string out;
  DropFolderRig rig([&](WatchOptions* options) {
    out = options->root + "/baked";  // not there yet
    options->exclude = {out, ""};
  });
  rig.Write("wall/albedo.png", "a");
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
  const uint64_t events = rig.core->status().events;
  for (const char* folder : {"baked/wall/r1", "old/wall/r1"}) {
    rig.Write(std::string(folder) + "/manifest.json", "{}");
    rig.Write(std::string(folder) + "/decoder.weights", "w");
    rig.Write(std::string(folder) + "/preview.png", "p");
  }
  rig.Write("baked/wall/albedo.png", "p");
  rig.Write("wall.failed.json", "{}");
  rig.Write("wall/wall.failed.json", "{}");
  rig.Advance(1200 * 1000);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
  EXPECT_EQ(rig.core->assets(rig.now_ns).size(), 1u);
  EXPECT_GT(rig.core->status().events, events);
  EXPECT_THAT(rig.core->status().passed_over,
              ::testing::Contains(HasSubstr("old/wall/r1\": a container")));
}

TEST(WatchCore, RefusesARootThatIsAlsoTheOutput) {
  test::TemporaryDirectory folder;
  RiggedEvents events;
  WatchOptions options;
  options.root = folder.path();
  options.exclude = {folder.path() + "/./"};
  WatchCore core(options, &events, FileSystemKindAt);
  EXPECT_THAT(test::MessageOf(core.Open(0)), HasSubstr("both watched and written to"));
}

TEST(WatchCore, RefusesARootThatIsNoFolder) {
  test::TemporaryDirectory folder;
  RiggedEvents events;
  WatchOptions options;
  options.root = folder / "missing";
  WatchCore missing(options, &events, FileSystemKindAt);
  EXPECT_EQ(missing.Open(0).error().code, ErrorCode::kNotFound);
  ASSERT_OK(WriteFileDurably(folder / "file", std::string_view("x")));
  options.root = folder / "file";
  WatchCore file(options, &events, FileSystemKindAt);
  EXPECT_EQ(file.Open(0).error().code, ErrorCode::kInvalidArgument);
}

TEST(WatchCore, TakesNamesOfEveryByte) {
  DropFolderRig rig;
  rig.Step();
  size_t count = 0;
  for (int byte = 1; byte < 256; ++byte) {
    if (byte == '/' || byte == ' ') continue;  // "x y" has the name of "x_y"
    const std::string odd(1, static_cast<char>(byte));
    rig.Write("x" + odd + "y/albedo.png", "a");
    rig.Write("x" + odd + "z.binary", "b");
    count += 2;
  }
  rig.Advance(2 * kSettle);
  std::vector<std::string> names = rig.TakeReady();
  EXPECT_EQ(names.size(), count);
  for (const std::string& name : names) EXPECT_TRUE(IsAssetName(name)) << name;
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::unique(names.begin(), names.end()), names.end());
}

TEST(WatchCore, TellsMeasurementsFromOtherFilesByTheirContent) {
  DropFolderRig rig;
  rig.Write("list.json", "{\"samples\": []}");
  rig.Write("settings.json", "{\"a\": 1}");
  rig.Write("mesh.bin", "mesh");
  rig.Write("table.csv", "a,b,c\n");
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("list"));
  EXPECT_EQ(rig.core->assets(rig.now_ns).size(), 1u);
  rig.Write("settings.json", "{\"samples\": []}");
  rig.Advance(kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("settings"));
}

TEST(WatchCore, OffersMapsAndMeasurementsOfAFolderApart) {
  DropFolderRig rig;
  rig.Step();
  rig.Write("lab/albedo.png", "a");
  rig.Write("lab/chrome.binary", "c");
  rig.Advance(1000);
  rig.Write("lab/gold.binary", "g");
  rig.Advance(1000);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("lab", "lab_chrome"));
  rig.Advance(1000);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("lab_gold"));
}

TEST(WatchCore, OffersLayersAsPartOfTheFolderThatHoldsTheirMaps) {
  DropFolderRig rig;
  rig.Write("lab/wood.png", "w");
  rig.Write("lab/lacquer.layers.json", R"({"base": {"albedo": {"map": "wood.png"}}})");
  rig.Write("lab/plain.layers.json", R"({"base": {"albedo": 0.5}})");
  rig.Advance(3 * kSettle);
  EXPECT_THAT(rig.TakeReady(), UnorderedElementsAre("lab", "lab_plain"));
  rig.Write("lab/wood.png", "W");
  rig.Advance(3 * kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("lab"));
  // No image changes, and the folder is another one.
  rig.Write("lab/lacquer.layers.json", R"({"base": {"albedo": {"map": "wood.png", "scale": 1}}})");
  rig.Advance(4 * kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("lab"));
}

TEST(WatchCore, OffersAgainWhatCouldNotBeHandedOver) {
  DropFolderRig rig;
  rig.refuse = true;
  rig.Write("wall/albedo.png", "a");
  rig.Advance(2 * kSettle);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
  EXPECT_EQ(rig.Asset("wall").state, AssetState::kOffered);
  EXPECT_THAT(rig.Asset("wall").reason, HasSubstr("the disk is full"));
  EXPECT_EQ(rig.core->status().assets_waiting, 1);
  rig.refuse = false;
  rig.Advance(10000);
  EXPECT_THAT(rig.TakeReady(), ElementsAre("wall"));
  EXPECT_EQ(rig.Asset("wall").state, AssetState::kReady);
  rig.Advance(100000);
  EXPECT_THAT(rig.TakeReady(), IsEmpty());
}

TEST(WatchCore, SleepsWhileNothingHappens) {
  DropFolderRig rig;
  rig.Write("wall/albedo.png", "a");
  rig.Advance(10 * kSettle);
  // Nothing but the next look at everything.
  EXPECT_GT(rig.core->NextDeadline() - rig.now_ns, int64_t{500} * 1000000000);
}

}  // namespace
}  // namespace patina::daemon
