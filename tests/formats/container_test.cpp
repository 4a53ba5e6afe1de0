#include "formats/container.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <memory>

#include "formats/base/sha256.h"
#include "tests/formats/sample_container.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using test::StageSample;
using test::TemporaryDirectory;

std::vector<std::string> Entries(const std::string& directory) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(directory, ignored))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

Result<PublishedContainer> PublishSample(const std::string& out, uint64_t seed) {
  PATINA_ASSIGN(StagingArea staging, StageSample(out, "asset", seed));
  return staging.Publish();
}

// Passes calls on, except that the one with the number `fail_at` fails, or all from there on.
class FailingFileSystem : public FileSystem {
 public:
  FailingFileSystem(int fail_at, bool and_all_after, int error)
      : fail_at_(fail_at), and_all_after_(and_all_after), error_(error) {}
  int calls() const { return calls_; }

  int WriteSynced(const std::string& path, std::span<const uint8_t> bytes) override {
    if (!Fails()) return RealFileSystem().WriteSynced(path, bytes);
    // A full disk leaves a part of the file.
    RealFileSystem().WriteSynced(path, bytes.first(bytes.size() / 2));
    return error_;
  }
  int Sync(const std::string& path) override {
    return Fails() ? error_ : RealFileSystem().Sync(path);
  }
  int MakeDirectory(const std::string& path) override {
    return Fails() ? error_ : RealFileSystem().MakeDirectory(path);
  }
  int Rename(const std::string& from, const std::string& to) override {
    return Fails() ? error_ : RealFileSystem().Rename(from, to);
  }
  int RenameNew(const std::string& from, const std::string& to) override {
    return Fails() ? error_ : RealFileSystem().RenameNew(from, to);
  }
  int MakeSymlink(const std::string& target, const std::string& path) override {
    return Fails() ? error_ : RealFileSystem().MakeSymlink(target, path);
  }
  int RemoveFile(const std::string& path) override {
    return Fails() ? error_ : RealFileSystem().RemoveFile(path);
  }

 private:
  bool Fails() {
    ++calls_;
    return and_all_after_ ? calls_ >= fail_at_ : calls_ == fail_at_;
  }
  int fail_at_;
  bool and_all_after_;
  int error_;
  int calls_ = 0;
};

TEST(Container, IsPublishedWithEverythingInPlace) {
  const TemporaryDirectory out;
  const auto published = PublishSample(out.path(), 1);
  ASSERT_OK(published);
  EXPECT_EQ(published->revision, "r0001");
  EXPECT_EQ(published->directory, out / "asset/r0001");
  EXPECT_EQ(published->warning, "");
  EXPECT_EQ(Entries(out / "asset"), (std::vector<std::string>{".lock", "current", "r0001"}));
  EXPECT_EQ(Entries(published->directory),
            (std::vector<std::string>{"decoder.weights", "features_0.dds", "features_1.dds",
                                      "features_2.dds", "features_3.dds", "manifest.json",
                                      "report.json", "run.json"}));
  EXPECT_EQ(fs::read_symlink(out / "asset/current"), "r0001");
}

TEST(Container, OpensByRevisionAssetAndManifest) {
  const TemporaryDirectory out;
  ASSERT_OK(PublishSample(out.path(), 1));
  ASSERT_OK(PublishSample(out.path(), 2));
  const std::string second = fs::canonical(out / "asset/r0002").string();
  for (const char* path : {"asset", "asset/", "asset/current", "asset/r0002",
                           "asset/r0002/manifest.json", "asset/current/manifest.json"}) {
    const auto container = OpenContainer(out / path);
    ASSERT_OK(container);
    EXPECT_EQ(container->directory, second) << path;
    EXPECT_EQ(container->manifest.asset, "asset");
    EXPECT_EQ(container->manifest.payloads.size(), 6u);
    EXPECT_TRUE(VerifyPayloads(*container).has_value());
  }
  EXPECT_EQ(OpenContainer(out / "asset/r0001")->directory,
            fs::canonical(out / "asset/r0001").string());
}

