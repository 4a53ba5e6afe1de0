#include "pipeline/jobs/job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/schema_check.h"
#include "pipeline/jobs/as_reflectance.h"
#include "pipeline/jobs/brdf_job.h"
#include "pipeline/jobs/svbrdf_job.h"

namespace patina {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

std::string Example(const std::string& name) {
  return std::string(PATINA_SOURCE_DIR) + "/schemas/examples/" + name;
}

Json Minimal() {
  return {{"version", 1}, {"kind", "material"}, {"asset", "a"}, {"folder", "f"}, {"out", "o"}};
}

Json MinimalBrdf() {
  return {{"version", 1}, {"kind", "brdf"}, {"asset", "a"}, {"file", "f.binary"}, {"out", "o"}};
}

// What the parser says to the minimal job with one field changed; "" if it accepts it.
std::string Complaint(const std::string& key, const Json& value) {
  Json json = Minimal();
  json[key] = value;
  auto job = ParseJob(json.dump(), "", "job.json");
  return job ? "" : job.error().message;
}

TEST(ParseJob, ReadsTheMinimalExampleWithDefaults) {
  auto job = ReadJobFile(Example("job_minimal.json"));
  ASSERT_TRUE(job) << job.error().message;
  EXPECT_EQ(job->asset, "cobblestone_floor");
  EXPECT_EQ(job->folder, Example("cobblestone_floor"));
  EXPECT_EQ(job->out, Example("baked"));
  EXPECT_TRUE(job->maps.empty());
  EXPECT_EQ(job->profile, Profile::kBcf1k);
  EXPECT_EQ(job->quality, Quality::kStandard);
  EXPECT_EQ(job->recipe, Recipe::kPatina);
  EXPECT_EQ(job->seed, 1u);
  EXPECT_EQ(job->threads, 0);
  EXPECT_EQ(job->address, AddressMode::kWrap);
  EXPECT_FALSE(job->repair_nonfinite);
  EXPECT_TRUE(job->toksvig);
}

TEST(ParseJob, ReadsEveryFieldOfTheFullExample) {
  auto job = ReadJobFile(Example("job_full.json"));
  ASSERT_TRUE(job) << job.error().message;
  EXPECT_EQ(job->profile, Profile::kBcf2k);
  EXPECT_EQ(job->quality, Quality::kReference);
  EXPECT_EQ(job->seed, 7u);
  EXPECT_EQ(job->threads, 2);
  EXPECT_DOUBLE_EQ(job->target_psnr_db, 36.5);
  EXPECT_DOUBLE_EQ(job->time_budget_s, 120);
  EXPECT_DOUBLE_EQ(job->min_psnr_db, 28);
  EXPECT_EQ(job->address, AddressMode::kClamp);
  EXPECT_EQ(job->normal_convention, "opengl");
  EXPECT_TRUE(job->repair_nonfinite);
  EXPECT_FALSE(job->toksvig);
  EXPECT_FALSE(job->report);
  ASSERT_EQ(job->maps.size(), 7u);
  EXPECT_EQ(job->maps[5].color_space, "Utility - Linear - P3-D65");
  EXPECT_EQ(job->working_space, WorkingSpace::kAcesCg);
  EXPECT_EQ(job->color_space, "auto");
  EXPECT_EQ(job->ocio, Example("studio/config.ocio"));
  EXPECT_EQ(job->maps[0].color_space, "srgb");
  EXPECT_EQ(job->maps[1].convention, "directx");
  EXPECT_EQ(job->maps[3].role, "roughness");
  EXPECT_EQ(job->maps[3].channels, "g");
  EXPECT_TRUE(job->maps[3].invert);
  EXPECT_EQ(job->maps[3].file, "cobble_packed.png");
  EXPECT_EQ(job->maps_folder, Example("textures"));
}

TEST(ParseJob, ReadsTheMinimalBrdfWithTheRecipesModel) {
  auto job = ReadJobFile(Example("job_brdf_minimal.json"));
  ASSERT_TRUE(job) << job.error().message;
  EXPECT_EQ(job->kind, JobKind::kBrdf);
  EXPECT_EQ(job->file, Example("chrome.binary"));
  EXPECT_EQ(job->out, Example("baked"));
  const brdf::ModelShape defaults;
  const brdf::ModelShape shape = ModelOfJob(*job, {});
  EXPECT_EQ(shape.grid.nside, defaults.grid.nside);
  EXPECT_EQ(shape.hidden, defaults.hidden);
  EXPECT_TRUE(shape.grid.angle_inputs);
  EXPECT_TRUE(shape.grid.canonical_order);
  job->recipe = Recipe::kPaper;
  const brdf::ModelShape plain = ModelOfJob(*job, {});
  EXPECT_EQ(plain.grid.nside, 64);
  EXPECT_EQ(plain.hidden, 64);
  EXPECT_FALSE(plain.grid.angle_inputs);
  EXPECT_FALSE(plain.grid.canonical_order);
}

TEST(ModelOfJob, ThePapersIsTheSameForEverySource) {
  Job job;
  job.kind = JobKind::kBrdf;
  job.recipe = Recipe::kPaper;
  for (const brdf::SourceKind kind : {brdf::SourceKind{true, false}, brdf::SourceKind{false, false},
                                      brdf::SourceKind{false, true}}) {
    const brdf::ModelShape shape = ModelOfJob(job, kind);
    EXPECT_EQ(shape.grid.isotropic, kind.isotropic);
    EXPECT_FALSE(shape.grid.half_vector_inputs);
    EXPECT_EQ(shape.grid.nside, 64);
    EXPECT_EQ(shape.index_bits, 9);
    EXPECT_EQ(shape.hidden, 64);
    EXPECT_EQ(shape.hidden_layers, 2);
    EXPECT_EQ(TrainingOfJob(job, kind).decay, 0.0f);
  }
}

TEST(ParseJob, ReadsEveryFieldOfTheFullBrdf) {
  auto job = ReadJobFile(Example("job_brdf_full.json"));
  ASSERT_TRUE(job) << job.error().message;
  const brdf::ModelShape shape = ModelOfJob(*job, {});
  EXPECT_EQ(shape.grid.nside, 48);
  EXPECT_EQ(shape.primitive_size, 24);
  EXPECT_EQ(shape.index_bits, 10);
  EXPECT_EQ(shape.hidden, 64);
  EXPECT_EQ(shape.hidden_layers, 3);
  EXPECT_EQ(shape.grid.interpolation, Interpolation::kInverseDistance);
  EXPECT_FALSE(shape.grid.angle_inputs);
  EXPECT_FALSE(shape.grid.canonical_order);
  EXPECT_EQ(TrainingOfJob(*job, {}).index_training, brdf::IndexTraining::kClustersThenSoftmax);
  EXPECT_EQ(job->quality, Quality::kReference);
  EXPECT_EQ(job->seed, 7u);
  EXPECT_EQ(job->threads, 2);
}

TEST(ParseJob, RefusesFieldsOfAnotherKind) {
  auto brdf = ReadJobFile(Example("job_brdf_invalid_many_problems.json"));
  ASSERT_FALSE(brdf);
  for (const char* pointer :
       {"/file: is missing", "/folder: is a field of jobs of kind \"material\"", "/profile: is a",
        "/min_psnr_db: is a", "/model/nside: ", "/model/index_bits: ", "/model/interpolation: ",
        "/model/angle_inputs: ", "/model/depth: is not a field"}) {
    EXPECT_THAT(brdf.error().message, HasSubstr(pointer));
  }
  EXPECT_THAT(brdf.error().message, HasSubstr("9 problems"));
  auto material = ReadJobFile(Example("job_invalid_field_of_another_kind.json"));
  ASSERT_FALSE(material);
  EXPECT_THAT(material.error().message, HasSubstr("/file: is a field of jobs of kind \"brdf\""));
}

TEST(ParseJob, SurvivesItsOwnWriting) {
  for (const char* example : {"job_full.json", "job_brdf_full.json", "job_brdf_minimal.json"}) {
    auto job = ReadJobFile(Example(example));
    ASSERT_TRUE(job);
    auto again = ParseJob(JobToJson(*job), "", "again");
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_EQ(JobToJson(*again), JobToJson(*job));
    EXPECT_EQ(CanonicalJob(*again), CanonicalJob(*job));
  }
}

TEST(ParseJob, ListsAllProblemsAtOnceWithTheirPointers) {
  auto job = ReadJobFile(Example("job_invalid_many_problems.json"));
  ASSERT_FALSE(job);
  EXPECT_EQ(job.error().code, ErrorCode::kInvalidArgument);
  for (const char* pointer : {"/asset: ", "/maps/0/channels: ", "/maps/1/role: ", "/maps/1/file: ",
                              "/out: ", "/profile: ", "/seed: ", "/threads: ", "/min_psnr_db: "}) {
    EXPECT_THAT(job.error().message, HasSubstr(pointer));
  }
  EXPECT_THAT(job.error().message, HasSubstr("9 problems"));
  EXPECT_THAT(job.error().message, HasSubstr("bcf-3k"));
}

TEST(ParseJob, NamesAnUnknownFieldAndTheKnownOnes) {
  auto job = ReadJobFile(Example("job_invalid_unknown_field.json"));
  ASSERT_FALSE(job);
  EXPECT_THAT(job.error().message, HasSubstr("/colour: is not a field"));
  EXPECT_THAT(job.error().message, HasSubstr("normal_convention"));
}

TEST(ParseJob, RefusesEveryTruncation) {
  auto text = ReadTextFile(Example("job_full.json"), kMaxJobBytes);
  ASSERT_TRUE(text);
  const size_t end = text->find_last_of('}');
  for (size_t n = 0; n <= end; ++n) {
    const std::string cut = text->substr(0, n);
    auto job = ParseJob(cut, "", "job.json");
    ASSERT_FALSE(job) << n;
    ASSERT_EQ(job.error().code, ErrorCode::kInvalidArgument) << n;
  }
}

TEST(ParseJob, RefusesTrailingBytes) {
  EXPECT_FALSE(ParseJob(Minimal().dump() + "x", "", "job.json"));
  EXPECT_FALSE(ParseJob(Minimal().dump() + "{}", "", "job.json"));
  EXPECT_TRUE(ParseJob(Minimal().dump() + "\n\n", "", "job.json"));
}

TEST(ParseJob, RefusesOtherShapesOfJson) {
  for (const char* text :
       {"", "null", "[]", "1", "\"job\"", "{}", "[{}]", "\xff\xfe{}", "{\"version\":1,}"}) {
    EXPECT_FALSE(ParseJob(text, "", "job.json")) << text;
  }
}

TEST(ParseJob, RefusesDeepNestingWithoutExhaustingTheStack) {
  const std::string deep =
      "{\"asset\":" + std::string(1000000, '[') + std::string(1000000, ']') + "}";
  auto job = ParseJob(deep, "", "job.json");
  ASSERT_FALSE(job);
  EXPECT_THAT(job.error().message, HasSubstr("nested deeper"));
  EXPECT_FALSE(ParseJob(std::string(1000000, '['), "", "job.json"));
  EXPECT_FALSE(ParseJob("{\"a\":" + std::string(1000, '{'), "", "job.json"));
}

TEST(ParseJob, RefusesAKeyThatStandsTwice) {
  auto job =
      ParseJob(R"({"version":1,"kind":"material","asset":"a","asset":"b","folder":"f","out":"o"})",
               "", "job.json");
  ASSERT_FALSE(job);
  EXPECT_THAT(job.error().message, HasSubstr("\"asset\" stands twice"));
}

TEST(ParseJob, TellsANewerVersionFromABadOne) {
  Json json = Minimal();
  json["version"] = 2;
  auto newer = ParseJob(json.dump(), "", "job.json");
  ASSERT_FALSE(newer);
  EXPECT_EQ(newer.error().code, ErrorCode::kUnsupported);
  for (const Json& bad : {Json(0), Json(-1), Json("1"), Json(1.5), Json(nullptr)}) {
    json["version"] = bad;
    auto job = ParseJob(json.dump(), "", "job.json");
    ASSERT_FALSE(job) << bad;
    EXPECT_EQ(job.error().code, ErrorCode::kInvalidArgument) << bad;
  }
}

TEST(ParseJob, HoldsNumbersToTheirRanges) {
  EXPECT_EQ(Complaint("seed", 9007199254740991), "");
  EXPECT_EQ(Complaint("seed", 3.0), "");
  EXPECT_NE(Complaint("seed", 9007199254740992), "");
  EXPECT_NE(Complaint("seed", uint64_t{0xFFFFFFFFFFFFFFFF}), "");
  EXPECT_NE(Complaint("seed", 1.5), "");
  EXPECT_NE(Complaint("seed", -1), "");
  EXPECT_NE(Complaint("seed", 1e300), "");
  EXPECT_NE(Complaint("seed", "1"), "");
  EXPECT_NE(Complaint("threads", 257), "");
  EXPECT_EQ(Complaint("threads", 256), "");
  EXPECT_NE(Complaint("min_psnr_db", 100.5), "");
  EXPECT_NE(Complaint("min_psnr_db", -0.5), "");
  EXPECT_NE(Complaint("time_budget_s", true), "");
  EXPECT_NE(Complaint("toksvig", 1), "");
}

TEST(ParseJob, RefusesNamesThatLeaveTheOutputFolder) {
  for (const char* name :
       {"..", ".", ".hidden", "a/b", "/abs", "-flag", "a b", "caf\xC3\xA9", "a\nb"}) {
    EXPECT_NE(Complaint("asset", name), "") << name;
  }
  EXPECT_NE(Complaint("asset", std::string(101, 'a')), "");
  EXPECT_EQ(Complaint("asset", std::string(100, 'a')), "");
  EXPECT_NE(Complaint("folder", std::string("a\0b", 3)), "");
  EXPECT_NE(Complaint("folder", std::string(5000, 'a')), "");
}

TEST(ParseJob, LimitsTheNumberOfMaps) {
  Json maps = Json::array();
  EXPECT_NE(Complaint("maps", maps), "");
  for (size_t i = 0; i < kMaxJobMaps; ++i) maps.push_back({{"role", "albedo"}, {"file", "a.png"}});
  EXPECT_EQ(Complaint("maps", maps), "");
  maps.push_back({{"role", "albedo"}, {"file", "a.png"}});
  EXPECT_NE(Complaint("maps", maps), "");
}

TEST(ReadJobFile, RefusesAFileThatIsTooLarge) {
  const std::string path = testing::TempDir() + "patina_large_job.json";
  ASSERT_TRUE(WriteFileDurably(path, std::string_view(std::string(kMaxJobBytes + 1, ' '))));
  auto job = ReadJobFile(path);
  ASSERT_FALSE(job);
  EXPECT_EQ(job.error().code, ErrorCode::kOutOfRange);
  std::filesystem::remove(path);
}

TEST(ReadMapListFile, ReadsAnArrayOfMaps) {
  const std::string path = testing::TempDir() + "patina_maps.json";
  ASSERT_TRUE(WriteFileDurably(
      path,
      std::string_view(R"([{"role":"albedo","file":"c.png"},{"role":"ao","file":"/x.png"}])")));
  auto maps = ReadMapListFile(path);
  ASSERT_TRUE(maps) << maps.error().message;
  ASSERT_EQ(maps->size(), 2u);
  EXPECT_EQ((*maps)[0].file, "c.png");
  EXPECT_EQ((*maps)[1].file, "/x.png");
  ASSERT_TRUE(WriteFileDurably(path, std::string_view(R"({"maps":[]})")));
  EXPECT_FALSE(ReadMapListFile(path));
  std::filesystem::remove(path);
}

TEST(ReadJob, TakesAMaterialOfASceneAsReflectance) {
  auto job = ParseJob(R"({"version": 1, "kind": "svbrdf", "asset": "seat", "out": "o",
                          "scene": "car.glb", "material": "seat", "address": "clamp"})",
                      "in", "job.json");
  ASSERT_TRUE(job) << job.error().message;
  EXPECT_EQ(job->scene, "in/car.glb");
  EXPECT_EQ(job->scene_material, "seat");
  EXPECT_TRUE(job->address_given);
  const auto again = ParseJob(JobToJson(*job), "", "job.json");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(JobToJson(*again), JobToJson(*job));
  EXPECT_EQ(CanonicalJob(*again), CanonicalJob(*job));
  for (const char* fields : {R"("scene": "a.glb")", R"("material": "m", "folder": "f")",
                             R"("scene": "a.glb", "material": "m", "folder": "f")",
                             R"("scene": "a.glb", "material": "m", "file": "a.btf.json")"}) {
    EXPECT_FALSE(ParseJob(R"({"version": 1, "kind": "svbrdf", "asset": "a", "out": "o", )" +
                              std::string(fields) + "}",
                          "", "job.json"))
        << fields;
  }
}

