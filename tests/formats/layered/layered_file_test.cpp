#include "formats/layered/layered_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/layered/varying_stack.h"
#include "formats/schema_check.h"

namespace patina::layered {
namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string ExampleText(const std::string& name) {
  auto text = ReadTextFile(std::string(PATINA_SOURCE_DIR) + "/schemas/examples/" + name, 1 << 20);
  EXPECT_TRUE(text.has_value()) << name;
  return text ? *text : "";
}

// What is wrong; empty if nothing is.
std::string Problem(std::string_view text) {
  const auto stack = ParseVaryingStack(text, "x.layers.json");
  return stack ? "" : stack.error().message;
}

std::string With(const char* pointer, const Json& value) {
  Json json = Json::parse(ExampleText("layered_full.json"));
  json[Json::json_pointer(pointer)] = value;
  return Problem(json.dump());
}

TEST(LayeredFile, ReadsEveryField) {
  const auto stack = ParseStack(ExampleText("layered_full.json"), "full");
  ASSERT_TRUE(stack.has_value()) << stack.error().message;
  ASSERT_EQ(stack->layers.size(), 2u);
  const Layer& top = stack->layers[0];
  EXPECT_EQ(top.ior, 1.5);
  EXPECT_EQ(top.roughness.x, 0.2);
  EXPECT_EQ(top.roughness.y, 0.05);
  EXPECT_NEAR(top.roughness.rotation_rad, 0.5235987756, 1e-9);
  EXPECT_EQ(top.thickness, 0.5);
  EXPECT_EQ(top.absorption, (Rgb{0.1, 0.2, 0.3}));
  EXPECT_EQ(top.scattering, (Rgb{1.5, 1.5, 1.5}));
  EXPECT_EQ(top.asymmetry, 0.4);
  EXPECT_FALSE(stack->layers[1].roughness.anisotropic());
  ASSERT_EQ(stack->parts.size(), 3u);
  EXPECT_EQ(stack->parts[0].eta, Metals()[3].eta);
  EXPECT_EQ(stack->parts[1].k, (Rgb{3.5, 3.5, 3.5}));
  EXPECT_EQ(stack->parts[1].roughness.y, 0.1);
  EXPECT_EQ(stack->parts[2].kind, BaseKind::kDiffuse);
  EXPECT_EQ(stack->parts[2].albedo, (Rgb{0.1, 0.2, 0.7}));
  EXPECT_EQ(stack->parts[2].weight, 0.2);
  EXPECT_TRUE(ParseStack(ExampleText("layered_black.json"), "x")->parts.empty());
}

TEST(LayeredFile, ReadsMapsInPlaceOfNumbers) {
  const auto read = ParseVaryingStack(ExampleText("layered_maps.json"), "maps");
  ASSERT_TRUE(read.has_value()) << read.error().message;
  EXPECT_FALSE(read->wrap);
  ASSERT_TRUE(read->normal.has_value());
  EXPECT_TRUE(read->normal->directx);
  EXPECT_EQ(read->Files(),
            (std::vector<std::string>{"brushed.png", "flakes.png", "normal.png", "thickness.png",
                                      "tint.png", "turn.png", "wood.png"}));
  const struct {
    const char* pointer;
    StackNumber number;
    int layer, part, axis;
  } wanted[] = {{"/layers/0/roughness/0", StackNumber::kRoughness, 0, -1, 0},
                {"/layers/0/rotation_deg", StackNumber::kRotation, 0, -1, -1},
                {"/layers/0/thickness", StackNumber::kThickness, 0, -1, -1},
                {"/layers/0/absorption", StackNumber::kAbsorption, 0, -1, -1},
                {"/layers/0/asymmetry", StackNumber::kAsymmetry, 0, -1, -1},
                {"/layers/1/ior", StackNumber::kIor, 1, -1, -1},
                {"/layers/1/roughness", StackNumber::kRoughness, 1, -1, -1},
                {"/base/parts/0/weight", StackNumber::kWeight, -1, 0, -1},
                {"/base/parts/1/albedo", StackNumber::kAlbedo, -1, 1, -1}};
  ASSERT_EQ(read->maps.size(), std::size(wanted));
  for (size_t m = 0; m < read->maps.size(); ++m) {
    const StackMap& map = read->maps[m];
    EXPECT_EQ(map.pointer, wanted[m].pointer);
    EXPECT_EQ(map.number, wanted[m].number) << map.pointer;
    EXPECT_EQ(map.layer, wanted[m].layer) << map.pointer;
    EXPECT_EQ(map.part, wanted[m].part) << map.pointer;
    EXPECT_EQ(map.axis, wanted[m].axis) << map.pointer;
  }
  EXPECT_EQ(read->maps[2].channel, "g");
  EXPECT_EQ(read->maps[2].scale, 1.5);
  EXPECT_EQ(read->maps[2].offset, 0.01);
  EXPECT_EQ(read->maps[8].color_space, "srgb");
  EXPECT_EQ(read->stack.layers[0].roughness.y, 0.2);
  EXPECT_EQ(read->stack.parts[1].weight, 0.5);
  // Who wants one point's numbers is told which is none.
  const auto plain = ParseStack(ExampleText("layered_maps.json"), "maps");
  ASSERT_FALSE(plain.has_value());
  EXPECT_THAT(plain.error().message,
              AllOf(StartsWith("maps: /layers/0/roughness/0: is a map"), HasSubstr("\"svbrdf\"")));
  EXPECT_FALSE(ParseVaryingStack(ExampleText("layered_full.json"), "full")->varies());
}

// Reader and schema must agree on maps, too.
TEST(LayeredFile, RefusesMapsThatCannotBe) {
  const Json full = Json::parse(ExampleText("layered_maps.json"));
  const Json flat = full.flatten();
  for (const auto& [pointer, value] : flat.items()) {
    const std::string key = pointer.substr(pointer.rfind('/') + 1);
    if (key != "map" && key != "scale" && key != "offset" && key != "channel" &&
        key != "color_space" && key != "convention" && key != "address")
      continue;
    for (const Json& wrong :
         {Json(nullptr), Json(true), Json(-1), Json(1e300), Json(""), Json("x"), Json("g"),
          Json("../x.png"), Json(".x"), Json("a/b.png"), Json(Json::object()), Json(0)}) {
      Json json = full;
      json[Json::json_pointer(pointer)] = wrong;
      const std::string problem = Problem(json.dump());
      EXPECT_EQ(CheckAgainstSchema("layered", json).has_value(), problem.empty())
          << pointer << " " << wrong << " " << problem;
      // The pointer is that of the value, or of what it stands in.
      if (!problem.empty()) {
        EXPECT_THAT(problem, HasSubstr(pointer.substr(0, pointer.rfind('/')))) << problem;
      }
    }
  }
  Json json = full;
  json["layers"][0]["thickness"]["gain"] = 2;
  EXPECT_THAT(Problem(json.dump()), HasSubstr("/layers/0/thickness/gain"));
  json = full;
  json["layers"][0]["thickness"].erase("map");
  EXPECT_THAT(Problem(json.dump()), HasSubstr("/layers/0/thickness: \"map\" is missing"));
  json = full;
  json["layers"][0]["absorption"]["color_space"] = "srgb";  // data is not converted
  EXPECT_THAT(Problem(json.dump()), HasSubstr("/layers/0/absorption/color_space"));
}

TEST(LayeredFile, WritesWhatItReads) {
  for (const char* name : {"layered_full.json", "layered_minimal.json", "layered_black.json"}) {
    const auto stack = ParseStack(ExampleText(name), name);
    ASSERT_TRUE(stack.has_value());
    const std::string text = FormatStack(*stack);
    const auto again = ParseStack(text, name);
    ASSERT_TRUE(again.has_value()) << again.error().message;
    EXPECT_EQ(FormatStack(*again), text);
    EXPECT_TRUE(CheckAgainstSchema("layered", Json::parse(text)).has_value()) << text;
  }
}

// Reader and schema must agree, or a file that an editor calls valid would be refused.
TEST(LayeredFile, AgreesWithItsSchema) {
  int valid = 0, invalid = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(PATINA_SOURCE_DIR) + "/schemas/examples")) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("layered_", 0) != 0) continue;
    const std::string text = ExampleText(name);
    const bool good = name.rfind("layered_invalid", 0) != 0;
    ++(good ? valid : invalid);
    EXPECT_EQ(CheckAgainstSchema("layered", Json::parse(text)).has_value(), good) << name;
    EXPECT_EQ(Problem(text).empty(), good) << name << Problem(text);
  }
  EXPECT_GE(valid, 3);
  EXPECT_GE(invalid, 5);
  // Every member of the full example, replaced by what it cannot be.
  const Json full = Json::parse(ExampleText("layered_full.json"));
  const Json flat = full.flatten();
  for (const auto& [pointer, value] : flat.items()) {
    for (const Json& wrong : {Json(nullptr), Json(true), Json(-1), Json(1e300), Json(""), Json("x"),
                              Json(Json::array()), Json(Json::object()), Json(0), Json(1)}) {
      Json json = full;
      json[Json::json_pointer(pointer)] = wrong;
      const bool by_schema = CheckAgainstSchema("layered", json).has_value();
      const std::string problem = Problem(json.dump());
      if (!by_schema) {
        EXPECT_NE(problem, "") << pointer << " " << wrong;
      }
      // Sums of weights and the roughness of parts are the reader's to judge.
      if (by_schema && problem.find("weights sum") == std::string::npos &&
          problem.find("/roughness: ") == std::string::npos &&
          problem.find("without any thickness") == std::string::npos &&
          problem.find("is no index of a metal") == std::string::npos) {
        EXPECT_EQ(problem, "") << pointer << " " << wrong;
      }
    }
  }
}

