#include "daemon/api/access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "formats/base/file_io.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

using ::testing::HasSubstr;

TEST(Access, TakesTheTokenAndNothingElse) {
  const std::string token = "0123456789abcdef";
  EXPECT_TRUE(CarriesToken("Bearer 0123456789abcdef", token));
  EXPECT_TRUE(CarriesToken("bearer 0123456789abcdef", token));
  for (const char* wrong : {"", "Bearer", "Bearer ", "0123456789abcdef", "Basic 0123456789abcdef",
                            "Bearer 0123456789abcdeF", "Bearer 0123456789abcdef0",
                            "Bearer 0123456789abcdef0123456789abcdef", "Bearer 0123456789abcde"})
    EXPECT_FALSE(CarriesToken(wrong, token)) << wrong;
}

TEST(Access, KnowsThisMachinesNames) {
  for (const char* host : {"localhost", "LOCALHOST:80", "127.0.0.1", "127.0.0.1:8080",
                           "127.1.2.3:1", "[::1]", "[::1]:8080"})
    EXPECT_TRUE(IsLocalHost(host)) << host;
  for (const char* host : {"", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example",
                           "evil.example:80", "localhost:evil", "[::2]", "128.0.0.1",
                           "127."
                           "0.0.1:80:evil"})
    EXPECT_FALSE(IsLocalHost(host)) << host;
}

TEST(Access, RefusesTokenFilesThatOthersCanRead) {
  test::TemporaryDirectory folder;
  const std::string path = folder / "token";
  EXPECT_THAT(test::MessageOf(ReadTokenFile(path)), HasSubstr("is not there; make one with"));
  ASSERT_OK(WriteFileDurably(path, std::string_view("0123456789abcdef\n")));
  ASSERT_EQ(chmod(path.c_str(), 0640), 0);
  EXPECT_THAT(test::MessageOf(ReadTokenFile(path)), HasSubstr("can be read by others"));
  ASSERT_EQ(chmod(path.c_str(), 0600), 0);
  ASSERT_OK(ReadTokenFile(path));
  EXPECT_EQ(*ReadTokenFile(path), "0123456789abcdef");
  ASSERT_OK(WriteFileDurably(path, std::string_view("short\n")));
  ASSERT_EQ(chmod(path.c_str(), 0600), 0);
  EXPECT_THAT(test::MessageOf(ReadTokenFile(path)), HasSubstr("fewer than 16"));
  ASSERT_OK(WriteFileDurably(path, std::string_view("0123456789abcdef\r\nX-Evil: 1")));
  ASSERT_EQ(chmod(path.c_str(), 0600), 0);
  EXPECT_THAT(test::MessageOf(ReadTokenFile(path)), HasSubstr("characters other than"));
}

}  // namespace
}  // namespace patina::daemon