TEST(BakeAsReflectance, KeepsNothingThatTheKindDoesNotHave) {
  auto job = ParseJob(R"({"version": 1, "kind": "material", "asset": "a", "out": "o",
                          "scene": "a.glb", "material": "m", "effects": {"unused": false},
                          "working_space": "acescg", "profile": "bcf-2k"})",
                      "", "job.json");
  ASSERT_TRUE(job) << job.error().message;
  BakeAsReflectance(&*job);
  EXPECT_EQ(job->kind, JobKind::kSvbrdf);
  EXPECT_TRUE(job->effects.unused);
  EXPECT_EQ(job->working_space, WorkingSpace::kLinearRec709);
  EXPECT_TRUE(ParseJob(JobToJson(*job), "", "job.json"));
  job->kind = JobKind::kBrdf;
  BakeAsReflectance(&*job);
  EXPECT_EQ(job->kind, JobKind::kBrdf);
}

// The parser and the published schema must agree, or a file that an editor calls valid would be
// refused.
TEST(JobSchema, AgreesWithTheParser) {
  std::vector<Json> documents;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(PATINA_SOURCE_DIR) + "/schemas/examples")) {
    if (entry.path().filename().string().rfind("job_", 0) != 0) continue;
    auto text = ReadTextFile(entry.path().string(), kMaxJobBytes);
    ASSERT_TRUE(text);
    documents.push_back(Json::parse(*text));
  }
  ASSERT_GE(documents.size(), 5u);
  const std::vector<Json> values = {
      Json(nullptr),
      Json(true),
      Json(0),
      Json(-1),
      Json(1),
      Json(1.5),
      Json(1000000000),
      Json(1e300),
      Json(""),
      Json("x"),
      Json("auto"),
      Json("wrap"),
      Json("material"),
      Json("brdf"),
      Json("a b"),
      Json("-a"),
      Json("bcf-1k"),
      Json("paper"),
      Json("preview"),
      Json("directx"),
      Json::array(),
      Json::object(),
      Json::array({1}),
      Json("\xC3\xA9"),
      Json("a\n"),
      Json(std::string(101, 'a')),
      Json::array({Json::object()}),
      Json::array({{{"role", "ao"}, {"file", "f"}, {"extra", 1}}}),
      Json::array({{{"role", "ao"}, {"file", "f"}, {"channels", "rg"}}}),
      Json::array({{{"role", "ao"}, {"file", "f"}, {"channels", "x"}}})};
  for (const char* key : {"version",
                          "kind",
                          "asset",
                          "folder",
                          "set",
                          "maps",
                          "out",
                          "profile",
                          "quality",
                          "recipe",
                          "seed",
                          "report",
                          "threads",
                          "target_psnr_db",
                          "target_bpp",
                          "size_budget_bytes",
                          "time_budget_s",
                          "samples",
                          "min_psnr_db",
                          "address",
                          "normal_convention",
                          "repair_nonfinite",
                          "toksvig",
                          "unknown"}) {
    for (const Json& value : values) {
      Json json = Minimal();
      json[key] = value;
      documents.push_back(json);
    }
    Json json = Minimal();
    json.erase(key);
    documents.push_back(json);
  }
  for (const char* key : {"kind", "file", "model", "folder", "maps", "samples", "quality", "seed",
                          "report", "toksvig", "unknown"}) {
    for (const Json& value : values) {
      Json json = MinimalBrdf();
      json[key] = value;
      documents.push_back(json);
    }
    Json json = MinimalBrdf();
    json.erase(key);
    documents.push_back(json);
  }
  for (const char* key :
       {"nside", "primitive_size", "index_bits", "hidden", "hidden_layers", "interpolation",
        "angle_inputs", "canonical_order", "index_training", "unknown"}) {
    for (const Json& value : {Json(0), Json(1), Json(1.5), Json(4), Json(5), Json(12), Json(13),
                              Json(64), Json(65), Json(256), Json(257), Json(-1), Json(true),
                              Json("bilinear"), Json("cubic"), Json("softmax"), Json(nullptr)}) {
      Json json = MinimalBrdf();
      json["model"][key] = value;
      documents.push_back(json);
    }
  }
  int accepted = 0;
  for (const Json& document : documents) {
    const bool by_parser = ParseJob(document.dump(), "", "job.json").has_value();
    const bool by_schema = CheckAgainstSchema("job", document).has_value();
    EXPECT_EQ(by_parser, by_schema) << document.dump();
    accepted += by_parser ? 1 : 0;
  }
  EXPECT_GT(accepted, 20);
}

