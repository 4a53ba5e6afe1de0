// Scene files of our own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "formats/base/file_io.h"
#include "formats/schema_check.h"
#include "tests/formats/scene/gltf_samples.h"

namespace patina {
namespace {

using test::Json;
using testing::HasSubstr;

class SceneFile : public testing::Test {
 protected:
  SceneFile() {
    for (const char* name :
         {"a.png", "wall_color.png", "wall_orm.png", "wall_normal.png", "sign.png"})
      test::WriteBytes(folder_ / name, test::PngBytes());
  }
  Result<Scene> Read(const Json& json) {
    test::WriteBytes(folder_ / "s.patina.json", json.dump());
    return ReadScene(folder_ / "s.patina.json");
  }
  // The first problem, of the scene or of a material; "" if there is none.
  std::string Problem(const Json& json) {
    const auto scene = Read(json);
    if (!scene) return scene.error().message;
    for (const SceneMaterial& material : scene->materials) {
      if (material.problem) return material.problem->message;
    }
    return "";
  }
  static Json Example(const std::string& name) {
    const auto text =
        ReadTextFile(std::string(PATINA_SOURCE_DIR) + "/schemas/examples/" + name, 1 << 20);
    return Json::parse(text.value_or("null"));
  }
  test::TemporaryDirectory folder_;
};

TEST_F(SceneFile, SaysWhatIsLookedAt) {
  const auto scene = Read(Example("scene_full.json"));
  ASSERT_OK(scene);
  EXPECT_EQ(scene->name, "s");
  ASSERT_EQ(scene->materials.size(), 3u);
  const SceneMaterial& wall = scene->materials[0];
  ASSERT_FALSE(wall.problem) << wall.problem->message;
  EXPECT_EQ(wall.asset, "s_wall");
  EXPECT_EQ(test::FindMap(wall, "metalness")->prune, ScenePrune::kUnused);
  EXPECT_EQ(test::FindMap(wall, "roughness")->prune, ScenePrune::kNone);
  ASSERT_TRUE(wall.density.has_value());
  EXPECT_EQ(wall.density->max_pixels_per_m, 400);
  EXPECT_EQ(scene->images.size(), 4u);  // the packed file once
  EXPECT_EQ(scene->materials[1].constants.size(), 3u);
  const SceneMaterial& sign = scene->materials[2];
  EXPECT_TRUE(sign.look.unlit);
  EXPECT_TRUE(sign.clamp);
  EXPECT_EQ(sign.look.alpha_cutoff, 0.25);
  EXPECT_EQ(sign.lod_range, (std::array<int, 2>{1, 6}));
}

// Reader and schema must agree, or a file that an editor calls valid would be refused.
TEST_F(SceneFile, AgreesWithItsSchema) {
  int valid = 0, invalid = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(PATINA_SOURCE_DIR) + "/schemas/examples")) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("scene_", 0) != 0) continue;
    const Json json = Example(name);
    const bool good = name.rfind("scene_invalid", 0) != 0;
    ++(good ? valid : invalid);
    EXPECT_EQ(CheckAgainstSchema("scene", json).has_value(), good) << name;
    EXPECT_EQ(Problem(json), good ? "" : Problem(json)) << name;
    EXPECT_EQ(Problem(json).empty(), good) << name;
  }
  EXPECT_GE(valid, 2);
  EXPECT_GE(invalid, 4);
  // Every member of the full example, replaced by what it cannot be.
  const Json full = Example("scene_full.json");
  const Json flat = full.flatten();
  for (const auto& [pointer, value] : flat.items()) {
    for (const Json& wrong : {Json(nullptr), Json(true), Json(-1), Json(1e300), Json(""), Json("x"),
                              Json(Json::array()), Json(Json::object())}) {
      Json json = full;
      json[Json::json_pointer(pointer)] = wrong;
      const bool by_schema = CheckAgainstSchema("scene", json).has_value();
      // Names of files and of maps in "uses" are the reader's to judge.
      if (by_schema && (pointer.find("/file") != std::string::npos ||
                        pointer.find("/role") != std::string::npos ||
                        pointer.find("/uses") != std::string::npos))
        continue;
      EXPECT_EQ(Problem(json).empty(), by_schema)
          << pointer << " " << wrong << " " << Problem(json);
    }
  }
}

TEST_F(SceneFile, RefusesWhatItCannotMean) {
  const Json minimal = Example("scene_minimal.json");
  const auto with = [&](const char* pointer, const Json& value) {
    Json json = minimal;
    json[Json::json_pointer(pointer)] = value;
    return Problem(json);
  };
  EXPECT_THAT(with("/version", 2), HasSubstr("/version"));
  EXPECT_THAT(with("/materials", Json::array()), HasSubstr("/materials"));
  EXPECT_THAT(with("/materials/0/maps/0/file", "../a.png"), HasSubstr("/materials/0/maps/0/file"));
  EXPECT_THAT(with("/materials/0/maps/0/file", "none.png"), HasSubstr("there is no file"));
  EXPECT_THAT(with("/materials/0/maps/1", {{"role", "albedo"}, {"file", "a.png"}}),
              HasSubstr("/materials/0/maps/1/role"));
  EXPECT_THAT(with("/materials/0/constants", {{"albedo", 1}}), HasSubstr("/constants/albedo"));
  EXPECT_THAT(with("/materials/0/uses", {"normal"}), HasSubstr("/uses/0"));
  EXPECT_THAT(with("/materials/0/lod_range", {3, 1}), HasSubstr("/lod_range"));
}

}  // namespace
}  // namespace patina
