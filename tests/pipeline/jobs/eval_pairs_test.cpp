#include "pipeline/jobs/eval_pairs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace patina {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string Complaint(std::string_view text, PairColumns columns = PairColumns::kDirections) {
  auto pairs = ParsePairs(text, columns, "pairs.csv");
  return pairs ? "" : pairs.error().message;
}

TEST(ParsePairs, ReadsLinesWithAndWithoutNames) {
  const std::string_view lines = "0,0,1, 0.6 ,0,0.8\r\n#\n\n-0.6,0,-0.8,1,0,0";
  for (const std::string& names : {std::string(), std::string("wix, wiy,wiz,wox,woy,woz\n")}) {
    auto pairs = ParsePairs(names + std::string(lines), PairColumns::kDirections, "pairs.csv");
    ASSERT_TRUE(pairs) << pairs.error().message;
    ASSERT_EQ(pairs->size(), 2u);
    EXPECT_EQ((*pairs)[0].wi[2], 1.0f);
    EXPECT_EQ((*pairs)[0].wo[0], 0.6f);
    EXPECT_EQ((*pairs)[1].wi[2], -0.8f);
  }
  auto none = ParsePairs("", PairColumns::kDirections, "pairs.csv");
  ASSERT_TRUE(none);
  EXPECT_TRUE(none->empty());
}

TEST(ParsePairs, MakesLengthsNearOneOne) {
  auto pairs = ParsePairs("0,0,1.0009,0,0,0.9991", PairColumns::kDirections, "pairs.csv");
  ASSERT_TRUE(pairs) << pairs.error().message;
  EXPECT_EQ((*pairs)[0].wi[2], 1.0f);
  EXPECT_EQ((*pairs)[0].wo[2], 1.0f);
  EXPECT_NE(Complaint("0,0,1.0011,0,0,1"), "");
  EXPECT_NE(Complaint("0,0,1,0,0,0.9989"), "");
}

TEST(ParsePairs, NamesTheLineOfWhatIsWrong) {
  EXPECT_THAT(Complaint("\n# x\n0,0,1,0,0,0\n"), HasSubstr("pairs.csv: line 3"));
  for (const char* line :
       {"0,0,1,0,0", "0,0,1,0,0,1,0", "0,0,1,0,0,1,", "0,0,1,,0,1", "0,0,1,0,0,one",
        "0,0,1,0,0,inf", "0,0,1,0,0,1e999", "0 0 1 0 0 1", "wix,wiy,wiz,wox,woy,r"}) {
    EXPECT_THAT(Complaint(line), HasSubstr("line 1")) << line;
  }
  // Names stand in the first line or nowhere.
  EXPECT_THAT(Complaint("0,0,1,0,0,1\nwix,wiy,wiz,wox,woy,woz\n"), HasSubstr("line 2"));
}

TEST(ParsePairs, ReadsPlacesWithAndWithoutLevels) {
  const std::string names = "wix,wiy,wiz,wox,woy,woz,u,v";
  for (const std::string& header : {std::string(), names + "\n"}) {
    auto pairs =
        ParsePairs(header + "0,0,1,0.6,0,0.8, -3.25, 1e-3\n", PairColumns::kPlaces, "pairs.csv");
    ASSERT_TRUE(pairs) << pairs.error().message;
    ASSERT_EQ(pairs->size(), 1u);
    EXPECT_EQ((*pairs)[0].wo[0], 0.6f);
    EXPECT_EQ((*pairs)[0].u, -3.25);
    EXPECT_EQ((*pairs)[0].v, 1e-3);
    EXPECT_EQ((*pairs)[0].level, 0);
  }
  for (const std::string& header : {std::string(), names + ",level\n"}) {
    auto pairs = ParsePairs(header + "0,0,1,0,0,1,0.1,0.2,1.5\n0,0,1,0,0,1,0,0,-1\n",
                            PairColumns::kPlaces, "pairs.csv");
    ASSERT_TRUE(pairs) << pairs.error().message;
    ASSERT_EQ(pairs->size(), 2u);
    EXPECT_EQ((*pairs)[0].u, 0.1);
    EXPECT_EQ((*pairs)[0].level, 1.5);
    EXPECT_EQ((*pairs)[1].level, -1);
  }
}

TEST(ParsePairs, SaysWhichColumnsAreMissingOrTooMany) {
  for (const char* without : {"0,0,1,0,0,1\n", "wix,wiy,wiz,wox,woy,woz\n0,0,1,0,0,1\n"}) {
    EXPECT_THAT(Complaint(without, PairColumns::kPlaces),
                AllOf(HasSubstr("line 1"), HasSubstr("add the columns u and v")));
  }
  for (const char* with : {"0,0,1,0,0,1,0,0\n", "0,0,1,0,0,1,0,0,2\n"}) {
    EXPECT_THAT(Complaint(with), AllOf(HasSubstr("line 1"), HasSubstr("leave out u, v")));
  }
  const std::pair<const char*, const char*> lines[] = {
      {"0,0,1,0,0,1,0\n", "line 1: 7 values"},
      {"0,0,1,0,0,1,0,0,0,0\n", "line 1: more than nine values"},
      {"0,0,1,0,0,1,0,0\n\n0,0,1,0,0,1,0,0,1\n", "line 3: 9 values, and the first line has 8"},
      {"wix,wiy,wiz,wox,woy,woz,u,v,level\n0,0,1,0,0,1,0,0\n", "line 2: 8 values"},
      {"0,0,1,0,0,1,nan,0\n", "line 1: u is"},
      {"0,0,1,0,0,1,0,\n", "line 1: v is"},
      {"0,0,1,0,0,1,0,0,one\n", "line 1: level is"},
      {"0,0,2,0,0,1,0,0\n", "unit vectors"}};
  for (const auto& [text, words] : lines)
    EXPECT_THAT(Complaint(text, PairColumns::kPlaces), HasSubstr(words)) << text;
}

}  // namespace
}  // namespace patina