TEST(CanonicalJob, LeavesOutWhatDoesNotChangeTheBytes) {
  Job a;
  a.asset = "floor";
  a.folder = "/here/floor";
  a.out = "/out";
  Job b = a;
  b.folder = "elsewhere";
  b.out = "other";
  b.threads = 7;
  b.min_psnr_db = 30;
  b.report = false;
  EXPECT_EQ(CanonicalJob(a), CanonicalJob(b));
  for (auto change :
       {+[](Job* j) { j->seed = 2; }, +[](Job* j) { j->profile = Profile::kBcf2k; },
        +[](Job* j) { j->quality = Quality::kPreview; },
        +[](Job* j) { j->recipe = Recipe::kPaper; },
        +[](Job* j) { j->address = AddressMode::kClamp; }, +[](Job* j) { j->toksvig = false; },
        +[](Job* j) { j->samples = 5; }, +[](Job* j) { j->normal_convention = "directx"; },
        +[](Job* j) { j->target_psnr_db = 5; }, +[](Job* j) { j->target_bpp = 5; },
        +[](Job* j) { j->size_budget_bytes = 5; }, +[](Job* j) { j->choose_profile = true; }, +[](Job* j) { j->time_budget_s = 5; },
        +[](Job* j) { j->repair_nonfinite = true; }, +[](Job* j) { j->asset = "wall"; },
        +[](Job* j) {
          j->maps.push_back({"ao", "f.png", "r", "auto", "auto", false});
        }}) {
    Job changed = a;
    change(&changed);
    EXPECT_NE(CanonicalJob(a), CanonicalJob(changed));
  }
}

