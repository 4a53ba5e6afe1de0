// What the materials of glTF files are made of.
#include <gtest/gtest.h>

#include "tests/formats/scene/gltf_samples.h"

namespace patina {
namespace {

using test::FindMap;
using test::Json;
using test::OneMaterial;
using test::SceneFolder;
using test::ValueOf;
using Values = std::vector<double>;

TEST(Gltf, ReadsSlotsFactorsAndSamplersOfTheCore) {
  Json json = OneMaterial();
  json["materials"][0] = Json::parse(R"({
    "name": "car paint", "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
    "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 0.75], "baseColorTexture": {"index": 0},
      "metallicFactor": 0, "roughnessFactor": 0.5,
      "metallicRoughnessTexture": {"index": 0, "texCoord": 1}},
    "normalTexture": {"index": 0, "scale": 2, "extensions": {"KHR_texture_transform":
      {"offset": [0.5, 0], "rotation": 1.5, "scale": [3, 4], "texCoord": 2}}},
    "occlusionTexture": {"index": 0, "strength": 0.5}})");
  json["samplers"][0] = {{"wrapS", 33071}, {"wrapT", 33071}, {"magFilter", 9728}};
  const SceneFolder folder;
  const auto scene = folder.Read(json);
  ASSERT_OK(scene);
  ASSERT_EQ(scene->materials.size(), 1u);
  const SceneMaterial& material = scene->materials[0];
  ASSERT_FALSE(material.problem) << material.problem->message;
  EXPECT_EQ(material.asset, "s_car_paint");
  EXPECT_EQ(material.look.alpha_mode, "mask");
  EXPECT_EQ(material.look.alpha_cutoff, 0.25);
  EXPECT_TRUE(material.look.double_sided);
  EXPECT_TRUE(material.clamp);
  EXPECT_EQ(ValueOf(material.look.factors, "albedo"), (Values{0.5, 1, 1}));
  EXPECT_EQ(ValueOf(material.look.factors, "opacity"), Values{0.75});
  EXPECT_EQ(ValueOf(material.look.factors, "roughness"), Values{0.5});
  EXPECT_EQ(ValueOf(material.look.parameters, "normal_scale"), Values{2});
  EXPECT_EQ(ValueOf(material.look.parameters, "occlusion_strength"), Values{0.5});
  ASSERT_NE(FindMap(material, "roughness"), nullptr);
  EXPECT_EQ(FindMap(material, "roughness")->channels, "g");
  EXPECT_EQ(FindMap(material, "albedo")->color_space, "srgb");
  EXPECT_EQ(FindMap(material, "opacity")->prune, ScenePrune::kNone);
  // A factor of 0 makes the texture pointless, and a constant of it.
  EXPECT_EQ(FindMap(material, "metalness")->prune, ScenePrune::kUnused);
  EXPECT_EQ(FindMap(material, "metalness")->stand_in, Values{0});
  ASSERT_EQ(material.look.bindings.size(), 4u);
  EXPECT_EQ(material.look.bindings[1].tex_coord, 1);
  const SceneBinding& normal = material.look.bindings[2];
  EXPECT_EQ(normal.slot, "normalTexture");
  EXPECT_EQ(normal.tex_coord, 2);
  EXPECT_EQ(normal.transform.rotation, 1.5);
  EXPECT_EQ(normal.transform.scale, (std::array<double, 2>{3, 4}));
  EXPECT_EQ(normal.wrap_s, SceneWrap::kClamp);
  // The nearest filter among them.
  EXPECT_EQ(material.warnings.size(), 4u);
}