TEST(Container, SaysWhatIsMissing) {
  const TemporaryDirectory out;
  ASSERT_OK(PublishSample(out.path(), 1));
  EXPECT_EQ(OpenContainer(out / "other").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(OpenContainer(out.path()).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(OpenContainer(out / "asset/r0001/report.json").error().code,
            ErrorCode::kInvalidArgument);
  ASSERT_OK(WriteFileDurably(out / "asset/r0001/manifest.json", std::string_view("{")));
  const auto container = OpenContainer(out / "asset");
  ASSERT_FALSE(container);
  EXPECT_EQ(container.error().code, ErrorCode::kCorruptData);
  EXPECT_NE(container.error().message.find("r0001/manifest.json"), std::string::npos);
}

TEST(Container, VerificationFindsDamage) {
  const TemporaryDirectory out;
  ASSERT_OK(PublishSample(out.path(), 1));
  const auto container = OpenContainer(out / "asset");
  ASSERT_OK(container);
  const std::string path = container->PathOf("features_2.dds");
  std::vector<uint8_t> bytes = *ReadFile(path, 1 << 20);
  bytes[200] ^= 1;
  ASSERT_OK(WriteFileDurably(path, std::span<const uint8_t>(bytes)));
  auto status = VerifyPayloads(*container);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kCorruptData);
  EXPECT_NE(status.error().message.find("features_2.dds"), std::string::npos);
  bytes.pop_back();
  ASSERT_OK(WriteFileDurably(path, std::span<const uint8_t>(bytes)));
  status = VerifyPayloads(*container);
  EXPECT_EQ(status.error().code, ErrorCode::kCorruptData);
  fs::remove(path);
  EXPECT_EQ(VerifyPayloads(*container).error().code, ErrorCode::kNotFound);
}

TEST(Container, RevisionsCountUpFromTheNewest) {
  const TemporaryDirectory out;
  ASSERT_OK(PublishSample(out.path(), 1));
  fs::create_directory(out / "asset/r0041");
  fs::create_directory(out / "asset/r00x9");
  fs::create_directory(out / "asset/notes");
  EXPECT_EQ(PublishSample(out.path(), 2)->revision, "r0042");
  fs::create_directory(out / "asset/r9999");
  EXPECT_EQ(PublishSample(out.path(), 3)->revision, "r10000");
  EXPECT_EQ(PublishSample(out.path(), 4)->revision, "r10001");
  EXPECT_EQ(fs::read_symlink(out / "asset/current"), "r10001");
}

TEST(Container, SameContentGivesTheSameBytes) {
  const TemporaryDirectory out;
  ASSERT_OK(PublishSample(out.path(), 7));
  ASSERT_OK(PublishSample(out.path(), 7));
  for (const std::string& name : Entries(out / "asset/r0001")) {
    EXPECT_EQ(Sha256OfFile(out / "asset/r0001/" + name)->sha256,
              Sha256OfFile(out / "asset/r0002/" + name)->sha256)
        << name;
  }
}

TEST(Container, AbandonedStagingLeavesNothing) {
  const TemporaryDirectory out;
  { ASSERT_OK(StageSample(out.path(), "asset", 1)); }
  EXPECT_EQ(Entries(out.path()), std::vector<std::string>{});
  ASSERT_OK(PublishSample(out.path(), 1));
  { ASSERT_OK(StageSample(out.path(), "asset", 2)); }
  EXPECT_EQ(Entries(out / "asset"), (std::vector<std::string>{".lock", "current", "r0001"}));
}

TEST(Container, StagingCanBeOpenedBeforeItIsPublished) {
  const TemporaryDirectory out;
  const auto staging = StageSample(out.path(), "asset", 1);
  ASSERT_OK(staging);
  const auto container = OpenContainer(staging->directory());
  ASSERT_OK(container);
  EXPECT_TRUE(VerifyPayloads(*container).has_value());
  EXPECT_EQ(container->manifest.payloads.size(), staging->payloads().size());
}

TEST(Container, RefusesBadAndRepeatedNames) {
  const TemporaryDirectory out;
  for (const char* asset : {"", "..", "a/b", ".hidden"}) {
    EXPECT_EQ(StagingArea::Create(out.path(), asset).error().code, ErrorCode::kInvalidArgument)
        << asset;
  }
  auto staging = StagingArea::Create(out.path(), "asset");
  ASSERT_OK(staging);
  ASSERT_OK(staging->AddPayload("a", "report", {}));
  EXPECT_EQ(staging->AddPayload("a", "report", {}).error().code, ErrorCode::kConflict);
  EXPECT_EQ(staging->AddUnlisted("a", {}).error().code, ErrorCode::kConflict);
  EXPECT_EQ(staging->AddPayload("manifest.json", "report", {}).error().code, ErrorCode::kConflict);
  EXPECT_EQ(staging->AddPayload("../a", "report", {}).error().code, ErrorCode::kInvalidArgument);
}

TEST(Container, TwoBakesOfOneAssetExcludeEachOther) {
  const TemporaryDirectory out;
  {
    const auto first = StagingArea::Create(out.path(), "asset");
    ASSERT_OK(first);
    const auto second = StagingArea::Create(out.path(), "asset");
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().code, ErrorCode::kConflict);
    EXPECT_TRUE(StagingArea::Create(out.path(), "another").has_value());
    EXPECT_TRUE(fs::exists(first->directory()));
  }
  EXPECT_TRUE(StagingArea::Create(out.path(), "asset").has_value());
}