TEST(LayeredFile, NamesThePlaceTheValueAndTheRemedy) {
  EXPECT_THAT(With("/layers/0/thickness", -0.5),
              AllOf(StartsWith("x.layers.json: /layers/0/thickness: -0.5 is negative"),
                    HasSubstr("give 0 or more"), HasSubstr("schemas/layered.schema.json")));
  EXPECT_THAT(With("/layers/1/ior", 0.75),
              AllOf(HasSubstr("/layers/1/ior: 0.75 is below 1"), HasSubstr("of the layer itself")));
  EXPECT_THAT(With("/layers/1/ior", 11), HasSubstr("\"conductor\""));
  EXPECT_THAT(With("/base/parts/2/albedo", 1.5),
              AllOf(HasSubstr("/base/parts/2/albedo: 1.5 is above 1"), HasSubstr("give 0 to 1")));
  EXPECT_THAT(With("/base/parts/0/weight", 0.6), HasSubstr("the weights sum to 1.1"));
  EXPECT_THAT(With("/base/parts/0/roughness", 0), HasSubstr("/base/parts/0/roughness: is 0"));
  EXPECT_THAT(With("/base/parts/0/metal", "cheese"), HasSubstr("\"cheese\" is not one of: alumin"));
  EXPECT_THAT(With("/base/parts/0/kind", "glass"), HasSubstr("/base/parts/0/kind"));
  EXPECT_THAT(With("/layers/0/roughness", 2), HasSubstr("/layers/0/roughness: 2"));
  EXPECT_THAT(With("/layers/0/roughness", Json::array({0.1})), HasSubstr("/layers/0/roughness"));
  EXPECT_THAT(With("/layers/0/absorption", Json::array({0.1, 0.2})),
              HasSubstr("/layers/0/absorption"));
  EXPECT_THAT(With("/layers/0/scattering", -2), HasSubstr("/layers/0/scattering: -2"));
  EXPECT_THAT(With("/layers/0/asymmetry", 1), HasSubstr("/layers/0/asymmetry: 1"));
  EXPECT_THAT(With("/layers/0/thickness", 0), HasSubstr("without any thickness"));
  EXPECT_THAT(With("/layers/0/colour", 0), HasSubstr("/layers/0/colour: is not a field"));
  EXPECT_THAT(With("/version", 2), HasSubstr("/version: 2"));
  EXPECT_THAT(Problem(ExampleText("layered_invalid_no_base.json")),
              AllOf(HasSubstr("/base: is missing"), HasSubstr("\"black\"")));
  EXPECT_THAT(Problem("{\"version\": 1, \"version\": 1}"), HasSubstr("version"));
  Json many = Json::parse(ExampleText("layered_full.json"));
  for (int i = 0; i < 8; ++i) many["layers"].push_back(many["layers"][1]);
  EXPECT_THAT(Problem(many.dump()), HasSubstr("/layers"));
}

TEST(LayeredFile, EveryTruncationIsRefused) {
  std::string text = ExampleText("layered_full.json");
  while (!text.empty() && text.back() != '}') text.pop_back();
  for (size_t length = 0; length < text.size(); ++length)
    EXPECT_NE(Problem(std::string_view(text).substr(0, length)), "") << length;
  EXPECT_NE(Problem(text + "]"), "");
}

TEST(LayeredFile, IsKnownByItsName) {
  EXPECT_TRUE(IsLayersFileName("a/wood.layers.json"));
  EXPECT_TRUE(IsLayersFileName("Wood.Layers.JSON"));
  for (const char* other : {"layers.json", ".layers.json", "a/.layers.json", "wood.json",
                            "wood.layers", "wood.layers.json.txt"}) {
    EXPECT_FALSE(IsLayersFileName(other)) << other;
  }
}

}  // namespace
}  // namespace patina::layered
