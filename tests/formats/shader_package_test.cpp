#include "formats/shader_package.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"
#include "formats/schema_check.h"
#include "formats/shader_constants.h"
#include "formats/shader_text.h"
#include "tests/formats/sample_brdf.h"
#include "tests/formats/sample_container.h"

namespace patina {
namespace {

using test::MessageOf;
using test::TemporaryDirectory;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

Container Publish(Result<StagingArea> staging) {
  EXPECT_TRUE(staging) << staging.error().message;
  const auto published = staging->Publish();
  EXPECT_TRUE(published);
  auto container = OpenContainer(published->directory);
  EXPECT_TRUE(container);
  return std::move(*container);
}

std::string TextOf(const ShaderPackage& package, const std::string& name) {
  for (const ShaderFile& file : package.files) {
    if (file.name == name) return std::string(file.bytes.begin(), file.bytes.end());
  }
  ADD_FAILURE() << "no " << name;
  return {};
}

TEST(ShaderPackage, ListsEveryFileAndIsOneTextInEveryLanguage) {
  const TemporaryDirectory out;
  const Container material = Publish(test::StageSample(out.path(), "wall", 1));
  const Container brdf = Publish(test::StageBrdfSample(out.path(), "chrome", 2));
  for (const Container* container : {&material, &brdf}) {
    for (const auto language :
         {ShaderLanguage::kGlsl, ShaderLanguage::kEssl, ShaderLanguage::kHlsl}) {
      const auto package = BuildShaderPackage(*container, {language, 3});
      ASSERT_OK(package);
      const auto json = nlohmann::json::parse(TextOf(*package, "bindings.json"));
      const bool hlsl = language == ShaderLanguage::kHlsl;
      EXPECT_EQ(json["shader"], container->manifest.kind + (hlsl ? ".hlsl" : ".glsl"));
      EXPECT_EQ(package->files.front().name, json["shader"]);
      EXPECT_EQ(json["textures"][0]["binding"], 3);
      EXPECT_THAT(TextOf(*package, json["shader"]),
                  AllOf(Not(HasSubstr("#include")), Not(HasSubstr(container->manifest.asset))));
      size_t listed = 2;  // the shader and bindings.json
      for (const auto& texture : json["textures"]) listed += texture.contains("file") ? 1 : 0;
      listed += json.contains("constants") ? 1 : 0;
      EXPECT_EQ(listed, package->files.size());
    }
  }
}

TEST(ShaderPackage, SharesTheTextAmongContainersOfOneStructure) {
  const TemporaryDirectory out;
  test::SampleOptions larger;
  larger.width = 128;
  const auto a = BuildShaderPackage(Publish(test::StageSample(out.path(), "a", 1)), {});
  const auto b = BuildShaderPackage(Publish(test::StageSample(out.path(), "b", 2, larger)), {});
  ASSERT_OK(a);
  ASSERT_OK(b);
  EXPECT_EQ(a->files[0].bytes, b->files[0].bytes);
  EXPECT_NE(a->files[1].bytes, b->files[1].bytes);
}

TEST(ShaderPackage, IsTheSameShaderForBlocksAndHalves) {
  const TemporaryDirectory out;
  test::BrdfSampleOptions options;
  options.textures = 2;
  const Container blocks = Publish(test::StageBrdfSample(out.path(), "blocks", 1, options));
  options.halves = true;
  const Container halves = Publish(test::StageBrdfSample(out.path(), "halves", 1, options));
  for (const auto language : {ShaderLanguage::kGlsl, ShaderLanguage::kEssl, ShaderLanguage::kHlsl}) {
    const auto a = BuildShaderPackage(blocks, {language, 0});
    const auto b = BuildShaderPackage(halves, {language, 0});
    ASSERT_OK(a);
    ASSERT_OK(b);
    EXPECT_EQ(a->files[0].bytes, b->files[0].bytes);
    const auto json = nlohmann::json::parse(TextOf(*b, "bindings.json"));
    const Status fits = CheckAgainstSchema("bindings", json);
    EXPECT_TRUE(fits) << MessageOf(fits);
    int features = 0;
    for (const auto& texture : json["textures"]) {
      if (!texture.contains("container_file")) continue;
      ++features;
      EXPECT_EQ(texture["format"], "RGBA16_FLOAT");
      EXPECT_EQ(texture["levels"], 4);
    }
    EXPECT_EQ(features, 2);
  }
  Container wrong = halves;
  wrong.manifest.features[1].format = "BC6H_UF16";
  EXPECT_THAT(MessageOf(BuildShaderPackage(wrong, {})),
              AllOf(HasSubstr("features_1.dds"), HasSubstr("RGBA16F")));
}

TEST(ShaderPackage, RefusesWhatIsMissingOrDamaged) {
  const TemporaryDirectory out;
  const Container whole = Publish(test::StageSample(out.path(), "wall", 1));
  const auto refused = [&](const Container& container) {
    return MessageOf(BuildShaderPackage(container, {}));
  };
  ASSERT_EQ(refused(whole), "");
  EXPECT_THAT(MessageOf(BuildShaderPackage(whole, {ShaderLanguage::kGlsl, 65})), HasSubstr("65"));
  EXPECT_THAT(MessageOf(BuildShaderPackage(whole, {ShaderLanguage::kGlsl, -1})), HasSubstr("-1"));

  Container wrong = whole;
  wrong.manifest.features[1].width *= 2;
  EXPECT_THAT(refused(wrong), AllOf(HasSubstr("features_1.dds"), HasSubstr("16x12")));
  wrong = whole;
  wrong.manifest.features[0].levels -= 1;
  EXPECT_THAT(refused(wrong), AllOf(HasSubstr("features_0.dds"), HasSubstr("levels")));
  wrong = whole;
  wrong.manifest.features[0].format = "BC6H_SF16";
  EXPECT_THAT(refused(wrong), HasSubstr("BC6H_SF16"));
  wrong = whole;
  wrong.manifest.network->outputs += 1;
  EXPECT_THAT(refused(wrong), AllOf(HasSubstr("decoder.weights"), HasSubstr("5 outputs")));
  wrong = whole;
  wrong.manifest.network->hidden += 1;
  EXPECT_THAT(refused(wrong), HasSubstr("decoder.weights"));
  wrong = whole;
  wrong.manifest.network->inputs += 3;
  EXPECT_THAT(refused(wrong), AllOf(HasSubstr("decoder.weights"), HasSubstr("15 inputs")));

  std::ofstream(whole.PathOf("features_2.dds"), std::ios::app) << "x";
  EXPECT_THAT(refused(whole), HasSubstr("features_2.dds"));
  std::filesystem::remove(whole.PathOf("features_2.dds"));
  EXPECT_THAT(refused(whole), HasSubstr("features_2.dds"));
}

TEST(ShaderPackage, RefusesABrdfWithoutItsTables) {
  const TemporaryDirectory out;
  test::BrdfSampleOptions options;
  options.shared_codebook = true;
  const Container whole = Publish(test::StageBrdfSample(out.path(), "chrome", 1, options));
  ASSERT_EQ(MessageOf(BuildShaderPackage(whole, {})), "");
  std::filesystem::remove(out / "shared.hpc");
  EXPECT_THAT(MessageOf(BuildShaderPackage(whole, {})), HasSubstr("shared.hpc"));
  const Container other = Publish(test::StageBrdfSample(out.path(), "gold", 2));
  std::filesystem::resize_file(other.PathOf("grid.hpx"), 100);
  EXPECT_THAT(MessageOf(BuildShaderPackage(other, {})), HasSubstr("grid.hpx"));
}

TEST(ShaderPackage, ReadsPacksInAZstdFrame) {
  const TemporaryDirectory out;
  test::BrdfSampleOptions options;
  const auto bare =
      BuildShaderPackage(Publish(test::StageBrdfSample(out.path(), "bare", 1, options)), {});
  options.zstd_level = 3;
  const auto framed =
      BuildShaderPackage(Publish(test::StageBrdfSample(out.path(), "framed", 1, options)), {});
  ASSERT_OK(bare);
  ASSERT_OK(framed);
  for (size_t i = 0; i + 1 < bare->files.size(); ++i)
    EXPECT_EQ(bare->files[i].bytes, framed->files[i].bytes);
}

// The layout that ENGINE.md describes, number by number.
TEST(ShaderConstants, PutsColumnsOfFourByFourMatricesFirst) {
  DenseLayer layer{5, 6, {}, {}};
  for (int i = 0; i < 30; ++i) layer.weight.push_back(static_cast<float>(100 + i));
  for (int o = 0; o < 6; ++o) layer.bias.push_back(static_cast<float>(200 + o));
  const int slots[] = {0, 1, 2, 4, 7};
  ShaderConstants constants;
  constants.AddLayers({&layer, 1}, slots, 2);
  const float extra[] = {1, 2, 3, 4, 5};
  EXPECT_EQ(constants.AddVectors(extra), 2);
  ASSERT_EQ(constants.matrices(), 4);
  ASSERT_EQ(constants.vectors(), 4);
  const auto bytes = constants.Bytes();
  ASSERT_EQ(bytes.size(), 4u * 64 + 4u * 16);
  const auto at = [&](int index) {
    return std::bit_cast<float>(LoadLittle32(bytes.data() + 4 * index));
  };
  int set = 0;
  for (int o = 0; o < 6; ++o) {
    for (int i = 0; i < 5; ++i) {
      const int matrix = o / 4 * 2 + slots[i] / 4;
      EXPECT_EQ(at(16 * matrix + 4 * (slots[i] % 4) + o % 4), static_cast<float>(100 + 5 * o + i));
    }
    EXPECT_EQ(at(64 + o), static_cast<float>(200 + o));
  }
  for (int i = 0; i < 64; ++i) set += at(i) != 0 ? 1 : 0;
  EXPECT_EQ(set, 30);
  EXPECT_EQ(at(64 + 8 + 4), 5.0f);
}

TEST(ShaderConstants, RefusesLayersThatDoNotFollowEachOther) {
  test::Random random(1);
  const WeightBuffer good = test::RandomLayers(random, {7, 5, 3});
  ASSERT_OK(DenseLayersOf(good, 7, 3));
  EXPECT_THAT(MessageOf(DenseLayersOf(good, 6, 3)), HasSubstr("6 inputs"));
  EXPECT_THAT(MessageOf(DenseLayersOf(good, 7, 4)), HasSubstr("3 outputs"));
  WeightBuffer odd = good;
  odd.tensors.pop_back();
  EXPECT_THAT(MessageOf(DenseLayersOf(odd, 7, 3)), HasSubstr("layer1"));
  odd = good;
  std::swap(odd.tensors[0].name, odd.tensors[2].name);
  EXPECT_THAT(MessageOf(DenseLayersOf(odd, 7, 3)), HasSubstr("layer0"));
}

TEST(ShaderText, NumbersReadBackAndAreFloats) {
  for (const float value : {0.0f, 1.0f, -2.5f, 0.1f, 1e-30f, 3.4e38f, 16777216.0f}) {
    const std::string text = ShaderNumber(value);
    EXPECT_EQ(std::stof(text), value) << text;
    EXPECT_NE(text.find_first_of(".e"), std::string::npos) << text;
  }
}

// Roles come from files that anybody may have written.
TEST(ShaderText, MakesIdentifiersOfAnyRole) {
  const auto channel = [](const char* map) {
    ManifestChannel result;
    result.map = map;
    return result;
  };
  const std::string text = MapAccessors({channel("Clear-Coat"), channel("a__b"), channel("a b"),
                                         channel("; evil(){"), channel("\xC3\xA4"), channel("f"),
                                         channel("f"), channel("f"), channel("f"), channel("f")});
  EXPECT_THAT(text, AllOf(HasSubstr("float patina_map_clear_coat(PatinaMaterial m)"),
                          HasSubstr(" patina_map_a_b("), HasSubstr(" patina_map_a_b_2("),
                          HasSubstr(" patina_map_evil("), HasSubstr(" patina_map_unnamed("),
                          Not(HasSubstr("patina_map_f(")), Not(HasSubstr("__"))));
}

}  // namespace
}  // namespace patina