TEST(Gltf, ReadsEveryMaterialExtension) {
  Json json = OneMaterial();
  json["materials"][0]["emissiveFactor"] = {1, 0.5, 0.25};
  json["materials"][0]["emissiveTexture"] = {{"index", 0}};
  json["materials"][0]["extensions"] = Json::parse(R"({
    "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatTexture": {"index": 0},
      "clearcoatRoughnessFactor": 0.25, "clearcoatNormalTexture": {"index": 0, "scale": 0.5}},
    "KHR_materials_sheen": {"sheenColorFactor": [1, 0, 0], "sheenColorTexture": {"index": 0},
      "sheenRoughnessFactor": 0.5, "sheenRoughnessTexture": {"index": 0}},
    "KHR_materials_anisotropy": {"anisotropyStrength": 0.5, "anisotropyRotation": 0.75,
      "anisotropyTexture": {"index": 0}},
    "KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceIor": 1.25,
      "iridescenceThicknessMaximum": 800, "iridescenceThicknessTexture": {"index": 0}},
    "KHR_materials_transmission": {"transmissionFactor": 0.5, "transmissionTexture": {"index": 0}},
    "KHR_materials_volume": {"thicknessFactor": 2, "thicknessTexture": {"index": 0},
      "attenuationDistance": 4, "attenuationColor": [0.5, 1, 1]},
    "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.5,
      "diffuseTransmissionColorTexture": {"index": 0}},
    "KHR_materials_specular": {"specularFactor": 0.5, "specularTexture": {"index": 0},
      "specularColorFactor": [2, 2, 2]},
    "KHR_materials_ior": {"ior": 1.75},
    "KHR_materials_dispersion": {"dispersion": 0.125},
    "KHR_materials_emissive_strength": {"emissiveStrength": 16}})");
  const SceneFolder folder;
  const auto scene = folder.Read(json);
  ASSERT_OK(scene);
  const SceneMaterial& material = scene->materials[0];
  ASSERT_FALSE(material.problem) << material.problem->message;
  const auto channels = [&](const char* role) {
    const SceneMap* map = FindMap(material, role);
    return map == nullptr ? std::string("none") : map->channels;
  };
  EXPECT_EQ(channels("clearcoat"), "r");
  EXPECT_EQ(channels("clearcoat_normal"), "rgb");
  EXPECT_EQ(channels("sheen_color"), "rgb");
  EXPECT_EQ(channels("sheen_roughness"), "a");
  EXPECT_EQ(channels("anisotropy_direction"), "rg");
  EXPECT_EQ(channels("anisotropy"), "b");
  EXPECT_EQ(channels("iridescence_thickness"), "g");
  EXPECT_EQ(channels("transmission"), "r");
  EXPECT_EQ(channels("thickness"), "g");
  EXPECT_EQ(channels("translucency_color"), "rgb");
  EXPECT_EQ(channels("specular"), "a");
  for (const SceneMap& map : material.maps)
    EXPECT_EQ(map.prune == ScenePrune::kNone, map.role != "opacity") << map.role;
  // The strength above 1 survives.
  EXPECT_EQ(ValueOf(material.look.factors, "emissive"), (Values{16, 8, 4}));
  EXPECT_EQ(ValueOf(material.look.factors, "thickness"), Values{2});
  EXPECT_EQ(ValueOf(material.constants, "clearcoat_roughness"), Values{0.25});
  EXPECT_EQ(ValueOf(material.constants, "iridescence"), Values{1});
  EXPECT_EQ(ValueOf(material.constants, "translucency"), Values{0.5});
  EXPECT_EQ(ValueOf(material.constants, "specular_color"), (Values{2, 2, 2}));
  EXPECT_EQ(ValueOf(material.look.parameters, "clearcoat_normal_scale"), Values{0.5});
  EXPECT_EQ(ValueOf(material.look.parameters, "anisotropy_rotation"), Values{0.75});
  EXPECT_EQ(ValueOf(material.look.parameters, "iridescence_ior"), Values{1.25});
  EXPECT_EQ(ValueOf(material.look.parameters, "iridescence_thickness_nm"), (Values{100, 800}));
  EXPECT_EQ(ValueOf(material.look.parameters, "attenuation_distance"), Values{4});
  EXPECT_EQ(ValueOf(material.look.parameters, "ior"), Values{1.75});
  EXPECT_EQ(ValueOf(material.look.parameters, "dispersion"), Values{0.125});
}

TEST(Gltf, LeavesOutWhatNothingLooksAt) {
  Json json = OneMaterial();
  json["materials"][0]["emissiveTexture"] = {{"index", 0}};  // its factor is 0 by default
  json["materials"][0]["extensions"] = Json::parse(R"({
    "KHR_materials_clearcoat": {"clearcoatTexture": {"index": 0},
      "clearcoatNormalTexture": {"index": 0}},
    "KHR_materials_anisotropy": {"anisotropyTexture": {"index": 0}}})");
  json["materials"].push_back(json["materials"][0]);
  json["materials"][1]["extensions"] = {{"KHR_materials_unlit", Json::object()}};
  json["materials"][1]["normalTexture"] = {{"index", 0}};
  const SceneFolder folder;
  const auto scene = folder.Read(json);
  ASSERT_OK(scene);
  const SceneMaterial& lit = scene->materials[0];
  for (const char* role :
       {"emissive", "clearcoat", "clearcoat_normal", "anisotropy", "anisotropy_direction"}) {
    ASSERT_NE(FindMap(lit, role), nullptr);
    EXPECT_EQ(FindMap(lit, role)->prune, ScenePrune::kUnused) << role;
    EXPECT_FALSE(FindMap(lit, role)->unused.empty()) << role;
  }
  EXPECT_EQ(FindMap(lit, "opacity")->prune, ScenePrune::kAlpha);
  EXPECT_EQ(FindMap(lit, "albedo")->prune, ScenePrune::kNone);
  const SceneMaterial& unlit = scene->materials[1];
  EXPECT_TRUE(unlit.look.unlit);
  EXPECT_EQ(FindMap(unlit, "normal")->prune, ScenePrune::kUnlit);
  EXPECT_EQ(FindMap(unlit, "albedo")->prune, ScenePrune::kNone);
  EXPECT_TRUE(unlit.constants.empty());
}

