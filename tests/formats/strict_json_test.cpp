#include "formats/base/strict_json.h"

#include <gtest/gtest.h>

#include <string>

namespace patina {
namespace {

TEST(ParseStrictJson, TakesWhatIsJson) {
  const auto json = ParseStrictJson(R"({"a": [1, {"b": null}], "c": {"a": 2}})", 4);
  ASSERT_TRUE(json) << json.error().message;
  EXPECT_EQ((*json)["c"]["a"], 2);
  EXPECT_TRUE(ParseStrictJson("3", 0));
}

TEST(ParseStrictJson, RefusesAKeyThatStandsTwice) {
  for (const char* text : {R"({"a": 1, "a": 1})", R"({"x": [{"a": 1, "b": 2, "a": 3}]})"}) {
    const auto json = ParseStrictJson(text, 8);
    ASSERT_FALSE(json) << text;
    EXPECT_NE(json.error().message.find("\"a\" stands twice"), std::string::npos) << text;
  }
}

TEST(ParseStrictJson, RefusesWhatIsNestedTooDeeplyAtAnySize) {
  EXPECT_TRUE(ParseStrictJson("[[[1]]]", 3));
  EXPECT_FALSE(ParseStrictJson("[[[1]]]", 2));
  EXPECT_FALSE(ParseStrictJson(std::string(1000000, '['), 16));
}

TEST(ParseStrictJson, RefusesWhatIsNoJson) {
  for (const char* text : {"", "{", "{\"a\": }", "1 2", "\xff", "\"\xff\"", "{'a': 1}"})
    EXPECT_FALSE(ParseStrictJson(text, 8)) << text;
}

TEST(EscapePointer, MakesAKeyOnePart) { EXPECT_EQ(EscapePointer("a/b~c"), "a~1b~0c"); }

}  // namespace
}  // namespace patina