TEST(CanonicalJob, NamesTheModelOfABrdf) {
  Job a;
  a.kind = JobKind::kBrdf;
  a.asset = "chrome";
  a.file = "/here/chrome.binary";
  Job b = a;
  b.file = "elsewhere.binary";
  b.out = "other";
  b.threads = 3;
  b.model.primitive_size = ModelOfJob(a, {}).primitive_size;  // what it would be anyway
  b.model.index_training = "clusters";
  EXPECT_EQ(CanonicalJob(a), CanonicalJob(b));
  for (auto change :
       {+[](Job* j) { j->seed = 2; }, +[](Job* j) { j->quality = Quality::kPreview; },
        +[](Job* j) { j->recipe = Recipe::kPaper; }, +[](Job* j) { j->asset = "steel"; },
        +[](Job* j) { j->model.nside = 7; }, +[](Job* j) { j->model.interpolation = "uniform"; },
        +[](Job* j) { j->model.canonical_order = false; },
        +[](Job* j) { j->model.index_training = "softmax"; }}) {
    Job changed = a;
    change(&changed);
    EXPECT_NE(CanonicalJob(a), CanonicalJob(changed));
  }
}

TEST(CanonicalJob, TellsUncompressedTexturesFromBlocksAndNothingElse) {
  Job a;
  a.kind = JobKind::kSvbrdf;
  a.asset = "cloth";
  a.file = "cloth.btf.json";
  // What every container so far has in its fingerprint.
  EXPECT_EQ(CanonicalJob(a).find("texture_format"), std::string::npos);
  Job b = a;
  b.model.texture_format = "bc6h";
  EXPECT_EQ(CanonicalJob(a), CanonicalJob(b));
  b.model.texture_format = "fp16";
  EXPECT_NE(CanonicalJob(a), CanonicalJob(b));
  EXPECT_EQ(SvbrdfTrainingOfJob(a, 1 << 20).form, svbrdf::TextureForm::kBlocks);
  EXPECT_EQ(SvbrdfTrainingOfJob(b, 1 << 20).form, svbrdf::TextureForm::kHalves);
}

