#include "daemon/watch/asset_files.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "daemon/watch/file_system_kind.h"
#include "formats/base/file_io.h"
#include "pipeline/jobs/job.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

TEST(AssetFiles, KnowsRolesByName) {
  EXPECT_EQ(RoleOfFile("wall_albedo.PNG"), FileRole::kImage);
  EXPECT_EQ(RoleOfFile("car.glb"), FileRole::kImage);
  EXPECT_EQ(RoleOfFile("car.GLTF"), FileRole::kImage);
  EXPECT_EQ(RoleOfFile("car.patina.json"), FileRole::kImage);
  EXPECT_EQ(RoleOfFile("chrome.binary"), FileRole::kBrdf);
  EXPECT_EQ(RoleOfFile("list.csv"), FileRole::kBrdf);
  EXPECT_EQ(RoleOfFile("albedo.png.part"), FileRole::kOther);
  EXPECT_EQ(RoleOfFile(".albedo.png"), FileRole::kOther);
  EXPECT_EQ(RoleOfFile("wall.failed.json"), FileRole::kNone);
  EXPECT_EQ(RoleOfFile(".DS_Store"), FileRole::kNone);
  EXPECT_EQ(RoleOfFile("._albedo.png"), FileRole::kNone);
  EXPECT_EQ(RoleOfFile(""), FileRole::kOther);
}

TEST(AssetFiles, TellsWhetherSomebodyIsWriting) {
  test::TemporaryDirectory folder;
  const std::string path = folder / "file";
  ASSERT_OK(WriteFileDurably(path, std::string_view("x")));
  const WriterState quiet = WriterOf(path);
  if (quiet == WriterState::kUnknown) GTEST_SKIP() << "not on this file system";
  EXPECT_EQ(quiet, WriterState::kNone);
  const int reader = open(path.c_str(), O_RDONLY);
  EXPECT_EQ(WriterOf(path), WriterState::kNone);
  const int writer = open(path.c_str(), O_WRONLY);
  EXPECT_EQ(WriterOf(path), WriterState::kOpen);
  close(writer);
  close(reader);
  EXPECT_EQ(WriterOf(path), WriterState::kNone);
  EXPECT_EQ(WriterOf(folder / "missing"), WriterState::kUnknown);
}

TEST(AssetFiles, ListsEntriesInOrderOfTheirBytes) {
  test::TemporaryDirectory folder;
  for (const char* name : {"b", "a", "\xFF", "a\n"})
    ASSERT_OK(WriteFileDurably(folder / name, std::string_view("x")));
  ASSERT_EQ(symlink("missing", (folder / "link").c_str()), 0);
  const auto entries = ListEntries(folder.path());
  ASSERT_OK(entries);
  ASSERT_EQ(entries->size(), 5u);
  EXPECT_EQ((*entries)[0].name, "a");
  EXPECT_EQ((*entries)[1].name, "a\n");
  EXPECT_EQ((*entries)[3].name, "link");
  EXPECT_TRUE((*entries)[3].is_link);
  EXPECT_EQ((*entries)[3].kind, Entry::Kind::kOther);
  EXPECT_EQ((*entries)[4].name, "\xFF");
  EXPECT_EQ(ListEntries(folder / "missing").error().code, ErrorCode::kNotFound);
}

TEST(FileSystemKind, KnowsNetworkFileSystems) {
  EXPECT_EQ(FileSystemKindOf(0x6969).name, "nfs");
  EXPECT_TRUE(FileSystemKindOf(0x6969).network);
  // As a 32-bit number it is negative.
  EXPECT_EQ(FileSystemKindOf(static_cast<int32_t>(0xFE534D42)).name, "smb");
  EXPECT_TRUE(FileSystemKindOf(0x65735546).network);
  EXPECT_FALSE(FileSystemKindOf(0xEF53).network);
  EXPECT_EQ(FileSystemKindOf(0x12345678).name, "0x12345678");
  EXPECT_FALSE(FileSystemKindOf(0x12345678).network);
  EXPECT_EQ(FileSystemKindAt("/nowhere/at/all").error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace patina::daemon
