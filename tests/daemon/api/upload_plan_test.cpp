#include "daemon/api/upload_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

// Files need no content: images are not opened.
class UploadPlan : public ::testing::Test {
 protected:
  void Write(const std::string& name, const std::string& text = "") {
    const fs::path path = folder_ / ("sent/" + name);
    fs::create_directories(path.parent_path());
    std::ofstream(path) << text;
  }
  void WriteSet(const std::string& folder, const std::string& set) {
    for (const char* map : {"_albedo.png", "_normal.png"}) Write(folder + set + map);
  }
  std::vector<Job> Plan() { return PlanUpload(folder_ / "sent"); }
  std::vector<std::string> Assets() {
    std::vector<std::string> names;
    for (const Job& job : Plan()) names.push_back(job.asset);
    return names;
  }

  test::TemporaryDirectory folder_;
};

TEST_F(UploadPlan, MakesOneJobOfAFolderWithOneSet) {
  WriteSet("", "wall");
  const std::vector<Job> jobs = Plan();
  ASSERT_EQ(jobs.size(), 1u);
  EXPECT_EQ(jobs[0].kind, JobKind::kMaterial);
  EXPECT_EQ(jobs[0].asset, "sent");
  EXPECT_EQ(jobs[0].folder, folder_ / "sent");
  EXPECT_EQ(jobs[0].set, "");
  EXPECT_EQ(jobs[0].out, "");
}

TEST_F(UploadPlan, NamesEachSetOfAFolder) {
  WriteSet("library/", "brick");
  WriteSet("library/", "stone");
  const std::vector<Job> jobs = Plan();
  ASSERT_EQ(jobs.size(), 2u);
  EXPECT_EQ(jobs[0].set, "library_brick");
  EXPECT_EQ(jobs[0].asset, "library_brick");
  EXPECT_EQ(jobs[1].asset, "library_stone");
}

TEST_F(UploadPlan, TellsFoldersAndFilesOfOneNameApart) {
  WriteSet("a/wall/", "wall");
  WriteSet("b/wall/", "wall");
  Write("steel.binary");
  Write("steel.bsdf");
  Write("deep/wall.binary");
  EXPECT_THAT(Assets(), UnorderedElementsAre("sent_a_wall", "sent_b_wall", "sent_steel_binary",
                                             "sent_steel_bsdf", "sent_deep_wall_binary"));
}

TEST_F(UploadPlan, GivesLongNamesThatCollideANumber) {
  WriteSet("a_b/wall/", "wall");
  WriteSet("a/b/wall/", "wall");
  const auto names = Assets();
  ASSERT_EQ(names.size(), 2u);
  EXPECT_NE(names[0], names[1]);
  for (const std::string& name : names) EXPECT_TRUE(IsAssetName(name)) << name;
  const std::string far(200, 'x');
  WriteSet(far + "1/wall/", "wall");
  WriteSet(far + "2/wall/", "wall");
  std::set<std::string> apart;
  for (const std::string& name : Assets()) {
    EXPECT_TRUE(IsAssetName(name)) << name;
    EXPECT_TRUE(apart.insert(name).second) << name;
  }
  EXPECT_EQ(apart.size(), 4u);
}

TEST_F(UploadPlan, LeavesTheTexturesOfScenesToThem) {
  Write("scene/textures/tile_albedo.png");
  Write("scene/textures/tile_normal.png");
  WriteSet("scene/textures/", "loose");
  Write("scene/hall.gltf", R"({"asset": {"version": "2.0"},
    "images": [{"uri": "textures/tile_albedo.png"}, {"uri": "textures/tile_normal.png"}],
    "textures": [{"source": 0}, {"source": 1}],
    "materials": [{"name": "tile", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
                   "normalTexture": {"index": 1}}]})");
  const std::vector<Job> jobs = Plan();
  ASSERT_EQ(jobs.size(), 2u);
  EXPECT_EQ(jobs[0].scene, folder_ / "sent/scene/hall.gltf");
  EXPECT_EQ(jobs[0].scene_material, "tile");
  EXPECT_EQ(jobs[1].set, "textures_loose");
}

TEST_F(UploadPlan, TakesTheImagesBesideAListForIts) {
  Write("cloth/linen.btf.json", "{}");  // what is wrong with it its run says
  WriteSet("cloth/", "linen");
  WriteSet("wall/", "wall");
  const std::vector<Job> jobs = Plan();
  ASSERT_EQ(jobs.size(), 2u);
  EXPECT_EQ(jobs[0].kind, JobKind::kSvbrdf);
  EXPECT_EQ(jobs[0].file, folder_ / "sent/cloth/linen.btf.json");
  EXPECT_EQ(jobs[0].asset, "linen");
  EXPECT_EQ(jobs[1].asset, "wall");
}

TEST_F(UploadPlan, LetsTheRunSayWhatIsWrongWithAScene) {
  Write("hall.gltf", "{");
  const std::vector<Job> jobs = Plan();
  ASSERT_EQ(jobs.size(), 1u);
  EXPECT_EQ(jobs[0].scene, folder_ / "sent/hall.gltf");
  EXPECT_TRUE(IsAssetName(jobs[0].asset));
}

TEST_F(UploadPlan, PassesOverWhatIsHiddenLinkedOrNothingToBake) {
  EXPECT_THAT(Plan(), IsEmpty());
  Write("readme.txt", "words");
  WriteSet(".git/", "wall");
  WriteSet("wall/", "wall");
  fs::create_directory_symlink(folder_ / "sent/wall", folder_ / "sent/again");
  fs::create_directory_symlink(folder_ / "sent", folder_ / "sent/wall/up");
  EXPECT_THAT(Assets(), ElementsAre("wall"));
}

}  // namespace
}  // namespace patina::daemon
