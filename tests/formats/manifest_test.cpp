#include "formats/manifest.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/schema_check.h"
#include "tests/formats/sample_brdf.h"
#include "tests/formats/sample_container.h"

namespace patina {
namespace {

using nlohmann::json;
using test::FullBrdfManifest;
using test::FullManifest;

std::string ExamplePath(const std::string& name) {
  return std::string(PATINA_SOURCE_DIR) + "/schemas/examples/" + name;
}

json FullDocument() { return json::parse(*ToJson(FullManifest())); }

TEST(Manifest, WritesTheCanonicalTextOfTheExample) {
  const auto text = ToJson(FullManifest());
  ASSERT_OK(text);
  const auto golden = ReadTextFile(ExamplePath("manifest_full.json"), kMaxManifestBytes);
  ASSERT_OK(golden);
  EXPECT_EQ(*text, *golden);
}

TEST(Manifest, ReadingAndWritingAgainGivesTheSameBytes) {
  const auto text = ToJson(FullManifest());
  ASSERT_OK(text);
  const auto manifest = ParseManifest(*text);
  ASSERT_OK(manifest);
  EXPECT_EQ(ToJson(*manifest).value(), *text);
  EXPECT_EQ(manifest->seed, 9223372036854775807ull);
  EXPECT_EQ(manifest->channels[5].range_min, 0.3f);
  EXPECT_EQ(manifest->channels[2].output, -1);
  EXPECT_EQ(manifest->channels[2].constant, 0.25f);
  EXPECT_EQ(manifest->channels[4].scale, 1.0f);
  EXPECT_EQ(manifest->channels[5].scale, 4.0f);
  EXPECT_TRUE(std::isinf(manifest->quality.psnr_mean_mips_db));
  EXPECT_TRUE(std::isinf(*manifest->quality.maps[0].mips[1].psnr_db));
  EXPECT_FALSE(manifest->quality.maps[0].overall.normal_deg.has_value());
  EXPECT_EQ(manifest->network->outputs, 5);
}

TEST(Manifest, ReadsWhatOlderOnesLeftOutAsEffects) {
  const auto text = ReadTextFile(ExamplePath("manifest_left_out.json"), kMaxManifestBytes);
  ASSERT_OK(text);
  const auto manifest = ParseManifest(*text);
  ASSERT_OK(manifest);
  ASSERT_EQ(manifest->effects.size(), 1u);
  EXPECT_EQ(manifest->effects[0].what, "albedo.b");
  EXPECT_EQ(manifest->effects[0].state, "constant");
  EXPECT_EQ(manifest->effects[0].reason, "constant 0.25");
  EXPECT_FALSE(manifest->effects[0].saved.has_value());
}

TEST(Manifest, CountsItsVersionUpOnlyForWhatOlderReadersWouldDecodeWrongly) {
  Manifest manifest = FullManifest();
  manifest.scene.emplace().file = "a.glb";
  EXPECT_EQ(json::parse(*ToJson(manifest))["format_version"], 1);
  Manifest shared = manifest;
  shared.channels.push_back(shared.channels[5]);
  shared.channels.back().map = "specular";
  const auto two_of_one = ToJson(shared);
  ASSERT_OK(two_of_one);
  EXPECT_EQ(json::parse(*two_of_one)["format_version"], 2);
  Manifest part = manifest;
  part.lod_range = {1, 4};
  part.features[3].levels = 2;
  const auto text = ToJson(part);
  ASSERT_OK(text);
  EXPECT_EQ(json::parse(*text)["format_version"], 2);
  EXPECT_EQ(ParseManifest(*text)->lod_range, part.lod_range);
}

TEST(Manifest, KeepsWhatASceneSays) {
  const auto text = ReadTextFile(ExamplePath("manifest_scene.json"), kMaxManifestBytes);
  ASSERT_OK(text);
  const auto manifest = ParseManifest(*text);
  ASSERT_OK(manifest);
  EXPECT_EQ(*ToJson(*manifest), *text);
  ASSERT_TRUE(manifest->scene.has_value());
  EXPECT_EQ(manifest->scene->factors[0].value, (std::vector<double>{4, 4, 2.5}));
  EXPECT_EQ(manifest->scene->bindings[0].transform.rotation, 0.25);
  EXPECT_EQ(manifest->scene->bindings[0].wrap_t, SceneWrap::kClamp);
}

TEST(Manifest, WritesFloatsWithTheirOwnDigits) {
  Manifest manifest = FullManifest();
  manifest.channels[0].range_min = 0.1f;
  manifest.channels[0].range_max = std::nextafter(0.1f, 1.0f);
  manifest.channels[2].constant = 1.0f / 3.0f;
  const auto text = ToJson(manifest);
  ASSERT_OK(text);
  EXPECT_NE(text->find("        0.1,\n        0.10000001\n"), std::string::npos);
  EXPECT_NE(text->find("\"constant\": 0.33333334"), std::string::npos);
  const auto read = ParseManifest(*text);
  ASSERT_OK(read);
  EXPECT_EQ(read->channels[0].range_max, manifest.channels[0].range_max);
  EXPECT_EQ(read->channels[2].constant, manifest.channels[2].constant);
}

TEST(Manifest, ReplacesBytesThatAreNotUtf8InFreeText) {
  Manifest manifest = FullManifest();
  manifest.warnings = {"bad \xFF byte"};
  const auto text = ToJson(manifest);
  ASSERT_OK(text);
  EXPECT_EQ(ParseManifest(*text)->warnings[0], "bad \xEF\xBF\xBD byte");
}

TEST(Manifest, IgnoresFieldsOfNewerWriters) {
  json document = FullDocument();
  document["new_field"] = {{"a", 1}};
  document["source"]["new_field"] = 2;
  document["channels"][0]["new_field"] = nullptr;
  const auto manifest = ParseManifest(document.dump());
  ASSERT_OK(manifest);
  EXPECT_EQ(ToJson(*manifest).value(), ToJson(FullManifest()).value());
}

TEST(Manifest, RefusesANewerFormatVersion) {
  json document = FullDocument();
  document["format_version"] = kManifestVersion + 1;
  const auto manifest = ParseManifest(document.dump());
  ASSERT_FALSE(manifest);
  EXPECT_EQ(manifest.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(manifest.error().message.find("newer"), std::string::npos);
}

TEST(Manifest, NoticesEveryTruncation) {
  const std::string text = *ToJson(FullManifest());
  // The last byte is the final newline, without which the document is whole.
  for (size_t size = 0; size + 1 < text.size(); ++size) {
    const std::string prefix(text.data(), size);
    const auto manifest = ParseManifest(prefix);
    ASSERT_FALSE(manifest) << size;
    ASSERT_EQ(manifest.error().code, ErrorCode::kCorruptData);
  }
}

TEST(Manifest, NoticesTrailingBytes) {
  EXPECT_EQ(ParseManifest(*ToJson(FullManifest()) + "x").error().code, ErrorCode::kCorruptData);
}

TEST(Manifest, SurvivesHostileDocuments) {
  for (const std::string& text :
       {std::string(), std::string("null"), std::string("[]"), std::string("1e999"),
        std::string("{\"format\":7}"), std::string(3000000, '['),
        std::string(kMaxManifestBytes + 1, ' '), std::string("\xFF\xFE{}"),
        std::string("{\"format\":\"patina-container\",\"format_version\":-1}"),
        std::string("{\"format\":\"patina-container\",\"format_version\":99999999999999999999}")}) {
    const auto manifest = ParseManifest(text);
    ASSERT_FALSE(manifest);
    EXPECT_EQ(manifest.error().code, ErrorCode::kCorruptData) << manifest.error().message;
  }
}

// Every member of the document, one after another, removed and replaced by values of other types.
void ReportsEveryMistypedFieldOrAcceptsIt(const json& good, size_t least_fields) {
  std::vector<json::json_pointer> pointers;
  const std::function<void(const json&, const json::json_pointer&)> collect =
      [&](const json& value, const json::json_pointer& at) {
        if (value.is_object()) {
          for (const auto& [key, child] : value.items()) {
            pointers.push_back(at / key);
            collect(child, at / key);
          }
        } else if (value.is_array()) {
          for (size_t i = 0; i < value.size(); ++i) {
            pointers.push_back(at / i);
            collect(value[i], at / i);
          }
        }
      };
  collect(good, json::json_pointer());
  ASSERT_GT(pointers.size(), least_fields);
  int refused = 0;
  for (const auto& pointer : pointers) {
    for (const json& value :
         {json(nullptr), json(true), json(-7), json(1e300), json(18446744073709551615ull),
          json("text"), json(std::string(5000, 'x')), json::array(), json::object()}) {
      json document = good;
      document[pointer] = value;
      const auto manifest = ParseManifest(document.dump());
      if (!manifest) {
        ++refused;
        EXPECT_TRUE(manifest.error().code == ErrorCode::kCorruptData ||
                    manifest.error().code == ErrorCode::kUnsupported);
        EXPECT_EQ(manifest.error().message[0], '/') << manifest.error().message;
      } else {
        // What is accepted can be written again.
        EXPECT_TRUE(ToJson(*manifest).has_value()) << pointer.to_string();
      }
    }
  }
  EXPECT_GT(refused, static_cast<int>(pointers.size()) * 6);
}

TEST(Manifest, ReportsEveryMissingOrMistypedFieldOrAcceptsIt) {
  ReportsEveryMistypedFieldOrAcceptsIt(FullDocument(), 200);
}

TEST(Manifest, ReportsEveryMissingOrMistypedFieldOfABrdfOrAcceptsIt) {
  ReportsEveryMistypedFieldOrAcceptsIt(json::parse(*ToJson(FullBrdfManifest())), 80);
}

struct BrokenRule {
  const char* pointer;  // that the message must begin with
  std::function<void(Manifest*)> break_it;
};

TEST(Manifest, WriterAndReaderRefuseBrokenRules) {
  const BrokenRule rules[] = {
      {"/asset", [](Manifest* m) { m->asset = "../up"; }},
      {"/kind", [](Manifest* m) { m->kind = "cloth"; }},
      {"/fingerprint", [](Manifest* m) { m->fingerprint = std::string(64, 'A'); }},
      {"/seed", [](Manifest* m) { m->seed = 9223372036854775808ull; }},
      {"/source/levels", [](Manifest* m) { m->source.levels = 6; }},
      {"/source/address", [](Manifest* m) { m->source.address = "mirror"; }},
      {"/source/files/1/path", [](Manifest* m) { m->source.files[1].path = "/etc/passwd"; }},
      {"/source/files/0/type", [](Manifest* m) { m->source.files[0].type = "int8"; }},
      {"/payloads/1/name", [](Manifest* m) { m->payloads[1].name = m->payloads[0].name; }},
      {"/payloads/0/name", [](Manifest* m) { m->payloads[0].name = "../features_0.dds"; }},
      {"/payloads/0/name", [](Manifest* m) { m->payloads[0].name = "manifest.json"; }},
      {"/features/2/payload", [](Manifest* m) { m->features[2].payload = "preview.png"; }},
      {"/features/3/levels", [](Manifest* m) { m->features[3].levels = 2; }},
      {"/features/0/lod_bias", [](Manifest* m) { m->features[0].lod_bias = 1; }},
      {"/features/0/format", [](Manifest* m) { m->features[0].format = "BC7"; }},
      {"/features/0/format", [](Manifest* m) { m->features[0].format = "RGBA16F"; }},
      {"/features", [](Manifest* m) { m->network.reset(); }},
      {"/network/inputs", [](Manifest* m) { m->features.pop_back(); }},
      {"/network/payload", [](Manifest* m) { m->network->payload = "other"; }},
      {"/network/activation", [](Manifest* m) { m->network->activation = "gelu"; }},
      {"/network/outputs", [](Manifest* m) { m->network->outputs = 6; }},
      {"/channels", [](Manifest* m) { m->channels.clear(); }},
      // Shared outputs leave another one without a channel here, and need equal ranges.
      {"/network/outputs",
       [](Manifest* m) { m->channels[1] = m->channels[0], m->channels[1].component = "g"; }},
      {"/channels/1/range",
       [](Manifest* m) {
         m->channels[1].output = 1;
         m->channels[1].range_max = 0.75f;
       }},
      {"/lod_range",
       [](Manifest* m) {
         m->lod_range = {2, 1};
       }},
      {"/lod_range",
       [](Manifest* m) {
         m->lod_range = {0, 17};
       }},
      {"/effects/0/state", [](Manifest* m) { m->effects[0].state = "forgotten"; }},
      {"/scene/alpha_mode", [](Manifest* m) { m->scene.emplace().alpha_mode = "x"; }},
      {"/scene/factors/0",
       [](Manifest* m) {
         m->scene.emplace().factors = {{"albedo", {NAN}}};
       }},
      {"/channels/1/output", [](Manifest* m) { m->channels[1].output = 5; }},
      {"/channels/0/range", [](Manifest* m) { m->channels[0].range_min = 2; }},
      {"/channels/0/range", [](Manifest* m) { m->channels[0].range_min = NAN; }},
      {"/channels/5/scale", [](Manifest* m) { m->channels[5].scale = 0; }},
      {"/channels/5/scale", [](Manifest* m) { m->channels[5].scale = INFINITY; }},
      {"/channels/0/scale", [](Manifest* m) { m->channels[0].scale = 2; }},
      {"/channels/2/constant", [](Manifest* m) { m->channels[2].constant = INFINITY; }},
      {"/channels/3/component", [](Manifest* m) { m->channels[3].component = "z"; }},
      {"/channels/1", [](Manifest* m) { m->channels[1].component = "r"; }},
      {"/channels/2/map", [](Manifest* m) { std::swap(m->channels[1], m->channels[5]); }},
      {"/maps/1/role", [](Manifest* m) { m->maps[1].role = "albedo"; }},
      {"/maps/0/file", [](Manifest* m) { m->maps[0].file = 3; }},
      {"/maps/0/file_channels/1", [](Manifest* m) { m->maps[0].file_channels[1] = 3; }},
      {"/quality/psnr_db/overall", [](Manifest* m) { m->quality.psnr_overall_db = NAN; }},
      {"/quality/ssim", [](Manifest* m) { m->quality.ssim = NAN; }},
      {"/quality/maps/0/mips/1/flip", [](Manifest* m) { m->quality.maps[0].mips[1].flip = 1.5; }},
      {"/quality/gate/min_psnr_db", [](Manifest* m) { m->quality.gate_min_psnr_db = INFINITY; }},
      {"/training/curve/0/psnr_mip0_db",
       [](Manifest* m) { m->training.curve[0].psnr_mip0_db = NAN; }},
      {"/training/curve/1/psnr_maps_db/albedo",
       [](Manifest* m) { m->training.curve[1].maps_db["albedo"] = NAN; }},
      {"/training/choice/chosen", [](Manifest* m) { m->training.choice->chosen = "bcf-2k"; }},
      {"/training/choice/reason", [](Manifest* m) { m->training.choice->reason = ""; }},
      {"/training/choice/target_psnr_db",
       [](Manifest* m) { m->training.choice->target_psnr_db = NAN; }},
      {"/training/choice/candidates/0/reached_psnr_db",
       [](Manifest* m) { m->training.choice->candidates[0].reached_db = INFINITY; }},
      {"/training/stopped_by", [](Manifest* m) { m->training.stopped_by = ""; }},
      {"/warnings/0", [](Manifest* m) { m->warnings[0] = std::string(5000, 'w'); }},
  };
  for (const BrokenRule& rule : rules) {
    Manifest manifest = FullManifest();
    rule.break_it(&manifest);
    const auto text = ToJson(manifest);
    ASSERT_FALSE(text) << rule.pointer;
    EXPECT_EQ(text.error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(text.error().message.rfind(rule.pointer, 0), 0u)
        << rule.pointer << " / " << text.error().message;
  }
}

TEST(Manifest, ReaderSaysUnsupportedForWhatItCannotDecode) {
  for (const auto& [pointer, value] : std::initializer_list<std::pair<const char*, const char*>>{
           {"/kind", "cloth"},
           {"/format", "other"},
           {"/channels/0/encoding", "pq"},
           {"/network/activation", "gelu"},
           {"/source/address", "mirror"},
           {"/features/0/format", "BC7"},
           {"/color/working_space", "rec2020"}}) {
    json document = FullDocument();
    document[json::json_pointer(pointer)] = value;
    const auto manifest = ParseManifest(document.dump());
    ASSERT_FALSE(manifest) << pointer;
    EXPECT_EQ(manifest.error().code, ErrorCode::kUnsupported) << manifest.error().message;
    EXPECT_EQ(manifest.error().message.rfind(pointer, 0), 0u) << manifest.error().message;
  }
}

TEST(Manifest, BrdfsReadAndWriteTheSameBytes) {
  const auto text = ToJson(FullBrdfManifest());
  ASSERT_OK(text);
  const auto golden = ReadTextFile(ExamplePath("manifest_brdf.json"), kMaxManifestBytes);
  ASSERT_OK(golden);
  EXPECT_EQ(*text, *golden);
  const auto manifest = ParseManifest(*text);
  ASSERT_OK(manifest);
  EXPECT_EQ(ToJson(*manifest).value(), *text);
  EXPECT_EQ(manifest->brdf->layers, (std::vector<int>{35, 32, 32, 3}));
  EXPECT_EQ(manifest->brdf->shared_codebook_file, "metals.hpc");
  EXPECT_EQ(manifest->brdf->quality.albedo[4].theta_deg, 89);
  EXPECT_EQ(*manifest->brdf->quality.image_ssim, 0.9990234375);
  for (const char* absent : {"profile", "features", "network", "channels", "maps", "training"})
    EXPECT_FALSE(json::parse(*text).contains(absent)) << absent;

  Manifest small = FullBrdfManifest();
  small.brdf->shared_codebook_file.clear();
  small.brdf->shared_codebook_sha256.clear();
  small.brdf->sampler.clear();
  small.brdf->files.clear();
  small.brdf->quality = {};
  const auto small_text = ToJson(small);
  ASSERT_OK(small_text);
  EXPECT_FALSE(json::parse(*small_text)["brdf"].contains("codebook"));
  EXPECT_FALSE(json::parse(*small_text)["brdf"].contains("sampler"));
  EXPECT_FALSE(json::parse(*small_text)["brdf"].contains("rollbacks"));
  EXPECT_EQ(ToJson(*ParseManifest(*small_text)).value(), *small_text);
  ASSERT_OK(CheckAgainstSchema("manifest", json::parse(*small_text)));

  small.brdf->rollbacks = 2;
  const auto rolled_back = ToJson(small);
  ASSERT_OK(rolled_back);
  EXPECT_EQ(json::parse(*rolled_back)["brdf"]["rollbacks"], 2);
  EXPECT_EQ(ParseManifest(*rolled_back)->brdf->rollbacks, 2);
  ASSERT_OK(CheckAgainstSchema("manifest", json::parse(*rolled_back)));
  small.brdf->rollbacks = -1;
  EXPECT_FALSE(ToJson(small));
}

TEST(Manifest, WriterAndReaderRefuseBrokenRulesOfBrdfs) {
  const BrokenRule rules[] = {
      {"/kind", [](Manifest* m) { m->kind = "cloth"; }},
      {"/brdf", [](Manifest* m) { m->brdf.reset(); }},
      {"/brdf", [](Manifest* m) { m->kind = "material"; }},
      {"/kind", [](Manifest* m) { m->maps.resize(1); }},
      {"/source/format", [](Manifest* m) { m->brdf->source_format = ""; }},
      {"/source/simulation/standard_error",
       [](Manifest* m) { m->brdf->simulation.emplace().standard_error = -1; }},
      {"/source/invalid_cells", [](Manifest* m) { m->brdf->invalid_cells = 1458001; }},
      {"/source/files/0/path", [](Manifest* m) { m->brdf->files[0].path = "../x"; }},
      {"/source/files/0/sha256", [](Manifest* m) { m->brdf->files[0].sha256 = "5"; }},
      {"/brdf/grid", [](Manifest* m) { m->brdf->grid = "decoder.weights"; }},
      {"/brdf/codebook/payload",
       [](Manifest* m) {
         m->brdf->codebook = "grid.hpx";
         m->brdf->shared_codebook_file = m->brdf->shared_codebook_sha256 = "";
       }},
      {"/brdf/codebook", [](Manifest* m) { m->brdf->codebook = "grid.hpx"; }},
      {"/brdf/codebook/file", [](Manifest* m) { m->brdf->shared_codebook_file = "../m.hpc"; }},
      {"/brdf/codebook/sha256", [](Manifest* m) { m->brdf->shared_codebook_sha256 = "x"; }},
      {"/brdf/nside", [](Manifest* m) { m->brdf->nside = 1025; }},
      {"/brdf/primitive_size", [](Manifest* m) { m->brdf->primitive_size = 0; }},
      {"/brdf/index_bits", [](Manifest* m) { m->brdf->index_bits = 17; }},
      {"/brdf/interpolation", [](Manifest* m) { m->brdf->interpolation = "cubic"; }},
      {"/brdf/network/payload", [](Manifest* m) { m->brdf->network = "grid.hpx"; }},
      {"/brdf/network/layers", [](Manifest* m) { m->brdf->layers = {35}; }},
      {"/brdf/network/layers", [](Manifest* m) { m->brdf->layers.assign(18, 3); }},
      {"/brdf/network/layers", [](Manifest* m) { m->brdf->angle_inputs = false; }},
      {"/brdf/network/layers", [](Manifest* m) { m->brdf->half_vector_inputs = true; }},
      {"/brdf/half_vector_inputs",
       [](Manifest* m) {
         m->brdf->angle_inputs = false;
         m->brdf->half_vector_inputs = true;
       }},
      {"/brdf/network/layers", [](Manifest* m) { m->brdf->layers.back() = 4; }},
      {"/brdf/network/layers/1", [](Manifest* m) { m->brdf->layers[1] = 513; }},
      {"/brdf/network/activation", [](Manifest* m) { m->brdf->activation = "gelu"; }},
      {"/brdf/output_transform", [](Manifest* m) { m->brdf->output_transform = "exp"; }},
      {"/brdf/sampler", [](Manifest* m) { m->brdf->sampler = "preview.png"; }},
      {"/quality/image_mae", [](Manifest* m) { m->brdf->quality.image_mae = NAN; }},
      {"/quality/image_rmse", [](Manifest* m) { m->brdf->quality.image_rmse = -1; }},
      {"/quality/image_ssim", [](Manifest* m) { m->brdf->quality.image_ssim = 1.5; }},
      {"/quality/log1p_mse", [](Manifest* m) { m->brdf->quality.log1p_mse = INFINITY; }},
      {"/quality/reciprocity_error",
       [](Manifest* m) { m->brdf->quality.reciprocity_error = -0.5; }},
      {"/quality/albedo/1/theta_deg",
       [](Manifest* m) { m->brdf->quality.albedo[1].theta_deg = 91; }},
      {"/quality/albedo/2/rgb/1", [](Manifest* m) { m->brdf->quality.albedo[2].rgb[1] = NAN; }},
  };
  for (const BrokenRule& rule : rules) {
    Manifest manifest = FullBrdfManifest();
    rule.break_it(&manifest);
    const auto text = ToJson(manifest);
    ASSERT_FALSE(text) << rule.pointer;
    EXPECT_EQ(text.error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(text.error().message.rfind(rule.pointer, 0), 0u)
        << rule.pointer << " / " << text.error().message;
  }
  json document = json::parse(*ToJson(FullBrdfManifest()));
  document["brdf"]["interpolation"] = "cubic";
  EXPECT_EQ(ParseManifest(document.dump()).error().code, ErrorCode::kUnsupported);
}

TEST(ManifestBrdf, KeepsHowItsSourceWasSimulated) {
  const auto text = ReadTextFile(ExamplePath("manifest_brdf_layered.json"), kMaxManifestBytes);
  ASSERT_OK(text);
  const auto manifest = ParseManifest(*text);
  ASSERT_OK(manifest);
  ASSERT_TRUE(manifest->brdf->simulation.has_value());
  EXPECT_EQ(manifest->brdf->simulation->paths, 9437184u);
  EXPECT_EQ(json::parse(*ToJson(*manifest))["source"], json::parse(*text)["source"]);
}

// schemas/examples/manifest_invalid_*.json break the schema; the other manifest_*.json satisfy
// schema and reader.
TEST(ManifestSchema, AgreesWithItsExamples) {
  int valid = 0;
  int invalid = 0;
  for (const auto& entry : std::filesystem::directory_iterator(ExamplePath(""))) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("manifest_", 0) != 0) continue;
    const auto text = ReadTextFile(entry.path().string(), kMaxManifestBytes);
    ASSERT_OK(text);
    const auto status = CheckAgainstSchema("manifest", json::parse(*text));
    if (name.rfind("manifest_invalid_", 0) != 0) {
      ++valid;
      EXPECT_TRUE(status.has_value()) << name << ": " << status.error().message;
      EXPECT_TRUE(ParseManifest(*text).has_value())
          << name << ": " << test::MessageOf(ParseManifest(*text));
    } else {
      ++invalid;
      ASSERT_FALSE(status.has_value()) << name;
      // The example says itself where it is wrong.
      const std::string pointer = json::parse(*text)["expected_pointer"];
      EXPECT_NE(status.error().message.find(pointer + ":"), std::string::npos)
          << name << ": " << status.error().message;
    }
  }
  EXPECT_GE(valid, 2);
  EXPECT_GE(invalid, 5);
}

TEST(SchemaCheck, NamesThePlaceOfEveryFinding) {
  json document = FullDocument();
  document["source"]["files"][1]["width"] = "wide";
  document["payloads"][0].erase("sha256");
  const auto findings = FindSchemaProblems("manifest", document);
  ASSERT_OK(findings);
  std::vector<std::string> pointers;
  for (const auto& finding : *findings) pointers.push_back(finding.pointer);
  EXPECT_NE(std::find(pointers.begin(), pointers.end(), "/source/files/1/width"), pointers.end());
  EXPECT_NE(std::find(pointers.begin(), pointers.end(), "/payloads/0"), pointers.end());
  EXPECT_LE(pointers.size(), 4u);
}

TEST(SchemaCheck, KnowsAllSchemasAndRefusesUnknownOnes) {
  const auto names = SchemaNames();
  EXPECT_NE(std::find(names.begin(), names.end(), "manifest"), names.end());
  for (const std::string& name : names) {
    // Each must be a schema that the validator understands.
    EXPECT_TRUE(FindSchemaProblems(name, json::object()).has_value()) << name;
  }
  EXPECT_EQ(CheckAgainstSchema("nothing", json::object()).error().code, ErrorCode::kNotFound);
}

TEST(SchemaCheck, DoesNotLookAtDocumentsThatCouldExhaustTheStack) {
  json deep = json::array();
  for (int i = 0; i < 1000; ++i) {
    json outer = json::array();
    outer.push_back(std::move(deep));
    deep = std::move(outer);
  }
  EXPECT_EQ(CheckAgainstSchema("manifest", deep).error().code, ErrorCode::kOutOfRange);
  json document = FullDocument();
  document["fingerprint"] = std::string(100000, 'a');
  EXPECT_EQ(CheckAgainstSchema("manifest", document).error().code, ErrorCode::kOutOfRange);
}

}  // namespace
}  // namespace patina
