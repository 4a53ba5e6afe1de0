#include "pipeline/jobs/drop_jobs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "formats/base/file_io.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/job_plan.h"
#include "tests/formats/test_support.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;
using testing::UnorderedElementsAre;
using testing::UnorderedElementsAreArray;

TEST(AssetNameBelow, IsMadeOfThePath) {
  EXPECT_EQ(AssetNameBelow("drop", "wall", false), "wall");
  EXPECT_EQ(AssetNameBelow("drop", "", false), "drop");
  EXPECT_EQ(AssetNameBelow("drop", "stone/old wall", false), "stone_old_wall");
  EXPECT_EQ(AssetNameBelow("drop", "merl/chrome.binary", true), "merl_chrome");
  EXPECT_EQ(AssetNameBelow("drop", "paint/car.layers.json", true), "paint_car");
  EXPECT_EQ(AssetNameBelow("drop", "v1.2/chrome", true), "v1.2_chrome");
  EXPECT_EQ(AssetNameBelow("drop", "wall.v2", false), "wall.v2");
  const std::string odd = AssetNameBelow("drop", "m\xC3\xBC", false);
  EXPECT_EQ(odd.substr(0, 4), "m__-");
  EXPECT_NE(odd, AssetNameBelow("drop", "m\xC3\xB6", false));
  EXPECT_TRUE(IsAssetName(AssetNameBelow("", "", false)));
  EXPECT_TRUE(IsAssetName(AssetNameBelow("drop", std::string(4000, 'x'), false)));
  EXPECT_TRUE(IsAssetName(AssetNameBelow("drop", "-rf", false)));
}

// A drop folder with one of everything.
class DropFolder : public testing::Test {
 protected:
  DropFolder() {
    Text("gold.bsdf");
    Text("metals/chrome.binary");
    Image("wall/wall_albedo.png");
    for (const char* stem : {"oak", "pine"}) Image("wood/" + std::string(stem) + "_albedo.png");
    Text("cloth/bumps.btf.json");
    Image("cloth/i0.png");
    Text("two/a.btf.json");
    Text("two/b.btf.json");
    Text("paint/plain.layers.json",
         R"({"version": 1, "base": {"kind": "diffuse", "albedo": 0.5}})");
    Image("lab/wood_albedo.png");
    Image("lab/wall_basecolor.png");
    Text("lab/lacquer.layers.json", R"({"version": 1, "layers": [],
      "base": {"kind": "diffuse", "albedo": {"map": "wood_albedo.png"}}})");
    Text("car/car.gltf", R"({"asset": {"version": "2.0"}, "materials": [{"name": "paint"}]})");
    root_ = fs::canonical(folder_ / "drop").string();
  }

  std::string Path(const std::string& name) const { return folder_ / "drop/" + name; }
  void Text(const std::string& name, const std::string& text = "x") {
    ASSERT_OK(MakeDirectories(FolderOfFile(Path(name))));
    ASSERT_OK(WriteFileDurably(Path(name), std::string_view(text)));
  }
  void Image(const std::string& name) {
    ASSERT_OK(MakeDirectories(FolderOfFile(Path(name))));
    const float values[12] = {0, 0.2f, 0.4f, 0.6f, 0.8f, 1, 0, 0.3f, 0.6f, 0.9f, 0.1f, 0.5f};
    ASSERT_OK(WriteImage(Path(name), WriteFormat::kPng8, 2, 2, 3, values));
  }

  // Names that the folder gives, and that somebody gets who plans the same for himself.
  std::vector<std::string> Dropped(const std::string& path, bool is_file = false) const {
    const std::string name = AssetNameBelow("drop", path, is_file);
    std::vector<std::string> names;
    for (const Job& job : DropJobs(root_, root_ + "/" + path, name, is_file))
      names.push_back(job.asset);
    return names;
  }
  std::vector<std::string> Planned(const std::string& path) const {
    std::vector<std::string> names;
    for (const PlannedJob& planned : PlanJobs(Path(path), "").jobs) {
      EXPECT_TRUE(planned.job) << planned.job.error().message;
      names.push_back(NameInDropFolder(root_, *planned.job).value_or("none"));
    }
    return names;
  }

  test::TemporaryDirectory folder_;
  std::string root_;
};

