#include "formats/base/file_io.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cerrno>
#include <filesystem>

#include "tests/formats/test_support.h"

namespace patina {
namespace {

using test::TemporaryDirectory;

int CountEntries(const std::string& directory) {
  int count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(directory)) ++count;
  return count;
}

TEST(ReadFile, RespectsTheLimit) {
  const TemporaryDirectory directory;
  ASSERT_OK(WriteFileDurably(directory / "f", std::string_view("12345")));
  EXPECT_EQ(ReadTextFile(directory / "f", 5).value(), "12345");
  EXPECT_EQ(ReadFile(directory / "f", 4).error().code, ErrorCode::kOutOfRange);
}

TEST(ReadFile, RefusesWhatIsNotAFile) {
  const TemporaryDirectory directory;
  EXPECT_EQ(ReadFile(directory / "absent", 9).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadFile(directory.path(), 9).error().code, ErrorCode::kInvalidArgument);
  ASSERT_EQ(mkfifo((directory / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(ReadFile(directory / "pipe", 9).error().code, ErrorCode::kInvalidArgument);
}

TEST(WriteFileDurably, ReplacesTheContentAndLeavesNothingElse) {
  const TemporaryDirectory directory;
  ASSERT_OK(WriteFileDurably(directory / "f", std::string_view("old content")));
  ASSERT_OK(WriteFileDurably(directory / "f", std::string_view("new")));
  EXPECT_EQ(ReadTextFile(directory / "f", 100).value(), "new");
  EXPECT_EQ(CountEntries(directory.path()), 1);
}

TEST(WriteFileDurably, KeepsTheOldContentWhenTheDiskIsFull) {
  class FullDisk : public FileSystem {
   public:
    int WriteSynced(const std::string& path, std::span<const uint8_t> bytes) override {
      RealFileSystem().WriteSynced(path, bytes.first(bytes.size() / 2));
      return ENOSPC;
    }
    int Sync(const std::string& path) override { return RealFileSystem().Sync(path); }
    int MakeDirectory(const std::string& path) override {
      return RealFileSystem().MakeDirectory(path);
    }
    int Rename(const std::string& from, const std::string& to) override {
      return RealFileSystem().Rename(from, to);
    }
    int RenameNew(const std::string& from, const std::string& to) override {
      return RealFileSystem().RenameNew(from, to);
    }
    int MakeSymlink(const std::string& target, const std::string& path) override {
      return RealFileSystem().MakeSymlink(target, path);
    }
    int RemoveFile(const std::string& path) override { return RealFileSystem().RemoveFile(path); }
  } full;
  const TemporaryDirectory directory;
  ASSERT_OK(WriteFileDurably(directory / "f", std::string_view("old")));
  const auto status = WriteFileDurably(directory / "f", std::string_view("new"), full);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kResourceExhausted);
  EXPECT_NE(status.error().message.find("space"), std::string::npos);
  EXPECT_EQ(ReadTextFile(directory / "f", 100).value(), "old");
  EXPECT_EQ(CountEntries(directory.path()), 1);
}

TEST(WriteFileDurably, SaysWhyItCannotWrite) {
  const TemporaryDirectory directory;
  const auto status = WriteFileDurably(directory / "no/such/folder", std::string_view("x"));
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kNotFound);
  EXPECT_NE(status.error().message.find("no/such/folder"), std::string::npos);
}

TEST(RenameNew, DoesNotReplace) {
  const TemporaryDirectory directory;
  ASSERT_OK(WriteFileDurably(directory / "a", std::string_view("a")));
  ASSERT_OK(WriteFileDurably(directory / "b", std::string_view("b")));
  EXPECT_EQ(RealFileSystem().RenameNew(directory / "a", directory / "b"), EEXIST);
  EXPECT_EQ(RealFileSystem().RenameNew(directory / "a", directory / "c"), 0);
}

TEST(MakeDirectories, MakesParentsAndAcceptsExistingOnes) {
  const TemporaryDirectory directory;
  ASSERT_OK(MakeDirectories(directory / "a/b/c/"));
  ASSERT_OK(MakeDirectories(directory / "a/b/c"));
  EXPECT_TRUE(std::filesystem::is_directory(directory / "a/b/c"));
  ASSERT_OK(WriteFileDurably(directory / "file", std::string_view("x")));
  EXPECT_EQ(MakeDirectories(directory / "file").error().code, ErrorCode::kConflict);
  EXPECT_FALSE(MakeDirectories(directory / "file/below").has_value());
}

}  // namespace
}  // namespace patina
