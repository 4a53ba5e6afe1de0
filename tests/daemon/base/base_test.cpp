#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "daemon/base/clock.h"
#include "daemon/base/file_calls.h"
#include "daemon/base/log.h"
#include "daemon/base/service_manager.h"
#include "daemon/base/state_lock.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

using patina::test::MessageOf;

// What a logger writes.
class LogTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_EQ(::pipe(ends_), 0); }
  void TearDown() override {
    ::close(ends_[0]);
    ::close(ends_[1]);
  }
  std::string Written() {
    char buffer[8192];
    ::fcntl(ends_[0], F_SETFL, O_NONBLOCK);
    const ssize_t n = ::read(ends_[0], buffer, sizeof buffer);
    return {buffer, static_cast<size_t>(n > 0 ? n : 0)};
  }
  int ends_[2];
};

TEST_F(LogTest, WritesOneJsonObjectALine) {
  Logger log(ends_[1], LogLevel::kInfo, LogFormat::kJson);
  log.Info("job_ended", {{"job", 7}, {"ok", true}, {"s", 0.5}, {"text", "a\"b\n\xff"}});
  const std::string line = Written();
  ASSERT_EQ(std::count(line.begin(), line.end(), '\n'), 1);
  const auto json = nlohmann::json::parse(line);
  EXPECT_EQ(json["level"], "info");
  EXPECT_EQ(json["event"], "job_ended");
  EXPECT_EQ(json["job"], 7);
  EXPECT_EQ(json["ok"], true);
  EXPECT_EQ(json["s"], 0.5);
  EXPECT_EQ(json["text"], "a\"b\n\xEF\xBF\xBD");
  EXPECT_EQ(json["time"].get<std::string>().size(), 24u);
}

TEST_F(LogTest, WritesText) {
  Logger log(ends_[1], LogLevel::kInfo, LogFormat::kText);
  log.Warning("odd", {{"path", "/a/b"}, {"why", "two words"}, {"none", ""}});
  const std::string line = Written();
  EXPECT_EQ(line.substr(24), " warning odd path=/a/b why=\"two words\" none=\"\"\n");
}

TEST_F(LogTest, LeavesOutWhatIsBelowItsLevel) {
  Logger log(ends_[1], LogLevel::kWarning, LogFormat::kJson);
  log.Info("no");
  EXPECT_EQ(Written(), "");
  log.Configure(LogLevel::kDebug, LogFormat::kJson);
  log.Debug("yes");
  EXPECT_NE(Written(), "");
  EXPECT_EQ(ParseLogLevel("warning"), LogLevel::kWarning);
  EXPECT_EQ(ParseLogLevel("loud"), std::nullopt);
}

TEST(Clock, WritesTimesAsRfc3339) {
  EXPECT_EQ(Rfc3339(0), "1970-01-01T00:00:00.000Z");
  EXPECT_EQ(Rfc3339(1782889439042), "2026-07-01T07:03:59.042Z");
  EXPECT_EQ(Rfc3339(-1), "1969-12-31T23:59:59.999Z");
}

TEST(StateLock, IsHeldByOneProcessAndSaysByWhich) {
  const patina::test::TemporaryDirectory folder;
  {
    const auto mine = StateLock::Acquire(folder.path());
    ASSERT_OK(mine);
    const auto second = StateLock::Acquire(folder.path());
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().code, ErrorCode::kConflict);
    EXPECT_NE(MessageOf(second).find(std::to_string(::getpid())), std::string::npos);
  }
  EXPECT_TRUE(StateLock::Acquire(folder.path()));
  EXPECT_EQ(StateLock::Acquire(folder / "missing").error().code, ErrorCode::kNotFound);
}

// A daemon that was killed between fork and exec: its child has the lock a little longer.
TEST(StateLock, WaitsForWhatAKilledDaemonLeftBehind) {
  const patina::test::TemporaryDirectory folder;
  int release[2], gone[2];
  ASSERT_EQ(::pipe(release), 0);
  ASSERT_EQ(::pipe(gone), 0);
  const pid_t daemon = ::fork();
  ASSERT_GE(daemon, 0);
  if (daemon == 0) {
    const auto lock = StateLock::Acquire(folder.path());
    if (!lock || ::fork() != 0) ::_exit(lock ? 0 : 1);
    ::close(release[1]);
    char byte;
    (void)!::read(release[0], &byte, 1);
    ::_exit(0);
  }
  int status = -1;
  ASSERT_EQ(::waitpid(daemon, &status, 0), daemon);
  ASSERT_EQ(status, 0);
  ::close(gone[1]);
  int pauses = 0;
  const auto lock = StateLock::Acquire(folder.path(), [&] {
    if (++pauses > 1) return;
    ::close(release[1]);
    char byte;
    EXPECT_EQ(::read(gone[0], &byte, 1), 0);  // the end of all who had the other end
  });
  ASSERT_OK(lock);
  EXPECT_EQ(pauses, 1);
  ::close(release[0]);
  ::close(gone[0]);
}

TEST(ServiceManager, IsToldThroughItsSocket) {
  const patina::test::TemporaryDirectory folder;
  const std::string path = folder / "notify";
  const UniqueFd fd(::socket(AF_UNIX, SOCK_DGRAM, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  ASSERT_EQ(::bind(fd.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  ::setenv("NOTIFY_SOCKET", path.c_str(), 1);
  NotifyServiceManager("READY=1");
  char text[64];
  const ssize_t n = ::recv(fd.get(), text, sizeof text, MSG_DONTWAIT);
  EXPECT_EQ(std::string(text, static_cast<size_t>(std::max<ssize_t>(n, 0))), "READY=1");
  ::setenv("NOTIFY_SOCKET", (folder / "nobody").c_str(), 1);
  NotifyServiceManager("READY=1");
  ::unsetenv("NOTIFY_SOCKET");
  NotifyServiceManager("READY=1");
}

TEST(FileCalls, ListsAndRemovesWithoutFollowingLinks) {
  const patina::test::TemporaryDirectory folder;
  FileCalls& files = RealFileCalls();
  std::filesystem::create_directories(folder / "a/b");
  std::filesystem::create_directories(folder / "kept/x");
  std::filesystem::create_directory_symlink(folder / "kept", folder / "a/link");
  std::vector<DirectoryEntry> entries;
  EXPECT_EQ(files.List(folder / "a", 100, &entries), 0);
  EXPECT_EQ(entries.size(), 2u);
  EXPECT_EQ(files.List(folder / "a", 1, &entries), EOVERFLOW);
  EXPECT_EQ(files.List(folder / "none", 1, &entries), ENOENT);
  EXPECT_EQ(files.RemoveDirectory(folder / "a"), ENOTEMPTY);
  EXPECT_EQ(files.RemoveTree(folder / "a"), 0);
  EXPECT_EQ(files.RemoveTree(folder / "a"), 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
  EXPECT_TRUE(std::filesystem::exists(folder / "kept/x"));
}

}  // namespace
}  // namespace patina::daemon