TEST(Container, ABakeInAnotherProcessExcludesThisOne) {
  const TemporaryDirectory out;
  int ready[2];
  int finish[2];
  ASSERT_EQ(pipe(ready), 0);
  ASSERT_EQ(pipe(finish), 0);
  const pid_t child = fork();
  if (child == 0) {
    const auto staging = StagingArea::Create(out.path(), "asset");
    char byte = staging ? 'y' : 'n';
    if (write(ready[1], &byte, 1) != 1 || read(finish[0], &byte, 1) != 1) _exit(2);
    _exit(0);  // without destructors, like a kill
  }
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  EXPECT_EQ(byte, 'y');
  EXPECT_EQ(StagingArea::Create(out.path(), "asset").error().code, ErrorCode::kConflict);
  ASSERT_EQ(write(finish[1], &byte, 1), 1);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  for (const int fd : {ready[0], ready[1], finish[0], finish[1]}) close(fd);
  // The dead process left its staging area behind; the next bake takes the lock and clears it away.
  EXPECT_EQ(Entries(out / "asset").size(), 2u);
  const auto staging = StagingArea::Create(out.path(), "asset");
  ASSERT_OK(staging);
  EXPECT_EQ(Entries(out / "asset"),
            (std::vector<std::string>{".lock", fs::path(staging->directory()).filename()}));
}

TEST(Container, StagingOfLiveProcessesIsLeftAlone) {
  const TemporaryDirectory out;
  const std::string alive = ".staging-" + std::to_string(getppid()) + "-0";
  fs::create_directories(out / "asset/" + alive);
  fs::create_directories(out / "asset/.staging-");
  fs::create_directories(out /
                         "asset/.staging-4194305-3");  // above the largest process id of Linux
  ASSERT_OK(PublishSample(out.path(), 1));
  EXPECT_TRUE(fs::exists(out / "asset/" + alive));
  EXPECT_TRUE(fs::exists(out / "asset/.staging-"));
  EXPECT_FALSE(fs::exists(out / "asset/.staging-4194305-3"));
}

TEST(Container, PruningKeepsTheNewestAndTheCurrentRevision) {
  const TemporaryDirectory out;
  for (int i = 1; i <= 5; ++i) ASSERT_OK(PublishSample(out.path(), 1));
  fs::remove(out / "asset/current");
  fs::create_symlink("r0002", out / "asset/current");
  fs::create_directories(out / "asset/r12");  // not a name that a bake gives
  fs::create_directories(out / "asset/rejected");
  EXPECT_EQ(*PruneRevisions(out.path(), "asset", 2), 2);
  EXPECT_EQ(Entries(out / "asset"), (std::vector<std::string>{".lock", "current", "r0002", "r0004",
                                                              "r0005", "r12", "rejected"}));
  EXPECT_EQ(*PruneRevisions(out.path(), "asset", 0), 2);
  EXPECT_TRUE(OpenContainer(out / "asset"));
  EXPECT_EQ(PruneRevisions(out.path(), "other", 1).error().code, ErrorCode::kNotFound);
}

