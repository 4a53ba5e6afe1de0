#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/schema_check.h"
#include "tests/system/child_process.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using namespace testing_support;
using Json = nlohmann::json;

Outcome Sweep(const TempFolder& folder, std::vector<std::string> more) {
  std::vector<std::string> words = {"tradeoff", folder / "floor", "--out", folder / "sweep"};
  words.insert(words.end(), more.begin(), more.end());
  return Patina(words);
}

TEST(Tradeoff, SweepsAndGoesOnWhereItWas) {
  TempFolder folder;
  ASSERT_EQ(Patina({"sample", "--out", folder / "floor", "--kind", "material", "--size", "32", "-q"})
                .exit_code,
            0);
  const Outcome first = Sweep(folder, {"--profiles", "bcf-0.5k", "--qualities", "preview"});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out, HasSubstr("profile-bcf-0.5k_quality-preview"));
  const std::string run = folder / "sweep/runs/profile-bcf-0.5k_quality-preview/floor";
  const auto before = Snapshot(run);
  const std::string times = ReadAll(run + "/current/run.json");

  const Outcome second =
      Sweep(folder, {"--profiles", "bcf-0.5k,bcf-1k", "--qualities", "preview", "-q"});
  ASSERT_EQ(second.exit_code, 0) << second.err;
  EXPECT_TRUE(Snapshot(run) == before);
  EXPECT_EQ(ReadAll(run + "/current/run.json"), times);
  const Json json = Json::parse(ReadAll(folder / "sweep/tradeoff.json"), nullptr, false);
  EXPECT_TRUE(CheckAgainstSchema("tradeoff", json));
  ASSERT_EQ(json["rows"].size(), 2u);
  EXPECT_LT(json["rows"][0]["bytes"].get<uint64_t>(), json["rows"][1]["bytes"].get<uint64_t>());
  EXPECT_EQ(json["rows"][0]["encode_s"], Json::parse(times)["seconds"]);
  EXPECT_GT(json["rows"][1]["decode_ns"].get<double>(), 0);
  EXPECT_TRUE(fs::exists(folder / "sweep/tradeoff.csv"));
  EXPECT_THAT(ReadAll(folder / "sweep/tradeoff.html"), HasSubstr("Quality against encode time"));
}

TEST(Tradeoff, SaysWhatCannotBeSwept) {
  TempFolder folder;
  fs::create_directory(folder / "floor");
  const Outcome empty = Sweep(folder, {});
  EXPECT_EQ(empty.exit_code, 3);
  EXPECT_THAT(empty.err, HasSubstr("floor"));
  EXPECT_EQ(Patina({"tradeoff", folder / "floor"}).exit_code, 2);
  ASSERT_EQ(Patina({"sample", "--out", folder / "a/floor", "--kind", "material", "--size", "16", "-q"})
                .exit_code,
            0);
  fs::copy(folder / "a", folder / "b", fs::copy_options::recursive);
  const Outcome twice = Patina({"tradeoff", folder / "a/floor", folder / "b/floor", "--out",
                                folder / "sweep", "--qualities", "preview", "--profiles", "bcf-1k"});
  EXPECT_EQ(twice.exit_code, 3);
  EXPECT_THAT(twice.err, HasSubstr("floor: another input is also named so"));
  EXPECT_EQ(Sweep(folder, {"--profiles", "bcf-9k"}).exit_code, 2);
}

}  // namespace
}  // namespace patina
