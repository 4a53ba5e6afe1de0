// glTF files that are wrong, or mean no good.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/formats/scene/gltf_samples.h"

namespace patina {
namespace {

using test::Glb;
using test::Json;
using test::OneMaterial;
using test::SceneFolder;
using testing::HasSubstr;

// A scene of two materials of which the first is broken: the message of its problem. The other must
// be sound.
std::string ProblemOf(const SceneFolder& folder, Json json) {
  json["materials"].push_back({{"name", "sound"}});
  const auto scene = folder.Read(json);
  if (!scene) return "the scene: " + scene.error().message;
  EXPECT_FALSE(scene->materials[1].problem);
  if (!scene->materials[0].problem) return "none";
  EXPECT_THAT(scene->materials[0].problem->message, HasSubstr("s.gltf"));
  return scene->materials[0].problem->message;
}

struct Bad {
  const char* pointer;  // JSON pointer of the value to replace
  const char* value;
  const char* says;  // what the message must hold
};

TEST(GltfHostile, RefusesOneMaterialWithThePlace) {
  const Bad all[] = {
      {"/images/0/uri", R"("../a.png")", "/images/0: \"../a.png\" leaves"},
      {"/images/0/uri", R"("x/../../a.png")", "/images/0"},
      {"/images/0/uri", R"("%2e%2e/a.png")", "leaves the scene's folder"},
      {"/images/0/uri", R"("/etc/passwd")", "leaves the scene's folder"},
      {"/images/0/uri", R"("http://example.com/a.png")", "not a file beside the scene"},
      {"/images/0/uri", R"("file:///etc/passwd")", "not a file beside the scene"},
      {"/images/0/uri", R"("missing.png")", "there is no file"},
      {"/images/0/uri", R"("a.png\u0000.jpg")", "/images/0"},
      {"/images/0/uri", R"("%zz")", "is no URI"},
      {"/images/0/uri", R"("")", "/images/0"},
      {"/images/0/uri", R"(".")", "/images/0"},
      {"/images/0/uri", "7", "/images/0/uri"},
      {"/images/0/uri", R"("data:image/png;base64,@@")", "not base64"},
      {"/images/0/uri", R"("data:image/png,abc")", "base64"},
      {"/images/0/uri", R"("data:image/png;base64,AAAAA")", "cut off"},
      {"/images/0/uri", R"("ktx.png")", "KTX2"},
      {"/images/0/mimeType", R"("image/ktx2")", "KTX2"},
      {"/images/0/mimeType", R"("image/jpeg")", "mimeType says image/jpeg"},
      {"/images/0/mimeType", R"("text/html")", "mimeType"},
      {"/images/0", "{}", "either \"uri\" or \"bufferView\""},
      {"/images/0", "3", "/images/0"},
      {"/images/0", R"({"bufferView": 5})", "/bufferViews/5"},
      {"/textures/0", R"({"extensions": {"KHR_texture_basisu": {"source": 0}}})", "KTX2"},
      {"/textures/0", "{}", "/textures/0: has no \"source\""},
      {"/textures/0/source", "9", "/images/9"},
      {"/textures/0/source", "-1", "/textures/0"},
      {"/textures/0/sampler", "4", "/samplers/4"},
      {"/samplers/0/wrapS", "12", "no wrap mode"},
      {"/materials/0/pbrMetallicRoughness/baseColorTexture/index", "1", "/textures/1"},
      {"/materials/0/pbrMetallicRoughness/baseColorTexture/index", "-1",
       "/materials/0/pbrMetallicRoughness/baseColorTexture/index"},
      {"/materials/0/pbrMetallicRoughness/baseColorTexture/index", "4294967296",
       "/materials/0/pbrMetallicRoughness/baseColorTexture/index"},
      {"/materials/0/pbrMetallicRoughness/baseColorTexture/texCoord", "99", "texCoord"},
      {"/materials/0/pbrMetallicRoughness/roughnessFactor", R"("x")", "roughnessFactor"},
      {"/materials/0/pbrMetallicRoughness/roughnessFactor", "1e300", "roughnessFactor"},
      {"/materials/0/pbrMetallicRoughness/roughnessFactor", "-1", "negative"},
      {"/materials/0/pbrMetallicRoughness/baseColorFactor", "[1, 1]", "baseColorFactor"},
      {"/materials/0/alphaMode", R"("GLASS")", "/materials/0/alphaMode"},
      {"/materials/0", "[]", "/materials/0"},
      {"/materials/0/extensions", "1", "/materials/0/extensions"},
  };
  const SceneFolder folder;
  test::WriteBytes(folder.folder() / "ktx.png", std::string("\xABKTX 20\xBB\r\n\x1A\n", 12));
  for (const Bad& bad : all) {
    Json json = OneMaterial();
    json[Json::json_pointer(bad.pointer)] = Json::parse(bad.value);
    EXPECT_THAT(ProblemOf(folder, json), HasSubstr(bad.says)) << bad.pointer << " " << bad.value;
  }
}

TEST(GltfHostile, RefusesLinksThatLeadOut) {
  const SceneFolder folder;
  const test::TemporaryDirectory outside;
  test::WriteBytes(outside / "secret.png", test::PngBytes());
  std::filesystem::create_symlink(outside / "secret.png", folder.folder() / "link.png");
  std::filesystem::create_directory_symlink(outside.path(), folder.folder() / "door");
  for (const char* uri : {"link.png", "door/secret.png"}) {
    Json json = OneMaterial();
    json["images"][0]["uri"] = uri;
    EXPECT_THAT(ProblemOf(folder, json), HasSubstr("leads out of the scene's folder")) << uri;
  }
}

TEST(GltfHostile, RefusesBuffersOutOfRange) {
  const SceneFolder folder;
  test::WriteBytes(folder.folder() / "b.bin", test::PngBytes());
  const auto problem = [&](const Json& view, const Json& buffer) {
    Json json = OneMaterial();
    json["images"] = {{{"bufferView", 0}, {"mimeType", "image/png"}}};
    json["bufferViews"] = {view};
    json["buffers"] = {buffer};
    return ProblemOf(folder, json);
  };
  const Json good_buffer = {{"uri", "b.bin"}, {"byteLength", 25}};
  const Json good_view = {{"buffer", 0}, {"byteLength", 25}};
  EXPECT_EQ(problem(good_view, good_buffer), "none");
  EXPECT_THAT(problem({{"buffer", 0}, {"byteLength", 26}}, good_buffer),
              HasSubstr("/bufferViews/0"));
  EXPECT_THAT(problem({{"buffer", 0}, {"byteOffset", 18446744073709551615ull}, {"byteLength", 2}},
                      good_buffer),
              HasSubstr("/bufferViews/0"));
  EXPECT_THAT(problem({{"buffer", 0}, {"byteOffset", 2}, {"byteLength", 18446744073709551615ull}},
                      good_buffer),
              HasSubstr("/bufferViews/0"));
  EXPECT_THAT(problem({{"buffer", 0}, {"byteLength", 0}}, good_buffer),
              HasSubstr("/bufferViews/0"));
  EXPECT_THAT(problem({{"buffer", 1}, {"byteLength", 2}}, good_buffer), HasSubstr("/buffers/1"));
  EXPECT_THAT(problem({{"byteLength", 2}}, good_buffer), HasSubstr("buffer"));
  EXPECT_THAT(problem(good_view, {{"uri", "b.bin"}, {"byteLength", 4000}}),
              HasSubstr("/buffers/0/byteLength"));
  EXPECT_THAT(problem(good_view, {{"uri", "../b.bin"}, {"byteLength", 25}}),
              HasSubstr("/buffers/0"));
  EXPECT_THAT(problem(good_view, {{"uri", "http://x/b.bin"}, {"byteLength", 25}}),
              HasSubstr("/buffers/0"));
  EXPECT_THAT(problem(good_view, {{"byteLength", 25}}), HasSubstr("no binary chunk"));
}

TEST(GltfHostile, RefusesWholeScenes) {
  const SceneFolder folder;
  const auto message = [&](const std::string& text) {
    return test::MessageOf(folder.ReadText(text));
  };
  EXPECT_THAT(message(""), HasSubstr("not JSON"));
  EXPECT_THAT(message("[]"), HasSubstr("s.gltf"));
  EXPECT_THAT(message(R"({"asset": {"version": "2.0"}, "asset": {}, "materials": [{}]})"),
              HasSubstr("twice"));
  EXPECT_THAT(message(R"({"asset": {"version": "2.0"}, "x": )" + std::string(100, '[') +
                      std::string(100, ']') + "}"),
              HasSubstr("nested deeper"));
  EXPECT_THAT(message(R"({"asset": {"version": "1.0"}, "materials": [{}]})"),
              HasSubstr("/asset/version"));
  EXPECT_THAT(message(R"({"asset": {"version": "2.0", "minVersion": "3.0"}, "materials": [{}]})"),
              HasSubstr("/asset/minVersion"));
  EXPECT_THAT(message(R"({"materials": [{}]})"), HasSubstr("asset"));
  EXPECT_THAT(message(R"({"asset": {"version": "2.0"}})"), HasSubstr("/materials"));
  EXPECT_THAT(message(R"({"asset": {"version": "2.0"}, "materials": {}})"),
              HasSubstr("/materials"));
  EXPECT_THAT(message(R"({"asset": {"version": "2.0"}, "materials": [{}],
                          "extensionsRequired": ["KHR_materials_ior", "EVIL_thing"]})"),
              HasSubstr("/extensionsRequired/1"));
  Json many = Json::parse(R"({"asset": {"version": "2.0"}})");
  many["materials"] = Json::array();
  for (size_t i = 0; i <= kMaxSceneMaterials; ++i) many["materials"].push_back(Json::object());
  EXPECT_THAT(message(many.dump()), HasSubstr("materials, more than"));
  Json images = OneMaterial();
  images["images"] = Json::array();
  for (size_t i = 0; i <= kMaxSceneImages; ++i) images["images"].push_back({{"uri", "a.png"}});
  EXPECT_THAT(message(images.dump()), HasSubstr("/images"));
  EXPECT_FALSE(ReadScene(folder.folder() / "missing.gltf"));
  EXPECT_FALSE(ReadScene(folder.folder().path() + "/."));
}

TEST(GltfHostile, PassesOverCyclesAndWhateverGeometryHolds) {
  Json json = OneMaterial();
  json["nodes"] = Json::parse(R"([{"children": [1]}, {"children": [0, 99]}])");
  json["scenes"] = Json::parse(R"([{"nodes": [0, 7]}])");
  json["accessors"] = Json::parse(R"([{"bufferView": 77, "count": 1e9}])");
  json["meshes"] = "none";
  const SceneFolder folder;
  EXPECT_EQ(ProblemOf(folder, json), "none");
}

TEST(GltfHostile, RefusesGlbsThatLieAtEveryLength) {
  const SceneFolder folder;
  Json json = OneMaterial();
  const std::string glb = Glb(json, "binary");
  ASSERT_OK(folder.ReadText(glb, "s.glb"));
  for (size_t size = 0; size < glb.size(); size += size < 40 ? 1 : 7) {
    const auto scene = folder.ReadText(glb.substr(0, size), "s.glb");
    EXPECT_FALSE(scene) << size;
  }
  EXPECT_FALSE(folder.ReadText(glb + "x", "s.glb"));
  const auto with = [&](size_t at, uint32_t value) {
    std::string bytes = glb;
    bytes.replace(at, 4, test::Word(value));
    return test::MessageOf(folder.ReadText(bytes, "s.glb"));
  };
  EXPECT_THAT(with(4, 1), HasSubstr("version 1"));
  EXPECT_THAT(with(8, 0xFFFFFFFF), HasSubstr("byte 8"));
  EXPECT_THAT(with(12, 0xFFFFFFFF), HasSubstr("byte 12"));
  EXPECT_THAT(with(12, 0), HasSubstr("byte 20"));
  EXPECT_THAT(with(16, 0x004E4942), HasSubstr("not JSON"));
}

}  // namespace
}  // namespace patina
