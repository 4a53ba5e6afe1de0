#include "formats/base/names.h"

#include <gtest/gtest.h>

namespace patina {
namespace {

using namespace std::string_literals;

TEST(PlainName, TakesOrdinaryNames) {
  for (const std::string& name : {"a"s, "cobblestone_2k"s, "Bärenfell 03"s, "石"s, "a..b"s,
                                  "x.dds"s, std::string(128, 'a')}) {
    EXPECT_TRUE(CheckPlainName(name, "asset").has_value()) << name;
  }
}

TEST(PlainName, RefusesWhatCouldLeaveTheFolderOrHide) {
  for (const std::string& name :
       {""s, "."s, ".."s, ".hidden"s, "a/b"s, "/"s, "../up"s, "a\\b"s, "a\nb"s, "a\0b"s, "a\x7F"s,
        " a"s, "a "s, "\xFF"s, "\xC0\xAF"s, "\xED\xA0\x80"s, "\xF4\x90\x80\x80"s, "\xE4\xB8"s,
        std::string(129, 'a')}) {
    const auto status = CheckPlainName(name, "asset");
    ASSERT_FALSE(status.has_value()) << name;
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
    EXPECT_TRUE(IsUtf8(status.error().message));
  }
}

TEST(RelativePath, TakesPathsBelowAFolderOnly) {
  for (const char* path : {"a.png", "sub/a.png", ".x/a", "a/..b"}) {
    EXPECT_TRUE(CheckRelativePath(path, "path").has_value()) << path;
  }
  for (const std::string& path :
       {""s, "/a"s, "a//b"s, "a/"s, "../a"s, "a/../b"s, "./a"s, "a/."s, "a\nb"s, "\xFF"s}) {
    EXPECT_FALSE(CheckRelativePath(path, "path").has_value()) << path;
  }
}

TEST(QuoteForMessage, IsAlwaysShortPrintableUtf8) {
  EXPECT_EQ(QuoteForMessage("a\nb\xFFz"), "\"a?b?z\"");
  EXPECT_LT(QuoteForMessage(std::string(1000000, 'a')).size(), 100u);
}

}  // namespace
}  // namespace patina
