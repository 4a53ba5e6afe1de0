#include "pipeline/jobs/eval_pairs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace patina {
namespace {

using testing::HasSubstr;

std::string Complaint(std::string_view text) {
  auto pairs = ParsePairs(text, "pairs.csv");
  return pairs ? "" : pairs.error().message;
}

TEST(ParsePairs, ReadsLinesWithAndWithoutNames) {
  const std::string_view lines = "0,0,1, 0.6 ,0,0.8\r\n#\n\n-0.6,0,-0.8,1,0,0";
  for (const std::string& names : {std::string(), std::string("wix, wiy,wiz,wox,woy,woz\n")}) {
    auto pairs = ParsePairs(names + std::string(lines), "pairs.csv");
    ASSERT_TRUE(pairs) << pairs.error().message;
    ASSERT_EQ(pairs->size(), 2u);
    EXPECT_EQ((*pairs)[0].wi[2], 1.0f);
    EXPECT_EQ((*pairs)[0].wo[0], 0.6f);
    EXPECT_EQ((*pairs)[1].wi[2], -0.8f);
  }
  auto none = ParsePairs("", "pairs.csv");
  ASSERT_TRUE(none);
  EXPECT_TRUE(none->empty());
}

TEST(ParsePairs, MakesLengthsNearOneOne) {
  auto pairs = ParsePairs("0,0,1.0009,0,0,0.9991", "pairs.csv");
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

}  // namespace
}  // namespace patina