TEST(Gltf, GivesATexturelessMaterialAsConstants) {
  const SceneFolder folder;
  const auto scene =
      folder.Read(Json::parse(R"({"asset": {"version": "2.0"}, "materials": [{}]})"));
  ASSERT_OK(scene);
  const SceneMaterial& material = scene->materials[0];
  EXPECT_EQ(material.asset, "s_material0");
  EXPECT_TRUE(material.maps.empty());
  ASSERT_EQ(material.constants.size(), 3u);
  EXPECT_EQ(ValueOf(material.constants, "albedo"), (Values{1, 1, 1}));
  EXPECT_EQ(ValueOf(material.constants, "roughness"), Values{1});
}

TEST(Gltf, MakesAssetNamesLegalAndUnique) {
  Json json = Json::parse(R"({"asset": {"version": "2.0"}, "materials": [
    {"name": "a b"}, {"name": "a/b"}, {}, {"name": "..\u00e9"}, {"name": "a_b_0"}]})");
  const SceneFolder folder;
  const auto scene = folder.Read(json, "my scene.gltf");
  ASSERT_OK(scene);
  EXPECT_EQ(scene->name, "my_scene");
  std::set<std::string> names;
  for (const SceneMaterial& material : scene->materials) {
    EXPECT_TRUE(names.insert(material.asset).second) << material.asset;
    EXPECT_EQ(material.asset.find_first_of("/ "), std::string::npos);
  }
}

TEST(Gltf, ReadsImagesFromBinaryChunksDataUrisAndEncodedNames) {
  const SceneFolder folder;
  test::WriteBytes(folder.folder() / "tex tures/b.jpg", test::JpegBytes());
  Json json = OneMaterial();
  const std::string png = test::PngBytes();
  json["buffers"] = {{{"byteLength", png.size() + 4}}};
  json["bufferViews"] = {{{"buffer", 0}, {"byteOffset", 4}, {"byteLength", png.size()}}};
  json["images"] = Json::parse(R"([{"bufferView": 0, "mimeType": "image/png"},
    {"uri": "data:image/jpeg;base64,/9j/4CByZQ=="}, {"uri": "tex%20tures/b.jpg"}])");
  const auto scene = folder.ReadText(test::Glb(json, "...."), "empty.glb");
  ASSERT_OK(scene);  // the chunk is too small, which is the image's problem
  EXPECT_TRUE(scene->images[0].problem);
  const auto whole = folder.ReadText(test::Glb(json, "...." + png), "s.glb");
  ASSERT_OK(whole);
  for (const SceneImage& image : whole->images)
    ASSERT_FALSE(image.problem) << image.problem->message;
  const auto bytes = ReadSceneImage(whole->images[0]);
  ASSERT_OK(bytes);
  EXPECT_EQ(std::string(bytes->begin(), bytes->end()), png);
  EXPECT_EQ(whole->images[0].name, "s.glb/images/0.png");
  EXPECT_EQ(ReadSceneImage(whole->images[1])->size(), 7u);
  EXPECT_EQ(whole->images[2].name, "tex tures/b.jpg");
}

TEST(Gltf, FindsTexturesBesideTheSceneThatTheirFolderHasLost) {
  const SceneFolder folder;
  Json json = OneMaterial();
  json["images"][0]["uri"] = "textures/a.png";
  const auto scene = folder.Read(json);
  ASSERT_OK(scene);
  EXPECT_FALSE(scene->materials[0].problem);
  EXPECT_EQ(scene->images[0].name, "a.png");
  ASSERT_EQ(scene->materials[0].warnings.size(), 1u);
}

TEST(Gltf, RepeatsWhereTexturesDiffer) {
  const SceneFolder folder;
  Json json = OneMaterial();
  json["textures"].push_back({{"source", 0}, {"sampler", 1}});
  json["samplers"].push_back({{"wrapS", 33071}, {"wrapT", 33648}});
  json["materials"][0]["normalTexture"] = {{"index", 1}};
  const auto scene = folder.Read(json);
  ASSERT_OK(scene);
  EXPECT_FALSE(scene->materials[0].clamp);
  EXPECT_EQ(scene->materials[0].warnings.size(), 2u);  // mirrored, and mixed
}

}  // namespace
}  // namespace patina