TEST(ParseJob, TakesATextureFormatOnlyWhereThereIsANeuralTexture) {
  auto full = ReadJobFile(Example("job_svbrdf_full.json"));
  ASSERT_TRUE(full) << full.error().message;
  EXPECT_EQ(full->model.texture_format, "fp16");
  auto again = ParseJob(JobToJson(*full), "", "again");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(JobToJson(*again), JobToJson(*full));
  Json brdf = MinimalBrdf();
  brdf["model"]["texture_format"] = "fp16";
  auto refused = ParseJob(brdf.dump(), "", "job.json");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("belongs to jobs of kind \"svbrdf\""));
  EXPECT_FALSE(CheckAgainstSchema("job", brdf));
  Json svbrdf = {{"version", 1}, {"kind", "svbrdf"}, {"asset", "a"}, {"file", "f.btf.json"},
                 {"out", "o"},   {"model", {{"texture_format", "bc7"}}}};
  auto unknown = ParseJob(svbrdf.dump(), "", "job.json");
  ASSERT_FALSE(unknown);
  EXPECT_THAT(unknown.error().message, HasSubstr("/model/texture_format: must be one of bc6h, fp16"));
  EXPECT_FALSE(CheckAgainstSchema("job", svbrdf));
}

TEST(AssetNameFromPath, MakesALegalNameOfAnyPath) {
  EXPECT_EQ(AssetNameFromPath("textures/wall_01"), "wall_01");
  EXPECT_EQ(AssetNameFromPath("textures/wall_01/"), "wall_01");
  EXPECT_EQ(AssetNameFromPath("/a/old wall (2)"), "old_wall__2_");
  EXPECT_EQ(AssetNameFromPath("/a/..hidden"), "hidden");
  EXPECT_EQ(AssetNameFromPath("/"), "asset");
  for (const std::string path : {"", ".", "..", "/", "///", "-x", "\xFF\xFE", "a/.", "a/.."}) {
    EXPECT_TRUE(IsAssetName(AssetNameFromPath(path))) << path;
  }
  EXPECT_TRUE(IsAssetName(AssetNameFromPath("/a/" + std::string(300, 'x'))));
}

}  // namespace
}  // namespace patina
