#include "daemon/api/submit_body.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace patina::daemon {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

std::vector<std::string> PointersOf(const std::vector<FieldProblem>& problems) {
  std::vector<std::string> pointers;
  for (const FieldProblem& problem : problems) pointers.push_back(problem.pointer);
  return pointers;
}

std::vector<std::string> Pointers(const std::string& body) {
  return PointersOf(ParseSubmit(body, "/out").problems);
}

TEST(SubmitBody, FillsInWhatIsAbsent) {
  const ParsedSubmit parsed =
      ParseSubmit(R"({"job": {"kind": "material", "asset": "wall", "folder": "/maps"}})", "/out");
  ASSERT_TRUE(parsed.problems.empty()) << parsed.problems[0].detail;
  EXPECT_EQ(parsed.request.job.asset, "wall");
  EXPECT_EQ(parsed.request.job.folder, "/maps");
  EXPECT_EQ(parsed.request.job.out, "/out");
  EXPECT_EQ(parsed.request.priority, 0);
  EXPECT_FALSE(parsed.request.force);
  EXPECT_FALSE(parsed.request.memory_mb.has_value());
}

TEST(SubmitBody, CarriesColoursAndWantsTheirConfigurationAbsolute) {
  const std::string job = R"({"job": {"kind": "material", "asset": "wall", "folder": "/maps",
    "working_space": "acescg", "color_space": "ACEScg", "ocio": )";
  const ParsedSubmit parsed = ParseSubmit(job + R"("/studio/config.ocio"}})", "/out");
  ASSERT_TRUE(parsed.problems.empty()) << parsed.problems[0].detail;
  EXPECT_EQ(parsed.request.job.working_space, WorkingSpace::kAcesCg);
  EXPECT_EQ(parsed.request.job.color_space, "ACEScg");
  EXPECT_EQ(parsed.request.job.ocio, "/studio/config.ocio");
  EXPECT_THAT(Pointers(job + R"("config.ocio"}})"), ElementsAre("/job/ocio"));
}

TEST(SubmitBody, TakesEveryField) {
  const ParsedSubmit parsed = ParseSubmit(
      R"({"job": {"version": 1, "kind": "brdf", "asset": "gold", "file": "/g.binary",
                  "out": "/elsewhere"},
          "priority": -5, "force": true, "limits": {"memory_mb": 100, "cpu_s": 0, "wall_s": 7}})",
      "/out");
  ASSERT_TRUE(parsed.problems.empty()) << parsed.problems[0].detail;
  EXPECT_EQ(parsed.request.job.out, "/elsewhere");
  EXPECT_EQ(parsed.request.priority, -5);
  EXPECT_TRUE(parsed.request.force);
  EXPECT_EQ(parsed.request.memory_mb, 100);
  EXPECT_EQ(parsed.request.cpu_s, 0);
  EXPECT_EQ(parsed.request.wall_s, 7);
}

TEST(SubmitBody, ListsEverythingThatIsWrong) {
  EXPECT_THAT(Pointers(R"({"job": {"kind": "material", "asset": "../x", "folder": "/m", "sed": 1,
                                   "quality": "best"},
                           "priority": 101, "force": 1, "limits": {"memory": 1, "cpu_s": -1},
                           "a/b~c": 0})"),
              UnorderedElementsAre("/job/asset", "/job/sed", "/job/quality", "/priority", "/force",
                                   "/limits/memory", "/limits/cpu_s", "/a~1b~0c"));
}

TEST(SubmitBody, RefusesRelativePaths) {
  EXPECT_THAT(Pointers(R"({"job": {"kind": "material", "asset": "w", "folder": "maps"}})"),
              ElementsAre("/job/folder"));
  EXPECT_THAT(Pointers(R"({"job": {"kind": "brdf", "asset": "w", "file": "../x.bsdf"}})"),
              ElementsAre("/job/file"));
  EXPECT_THAT(Pointers(R"({"job": {"kind": "material", "asset": "w",
                                   "maps": [{"role": "albedo", "file": "a.png"}]}})"),
              ElementsAre("/job/maps/0/file"));
}

TEST(SubmitBody, RefusesWhatIsNoRequest) {
  for (const char* body : {"", "{", "[]", "null", "1", "\"x\"", "{\"job\": {}} x", "\xFF\xFE",
                           "{\"job\": {}, \"job\": {}}", "{\"job\": 1e999}"})
    EXPECT_FALSE(ParseSubmit(body, "/out").problems.empty()) << body;
  EXPECT_THAT(Pointers("{}"), ElementsAre("/job"));
  EXPECT_THAT(Pointers("{\"job\": []}"), ElementsAre("/job"));
  const std::string deep = "{\"job\": " + std::string(100000, '[') + std::string(100000, ']') + "}";
  EXPECT_THAT(ParseSubmit(deep, "/out").problems[0].detail, HasSubstr("nested deeper"));
}

TEST(SubmitBody, SurvivesEveryTruncation) {
  const std::string body =
      R"({"job": {"version": 1, "kind": "brdf", "asset": "gold", "file": "/g.binary"}, "force": true})";
  for (size_t size = 0; size < body.size(); ++size)
    EXPECT_FALSE(ParseSubmit(std::string(body, 0, size), "/out").problems.empty()) << size;
  EXPECT_TRUE(ParseSubmit(body, "/out").problems.empty());
}

TEST(SubmitBody, ReadsPriorities) {
  EXPECT_EQ(ParsePriority("{\"priority\": 7}").priority, 7);
  EXPECT_TRUE(ParsePriority("{\"priority\": 7}").problems.empty());
  EXPECT_THAT(PointersOf(ParsePriority("{}").problems), ElementsAre("/priority"));
  EXPECT_THAT(PointersOf(ParsePriority("{\"priority\": 7.5}").problems), ElementsAre("/priority"));
  EXPECT_THAT(PointersOf(ParsePriority("{\"priority\": 18446744073709551615}").problems),
              ElementsAre("/priority"));
  EXPECT_THAT(PointersOf(CheckEmptyBody("{\"x\": 7}")), ElementsAre("/x"));
  EXPECT_TRUE(CheckEmptyBody("").empty());
  EXPECT_TRUE(CheckEmptyBody(" {} ").empty());
}

}  // namespace
}  // namespace patina::daemon
