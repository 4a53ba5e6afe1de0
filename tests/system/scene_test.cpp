// Scenes as a user bakes them: the real program, real files, exit codes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "formats/container.h"
#include "formats/decoder/patina_decoder.h"
#include "formats/schema_check.h"
#include "pipeline/image/image_io.h"
#include "tests/system/child_process.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing_support::Outcome;
using testing_support::Patina;
using testing_support::ReadAll;
using testing_support::Snapshot;
using testing_support::TempFolder;
using Json = nlohmann::json;

Outcome Bake(std::vector<std::string> arguments) {
  std::vector<std::string> all = {"bake"};
  all.insert(all.end(), arguments.begin(), arguments.end());
  all.insert(all.end(), {"--quality", "preview", "--profile", "bcf-0.5k", "--samples", "2e5"});
  return Patina(all);
}

class Scenes : public testing::Test {
 protected:
  void SetUp() override {
    const Outcome made =
        Patina({"sample", "--kind", "scene", "--out", folder_ / "in", "--size", "32", "--quiet"});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  Json Read(const std::string& name) const {
    return Json::parse(ReadAll(folder_ / name), nullptr, false);
  }
  TempFolder folder_;
};

std::string StateOf(const Json& manifest, const std::string& what) {
  for (const Json& effect : manifest["effects"]) {
    if (effect["what"] == what) return effect["state"];
  }
  return "none";
}

TEST_F(Scenes, BakeWithAManifestOfTheWhole) {
  const Outcome baked = Bake({folder_ / "in/mosaic.gltf", "--out", folder_ / "out"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const Json scene = Read("out/mosaic.scene.json");
  ASSERT_EQ(scene["format"], "patina-scene");
  ASSERT_EQ(scene["materials"].size(), 5u);
  for (const Json& material : scene["materials"]) {
    const std::string container = material["container"];
    const auto opened = OpenContainer(folder_ / ("out/" + container));
    ASSERT_TRUE(opened) << opened.error().message;
    EXPECT_TRUE(VerifyPayloads(*opened));
    const Json manifest = Json::parse(ReadAll(opened->PathOf(kManifestName)));
    EXPECT_TRUE(CheckAgainstSchema("manifest", manifest)) << container;
    EXPECT_EQ(material["scene"], manifest["scene"]);
    EXPECT_EQ(material["effects"], manifest["effects"]);
    EXPECT_FALSE(fs::exists(opened->directory + "/source"));
  }
  const Json floor = scene["materials"][0];
  EXPECT_EQ(floor["asset"], "mosaic_floor");
  // The glow above 1 survives as a factor.
  bool found = false;
  for (const Json& factor : floor["scene"]["factors"])
    found = found || factor == Json::parse(R"({"map": "emissive", "value": [8.0, 8.0, 8.0]})");
  EXPECT_TRUE(found) << floor["scene"]["factors"];
  EXPECT_EQ(StateOf(floor, "opacity"), "left_out");
  const Json wet = scene["materials"][1];
  EXPECT_EQ(StateOf(wet, "metalness"), "constant");
  EXPECT_EQ(StateOf(wet, "emissive"), "left_out");
  EXPECT_EQ(StateOf(scene["materials"][2], "normal"), "left_out");  // unlit
  // Brass is numbers alone.
  Decoder brass;
  std::string problem;
  ASSERT_EQ(Decoder::Load(folder_ / "out/mosaic_brass", &brass, &problem), Decoder::LoadStatus::kOk)
      << problem;
  EXPECT_EQ(brass.outputs(), 0);
  std::vector<float> values(brass.channels().size());
  brass.Physical(0.3, 0.7, 0, values.data());
  EXPECT_FLOAT_EQ(values[0], 0.91f);
  EXPECT_TRUE(fs::exists(folder_ / "out/mosaic_brass/current/preview.png"));
}

TEST_F(Scenes, BakeOnlyTheMaterialsThatAreAskedFor) {
  const Outcome one = Bake({folder_ / "in/mosaic.gltf", "--material", "brass", "--material", "#4",
                            "--out", folder_ / "out", "--json"});
  EXPECT_EQ(one.exit_code, 3);  // glass has a name and is not called #4
  EXPECT_THAT(one.err, HasSubstr("no scene here has a material \"#4\""));
  EXPECT_TRUE(fs::exists(folder_ / "out/mosaic_brass/current"));
  EXPECT_FALSE(fs::exists(folder_ / "out/mosaic_floor"));
  EXPECT_EQ(Read("out/mosaic.scene.json")["materials"][3]["revision"], "r0001");
}

TEST_F(Scenes, GoOnWithTheOthersWhenOneIsBroken) {
  Json gltf = Read("in/mosaic.gltf");
  gltf["images"][3]["uri"] = "http://example.com/a.png";  // of floor, wet floor and sign
  std::ofstream(folder_ / "in/mosaic.gltf") << gltf;
  const Outcome baked = Bake({folder_ / "in/mosaic.gltf", "--out", folder_ / "out"});
  EXPECT_EQ(baked.exit_code, 3);
  EXPECT_THAT(baked.err, HasSubstr("/materials/0: emissiveTexture: /images/3: "));
  EXPECT_TRUE(fs::exists(folder_ / "out/mosaic_brass/current"));
  EXPECT_FALSE(fs::exists(folder_ / "out/mosaic_floor/current"));
  const Json scene = Read("out/mosaic.scene.json");
  EXPECT_THAT(scene["materials"][0]["problem"].get<std::string>(), HasSubstr("/images/3"));
  EXPECT_FALSE(scene["materials"][0].contains("revision"));
}

TEST_F(Scenes, InAFolderOwnTheirTextures) {
  const Outcome baked = Bake({folder_ / "in", "--out", folder_ / "out"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  std::vector<std::string> assets;
  for (const auto& entry : fs::directory_iterator(folder_ / "out")) {
    if (entry.is_directory()) assets.push_back(entry.path().filename().string());
  }
  EXPECT_THAT(assets,
              testing::UnorderedElementsAre("mosaic_floor", "mosaic_wet_floor", "mosaic_sign",
                                            "mosaic_brass", "mosaic_glass", "afar_far_floor"));
  const Json manifest = Read("out/afar_far_floor/current/manifest.json");
  EXPECT_EQ(manifest["format_version"], 2);
  EXPECT_EQ(manifest["lod_range"], (Json{0, 3}));  // 32 texels on 2 m at 2 to 16 pixels a metre
}

TEST_F(Scenes, OfOneNameDoNotDescribeThemselvesInOneFile) {
  fs::copy_file(folder_ / "in/mosaic.gltf", folder_ / "in/mosaic.GLTF");
  const Outcome baked = Bake({folder_ / "in/mosaic.gltf", folder_ / "in/mosaic.GLTF", "--material",
                              "brass", "--out", folder_ / "out"});
  EXPECT_EQ(baked.exit_code, 3);
  EXPECT_THAT(baked.err, HasSubstr("would both be described in"));
  EXPECT_EQ(Read("out/mosaic.scene.json")["file"], "mosaic.gltf");
}

TEST_F(Scenes, BakeTheSameFromAJobFileAndTwice) {
  const Json job = {{"version", 1},
                    {"kind", "material"},
                    {"asset", "mosaic_floor"},
                    {"scene", "in/mosaic.gltf"},
                    {"material", "floor"},
                    {"out", "by_job"},
                    {"quality", "preview"},
                    {"profile", "bcf-0.5k"},
                    {"samples", 2e5}};
  std::ofstream(folder_ / "job.json") << job;
  const Outcome run = Patina({"run", folder_ / "job.json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  for (const char* out : {"out", "again"}) {
    const Outcome baked =
        Bake({folder_ / "in/mosaic.gltf", "--material", "floor", "--out", folder_ / out});
    ASSERT_EQ(baked.exit_code, 0) << baked.err;
  }
  EXPECT_EQ(Snapshot(folder_ / "out/mosaic_floor"), Snapshot(folder_ / "by_job/mosaic_floor"));
  EXPECT_EQ(Snapshot(folder_ / "out/mosaic_floor"), Snapshot(folder_ / "again/mosaic_floor"));
}

TEST_F(Scenes, LearnEverythingWhenAskedTo) {
  const Outcome baked = Bake({folder_ / "in/mosaic.gltf", "--material", "wet floor", "--learn-all",
                              "--out", folder_ / "out"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const Json manifest = Read("out/mosaic_wet_floor/current/manifest.json");
  EXPECT_EQ(StateOf(manifest, "emissive.r"), "learned");
  EXPECT_EQ(StateOf(manifest, "metalness"), "learned");
  EXPECT_EQ(manifest["network"]["outputs"], 10);
}

TEST_F(Scenes, BringTheirColoursToTheWorkingSpace) {
  const Outcome brass = Bake({folder_ / "in/mosaic.gltf", "--material", "brass", "--working-space",
                              "acescg", "--out", folder_ / "out"});
  ASSERT_EQ(brass.exit_code, 0) << brass.err;
  Decoder decoder;
  std::string problem;
  ASSERT_EQ(Decoder::Load(folder_ / "out/mosaic_brass", &decoder, &problem),
            Decoder::LoadStatus::kOk)
      << problem;
  std::vector<float> values(decoder.channels().size());
  decoder.Physical(0.3, 0.7, 0, values.data());
  // The first row of the matrix from linear Rec.709 to AP1, to the digits it is published with.
  EXPECT_NEAR(values[0], 0.6131 * 0.91 + 0.3395 * 0.78 + 0.0474 * 0.42, 2e-4);
  // The factor of its base colour is not grey.
  const Outcome wet = Bake({folder_ / "in/mosaic.gltf", "--material", "wet floor",
                            "--working-space", "acescg", "--out", folder_ / "out"});
  EXPECT_EQ(wet.exit_code, 3);
  EXPECT_THAT(wet.err, HasSubstr("the factor of albedo has a colour"));
  EXPECT_FALSE(fs::exists(folder_ / "out/mosaic_wet_floor/current"));
}

TEST_F(Scenes, SayTheScaleOfConstantsThatAreLogarithms) {
  std::vector<float> values;
  for (int i = 0; i < 32 * 32; ++i) {
    const float red = i == 500 ? 1e5f : 0.1f + 0.01f * static_cast<float>(i % 32);
    values.insert(values.end(), {red, 3.5f, 0.2f});
  }
  ASSERT_TRUE(
      WriteImage(folder_ / "in/glow.exr", WriteFormat::kExrFloat, 32, 32, 3, values.data()));
  std::ofstream(folder_ / "in/glow.patina.json")
      << R"({"version": 1, "materials": [{"name": "lamp", "maps": [{"role": "emissive", "file": "glow.exr"}]}]})";
  const Outcome baked = Bake({folder_ / "in/glow.patina.json", "--out", folder_ / "out"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const Json constants = Read("out/glow.scene.json")["materials"][0]["constants"];
  ASSERT_EQ(constants.size(), 2u) << constants;
  ASSERT_EQ(constants[0]["encoding"], "signed_log");
  const double scale = constants[0].value("scale", 1.0);
  EXPECT_NEAR(scale * (std::exp2(constants[0]["value"].get<double>()) - 1), 3.5, 1e-4);
  EXPECT_NE(scale, 1.0);
}

TEST_F(Scenes, UnpackTheFinestMipThatIsStored) {
  const Outcome baked = Bake({folder_ / "in/mosaic.gltf", "--material", "floor", "--lod-range",
                              "2,4", "--out", folder_ / "out"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const std::string asset = folder_ / "out/mosaic_floor";
  ASSERT_EQ(Patina({"unpack", asset, "--out", folder_ / "maps"}).exit_code, 0);
  auto info = ReadImageInfo(folder_ / "maps/albedo.png");
  ASSERT_TRUE(info) << info.error().message;
  EXPECT_EQ(info->width, 32 >> 2);
  const Outcome finer = Patina({"unpack", asset, "--out", folder_ / "maps", "--mip", "1"});
  EXPECT_EQ(finer.exit_code, 3);
  EXPECT_THAT(finer.err, HasSubstr("there is no mip 1; its mips are 2 to 4"));
}

}  // namespace
}  // namespace patina
