// Layered materials through the command `patina`: from a sample to a container.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "formats/schema_check.h"
#include "tests/system/child_process.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing_support::Outcome;
using testing_support::Patina;
using testing_support::ReadAll;
using testing_support::TempFolder;
using Json = nlohmann::json;

TEST(LayeredMaterials, AreBakedLikeMeasuredOnes) {
  TempFolder folder;
  const Outcome made = Patina({"sample", "--kind", "layered", "--out", folder / "in"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("car_paint.layers.json"));
  // Of the folder only the cheapest stays.
  for (const auto& entry : fs::directory_iterator(folder / "in")) {
    if (entry.path().filename() != "lacquered_wood.layers.json") fs::remove(entry.path());
  }
  const Outcome baked =
      Patina({"bake", folder / "in", "--out", folder / "out", "--quality", "preview", "--json"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const Json manifest = Json::parse(ReadAll(folder / "out/lacquered_wood/current/manifest.json"));
  const Status status = CheckAgainstSchema("manifest", manifest);
  EXPECT_TRUE(status) << status.error().message;
  EXPECT_EQ(manifest["kind"], "brdf");
  EXPECT_EQ(manifest["brdf"]["isotropic"], true);
  const Json& source = manifest["source"];
  EXPECT_EQ(source["format"], "layered");
  const Json run = Json::parse(ReadAll(folder / "out/lacquered_wood/current/run.json"));
  ASSERT_EQ(run["simulation"].size(), 4u);
  // Four times as many paths halve it, give or take the noise of two dozen pairs.
  EXPECT_LT(run["simulation"][3]["standard_error"],
            0.5 * run["simulation"][0]["standard_error"].get<double>());
  EXPECT_GT(run["simulation"][0]["standard_error"], 0);
  EXPECT_THAT(ReadAll(folder / "out/lacquered_wood/current/report.html"),
              HasSubstr("What the accuracy of the simulation costs"));
  EXPECT_EQ(source["files"][0]["path"], "lacquered_wood.layers.json");
  EXPECT_GE(source["simulation"]["pairs"], 32768);
  EXPECT_GE(source["simulation"]["paths"], 32 * source["simulation"]["pairs"].get<int>());
  EXPECT_LT(source["simulation"]["standard_error"], 0.08);
  EXPECT_EQ(source["simulation"]["effects"], Json({"rough refraction", "absorption", "colour"}));
  EXPECT_EQ(source["simulation"]["left_out"], Json({"several layers", "anisotropy", "scattering"}));
  // A black sphere would have less than .8; the rest is for the noise of the draft.
  EXPECT_GT(manifest["quality"]["image_ssim"], 0.95);
}

TEST(LayeredMaterials, ImpossibleOnesAreBadInput) {
  TempFolder folder;
  const std::string file = folder / "odd.layers.json";
  std::ofstream(file) << R"({"version": 1, "layers": [{"ior": 1.5, "thickness": -2}],
                            "base": {"kind": "black"}})";
  const Outcome baked = Patina({"bake", file, "--out", folder / "out"});
  EXPECT_EQ(baked.exit_code, 3);
  EXPECT_THAT(baked.err, AllOf(HasSubstr("odd.layers.json: /layers/0/thickness: -2"),
                               HasSubstr("give 0 or more")));
  EXPECT_FALSE(fs::exists(folder / "out/odd/current"));
}

}  // namespace
}  // namespace patina