TEST_F(DropFolder, NamesAssetsByThePathAndWhatAFolderHolds) {
  EXPECT_THAT(Dropped("metals/chrome.binary", true), UnorderedElementsAre("metals_chrome"));
  EXPECT_THAT(Dropped("wall"), UnorderedElementsAre("wall"));
  EXPECT_THAT(Dropped("wood"), UnorderedElementsAre("wood_oak", "wood_pine"));
  EXPECT_THAT(Dropped("cloth"), UnorderedElementsAre("cloth"));
  EXPECT_THAT(Dropped("two"), UnorderedElementsAre("two_a", "two_b"));
  EXPECT_THAT(Dropped("lab"), UnorderedElementsAre("lab_lacquer", "lab_wall"));
  EXPECT_THAT(Dropped("car"), UnorderedElementsAre("car_car_paint"));
}

TEST_F(DropFolder, AsksForTheSameAssetsWhoeverPlansThem) {
  for (const char* path : {"wall", "wood", "cloth", "two", "lab", "car"})
    EXPECT_THAT(Planned(path), UnorderedElementsAreArray(Dropped(path))) << path;
  for (const char* file : {"gold.bsdf", "metals/chrome.binary", "paint/plain.layers.json"})
    EXPECT_EQ(Planned(file), Dropped(file, true)) << file;
  EXPECT_EQ(Planned("cloth/bumps.btf.json"), Dropped("cloth"));
  EXPECT_EQ(Planned("metals"), Dropped("metals/chrome.binary", true));
  EXPECT_EQ(Planned("").size(), 12u);
}

TEST_F(DropFolder, LeavesOutWhatBelongsToAFileAbove) {
  Text("felt/felt.btf.json", R"({"images": [{"file": "tilted/i1.png"}, {"file": 7}, 3]})");
  Image("felt/i0.png");
  Image("felt/tilted/i1.png");
  Image("felt/other/brick_albedo.png");
  Text("car/car.gltf", R"({"asset": {"version": "2.0"}, "images": [{"uri": "maps/rust_albedo.png"}],
    "textures": [{"source": 0}], "materials": [{"name": "paint",
      "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]})");
  Image("car/maps/rust_albedo.png");
  Image("car/interior/leather_albedo.png");
  EXPECT_THAT(Dropped("felt"), UnorderedElementsAre("felt"));
  EXPECT_THAT(Dropped("felt/tilted"), IsEmpty());
  EXPECT_THAT(Dropped("felt/other"), UnorderedElementsAre("felt_other"));
  EXPECT_THAT(Dropped("car"), UnorderedElementsAre("car_car_paint"));
  EXPECT_THAT(Dropped("car/maps"), IsEmpty());
  // What a scene above does not name is what it would be without the scene.
  EXPECT_THAT(Dropped("car/interior"), UnorderedElementsAre("car_interior"));
  Text("felt/felt.btf.json", "no list");
  EXPECT_THAT(Dropped("felt/tilted"), UnorderedElementsAre("felt_tilted"));  // its job says why not
}

TEST_F(DropFolder, HasNoNameForWhatItDoesNotBake) {
  Job outside;
  outside.folder = folder_ / "dropped";
  EXPECT_FALSE(NameInDropFolder(root_, outside));
  outside.folder = folder_ / "drop/../elsewhere";
  EXPECT_FALSE(NameInDropFolder(root_, outside));
  outside.folder = folder_ / "elsewhere/../drop/wall";
  EXPECT_EQ(NameInDropFolder(root_, outside), "wall");
  outside.maps.resize(1);
  EXPECT_FALSE(NameInDropFolder(root_, outside));
}

}  // namespace
}  // namespace patina