TEST(Container, PruningTouchesNothingWhereCurrentIsBrokenOrABakeRuns) {
  const TemporaryDirectory out;
  ASSERT_OK(PublishSample(out.path(), 1));
  ASSERT_OK(PublishSample(out.path(), 1));
  {
    const auto baking = StagingArea::Create(out.path(), "asset");
    ASSERT_OK(baking);
    EXPECT_EQ(PruneRevisions(out.path(), "asset", 0).error().code, ErrorCode::kConflict);
  }
  fs::remove(out / "asset/current");
  for (const char* target : {"r0009", "../asset/r0001", "r0001/manifest.json"}) {
    fs::create_symlink(target, out / "asset/current");
    EXPECT_EQ(*PruneRevisions(out.path(), "asset", 0), 0) << target;
    fs::remove(out / "asset/current");
  }
  EXPECT_EQ(*PruneRevisions(out.path(), "asset", 0), 0);
  EXPECT_TRUE(fs::exists(out / "asset/r0001"));
}

TEST(Container, DoesNotReplaceACurrentThatIsNotALink) {
  const TemporaryDirectory out;
  fs::create_directories(out / "asset/current");
  const auto published = PublishSample(out.path(), 1);
  ASSERT_FALSE(published);
  EXPECT_EQ(published.error().code, ErrorCode::kConflict);
  EXPECT_EQ(Entries(out / "asset"), (std::vector<std::string>{".lock", "current"}));
}

// Every file call of a bake fails once, alone and for good: nothing half-made is seen, the last
// good one stays.
class ContainerFailure : public testing::TestWithParam<std::pair<bool, int>> {};

TEST_P(ContainerFailure, AtAnyFileCallLeavesTheLastGoodContainer) {
  const auto [and_all_after, error] = GetParam();
  const TemporaryDirectory out;
  ASSERT_OK(PublishSample(out.path(), 1));
  const std::string before = Sha256OfFile(out / "asset/current/manifest.json")->sha256;
  int failures = 0;
  bool reached_the_end = false;
  for (int fail_at = 1; !reached_the_end; ++fail_at) {
    ASSERT_LT(fail_at, 100);
    SCOPED_TRACE("call " + std::to_string(fail_at));
    FailingFileSystem files(fail_at, and_all_after, error);
    const auto published = [&]() -> Result<PublishedContainer> {
      PATINA_ASSIGN(StagingArea staging, StageSample(out.path(), "asset", 2, {}, files));
      return staging.Publish();
    }();
    const auto container = OpenContainer(out / "asset");
    ASSERT_OK(container);
    ASSERT_OK(VerifyPayloads(*container));
    if (published) {
      // Only the sync after the link was replaced may fail without failing the whole.
      EXPECT_EQ(published->revision, "r0002");
      EXPECT_EQ(published->warning.empty(), files.calls() < fail_at);
      reached_the_end = files.calls() < fail_at;
      fs::remove(out / "asset/current");
      fs::create_symlink("r0001", out / "asset/current");
      fs::remove_all(published->directory);
    } else {
      ++failures;
      EXPECT_EQ(published.error().code,
                error == ENOSPC ? ErrorCode::kResourceExhausted : ErrorCode::kIo);
      EXPECT_EQ(Sha256OfFile(out / "asset/current/manifest.json")->sha256, before);
      // With the disk gone for good, the renamed directory cannot be taken back; it is whole, but
      // not current.
      if (and_all_after) fs::remove_all(out / "asset/r0002");
    }
    EXPECT_EQ(Entries(out / "asset"), (std::vector<std::string>{".lock", "current", "r0001"}));
  }
  EXPECT_GE(failures, 12);
}

INSTANTIATE_TEST_SUITE_P(Errors, ContainerFailure,
                         testing::Values(std::pair(false, ENOSPC), std::pair(false, EIO),
                                         std::pair(true, ENOSPC), std::pair(true, EIO)));

TEST(Container, AFailedFirstBakeLeavesNoAsset) {
  FailingFileSystem files(6, true, ENOSPC);
  const TemporaryDirectory out;
  EXPECT_FALSE(StageSample(out.path(), "asset", 1, {}, files));
  EXPECT_EQ(Entries(out.path()), std::vector<std::string>{});
}

}  // namespace
}  // namespace patina
