// Measured BRDFs through the command `patina`: the real program, real files, exit codes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "formats/brdf/write_brdf.h"
#include "formats/decoder/patina_brdf_decoder.h"
#include "formats/schema_check.h"
#include "tests/system/child_process.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;
using testing_support::Outcome;
using testing_support::Patina;
using testing_support::ReadAll;
using testing_support::Snapshot;
using testing_support::TempFolder;
using Json = nlohmann::json;

Json LastLine(const std::string& text) {
  std::istringstream lines(text);
  std::string line, last;
  while (std::getline(lines, line)) last = line;
  return Json::parse(last, nullptr, false);
}

void Write(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
}

// Maps of 16 x 16 in a folder, and in brdf/ below it sparse.csv and brushed.bin.
void MakeSamples(const std::string& folder) {
  const Outcome made = Patina({"sample", "--out", folder, "--size", "16", "--quiet"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
}

// A list of measurements and its container, baked once with two threads. The tests only read them.
class BakedBrdf : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TempFolder;
    MakeSamples(*shared_ / "samples");
    const Outcome baked = Patina({"bake", Source(), "--out", *shared_ / "out", "--quality",
                                  "preview", "--threads", "2", "--json"});
    ASSERT_EQ(baked.exit_code, 0) << baked.err;
    result_ = LastLine(baked.out);
  }
  static void TearDownTestSuite() { delete std::exchange(shared_, nullptr); }

  static std::string Samples() { return *shared_ / "samples"; }
  static std::string Source() { return *shared_ / "samples/brdf/sparse.csv"; }
  static std::string Asset() { return *shared_ / "out/sparse"; }
  static std::string Folder() { return shared_->path(); }
  static const Json& Measured() { return result_; }

 private:
  static inline TempFolder* shared_ = nullptr;
  static inline Json result_;
};

TEST_F(BakedBrdf, SaysHowGoodItIs) {
  const Json& json = Measured();
  const Status status = CheckAgainstSchema("result", json);
  EXPECT_TRUE(status) << status.error().message;
  EXPECT_EQ(json["asset"], "sparse");
  EXPECT_FALSE(json.contains("profile"));
  EXPECT_FALSE(json.contains("psnr"));
  EXPECT_TRUE(json["brdf"]["image_mae"].is_null());
  // Of values up to 5: a model that gave 0 everywhere would have 0.2.
  EXPECT_LT(json["brdf"]["log1p_mae"], 0.02);
  // The canonical order makes both directions the same lookup, but for pairs of equal heights.
  EXPECT_LT(json["brdf"]["reciprocity"], 1e-3);
  for (const Json& rgb : json["brdf"]["albedo"]) {
    for (const Json& value : rgb) EXPECT_GT(value, 0);
  }
  EXPECT_GT(json["bytes"], 1000);
  EXPECT_LT(json["bytes"], 40000);
}

TEST_F(BakedBrdf, IsAContainerOfItsKind) {
  const std::string current = Asset() + "/current";
  for (const char* file : {"manifest.json", "grid.hpx", "decoder.weights", "sampler.bin",
                           "preview.png", "report.html", "report.json", "run.json"}) {
    EXPECT_TRUE(fs::is_regular_file(current + "/" + file)) << file;
  }
  const std::string text = ReadAll(current + "/manifest.json");
  const Json manifest = Json::parse(text);
  const Status status = CheckAgainstSchema("manifest", manifest);
  EXPECT_TRUE(status) << status.error().message;
  EXPECT_EQ(manifest["kind"], "brdf");
  EXPECT_EQ(manifest["fingerprint"], Measured()["fingerprint"]);
  EXPECT_EQ(manifest["source"]["format"], "sparse");
  EXPECT_EQ(manifest["source"]["cells"], 448);
  EXPECT_EQ(manifest["source"]["files"][0]["path"], "sparse.csv");
  EXPECT_EQ(manifest["quality"]["albedo"].size(), 5u);
  EXPECT_THAT(text, Not(HasSubstr(Folder())));
  EXPECT_THAT(ReadAll(current + "/report.json"), Not(HasSubstr(Folder())));
}

TEST_F(BakedBrdf, EvaluatesAsTheDecoderDoes) {
  TempFolder folder;
  Write(folder / "pairs.csv",
        "wix,wiy,wiz,wox,woy,woz\n"
        "0,0,1,0,0,1\n"
        "# a comment\n"
        "0.6,0,0.8,-0.6,0,0.8\r\n"
        "\n"
        "0.6, 0, 0.8, 0, 0.8, 0.6\n"
        "0,0,1,0.6,0,-0.8\n");
  BrdfDecoder decoder;
  std::string problem;
  ASSERT_EQ(BrdfDecoder::Load(Asset(), &decoder, &problem), BrdfDecoder::LoadStatus::kOk)
      << problem;
  const float pairs[4][2][3] = {{{0, 0, 1}, {0, 0, 1}},
                                {{0.6f, 0, 0.8f}, {-0.6f, 0, 0.8f}},
                                {{0.6f, 0, 0.8f}, {0, 0.8f, 0.6f}},
                                {{0, 0, 1}, {0.6f, 0, -0.8f}}};
  const Outcome outcome = Patina({"eval", Asset(), "--pairs", folder / "pairs.csv"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::istringstream lines(outcome.out);
  std::string line;
  for (const auto& pair : pairs) {
    float expected[3];
    decoder.Evaluate(pair[0], pair[1], expected);
    ASSERT_TRUE(std::getline(lines, line));
    float r, g, b;
    ASSERT_EQ(std::sscanf(line.c_str(), "%f,%f,%f", &r, &g, &b), 3) << line;
    EXPECT_EQ(r, expected[0]);
    EXPECT_EQ(g, expected[1]);
    EXPECT_EQ(b, expected[2]);
    EXPECT_TRUE(std::isfinite(r) && std::isfinite(g) && std::isfinite(b)) << line;
  }
  EXPECT_EQ(line, "0,0,0");
  EXPECT_FALSE(std::getline(lines, line));
  const Outcome to_file =
      Patina({"eval", Asset(), "--pairs", folder / "pairs.csv", "--out", folder / "values.csv"});
  EXPECT_EQ(to_file.exit_code, 0) << to_file.err;
  EXPECT_EQ(to_file.out, "");
  EXPECT_EQ(ReadAll(folder / "values.csv"), outcome.out);
}

TEST_F(BakedBrdf, RefusesPairsThatAreNone) {
  TempFolder folder;
  for (const auto& [text, word] : {std::pair("0,0,1,0,0,1\n0,0,1,0,0\n", "line 2"),
                                   {"0,0,1,0,0,2\n", "unit"},
                                   {"0,0,1,0,0,x\n", "woz"},
                                   {"0,0,1,0,0,nan\n", "woz"},
                                   {"a,b,c,d,e,f\n", "wix"}}) {
    Write(folder / "pairs.csv", text);
    const Outcome outcome = Patina({"eval", Asset(), "--pairs", folder / "pairs.csv"});
    EXPECT_EQ(outcome.exit_code, 3) << text;
    EXPECT_THAT(outcome.err, HasSubstr("pairs.csv"));
    EXPECT_THAT(outcome.err, HasSubstr(word)) << text;
    EXPECT_EQ(outcome.out, "");
  }
  EXPECT_EQ(Patina({"eval", Asset(), "--pairs", folder / "nowhere.csv"}).exit_code, 3);
  EXPECT_EQ(Patina({"eval", Asset()}).exit_code, 2);
}

TEST_F(BakedBrdf, DescribesItself) {
  const Outcome text = Patina({"info", Asset()});
  EXPECT_EQ(text.exit_code, 0) << text.err;
  for (const char* word : {"sparse.csv", "isotropic", "albedo at 30", "grid.hpx", "sampler.bin",
                           "Nside", "448 colours", "bytes for an engine"}) {
    EXPECT_THAT(text.out, HasSubstr(word));
  }
  const Json json = LastLine(Patina({"info", Asset(), "--json"}).out);
  EXPECT_EQ(json["manifest"], Json::parse(ReadAll(Asset() + "/current/manifest.json")));
  EXPECT_EQ(json["bytes"], Measured()["bytes"]);
}

TEST_F(BakedBrdf, HasNoMapsAndSaysWhatToUse) {
  TempFolder folder;
  const Outcome unpacked = Patina({"unpack", Asset(), "--out", folder / "maps"});
  EXPECT_EQ(unpacked.exit_code, 3);
  EXPECT_THAT(unpacked.err, HasSubstr("patina eval"));
  EXPECT_FALSE(fs::exists(folder / "maps"));
  const Outcome compared = Patina({"compare", Asset(), Samples()});
  EXPECT_EQ(compared.exit_code, 3);
  EXPECT_THAT(compared.err, HasSubstr("patina info"));
}

TEST_F(BakedBrdf, IsTheSameToTheByteForAnyThreadCount) {
  TempFolder folder;
  const Outcome baked = Patina({"bake", Source(), "--out", folder / "out", "--quality", "preview",
                                "--threads", "1", "--quiet"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const auto one = Snapshot(folder / "out/sparse/r0001");
  const auto two = Snapshot(Asset() + "/r0001");
  ASSERT_EQ(one.size(), two.size());
  ASSERT_GT(one.size(), 5u);
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].first, two[i].first);
    EXPECT_TRUE(one[i].second == two[i].second) << one[i].first << " differs";
  }
}

TEST_F(BakedBrdf, BakesFromAJobFileWithAModelOfItsOwn) {
  TempFolder folder;
  fs::copy_file(Source(), folder / "list.csv");
  Write(folder / "job.json", R"({"version": 1, "kind": "brdf", "asset": "small",
    "file": "list.csv", "out": "out", "quality": "preview", "model": {"nside": 8, "hidden": 16}})");
  const Outcome run = Patina({"run", folder / "job.json", "--events", folder / "events.ndjson"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::istringstream events(ReadAll(folder / "events.ndjson"));
  for (std::string line; std::getline(events, line);) {
    const Status status = CheckAgainstSchema("events", Json::parse(line));
    EXPECT_TRUE(status) << status.error().message << "\n" << line;
  }
  const Json result = Json::parse(ReadAll(folder / "result.json"));
  const Status status = CheckAgainstSchema("result", result);
  EXPECT_TRUE(status) << status.error().message;
  const Json manifest = Json::parse(ReadAll(folder / "out/small/current/manifest.json"));
  EXPECT_EQ(manifest["brdf"]["nside"], 8);
  EXPECT_EQ(manifest["brdf"]["network"]["layers"][1], 16);
}

TEST(BakeBrdf, BakesAFolderOfMapsAndBrdfsInOneCommand) {
  TempFolder folder;
  MakeSamples(folder / "floor");
  fs::rename(folder / "floor/brdf/sparse.csv", folder / "floor/paint.csv");
  Write(folder / "floor/notes.csv", "who,when\nnobody,never\n");
  Write(folder / "floor/buffer.bin", "geometry of a glTF file");
  const Outcome baked = Patina({"bake", folder / "floor", "--out", folder / "out", "--quality",
                                "preview", "--json", "--profile", "bcf-0.5k"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  EXPECT_THAT(baked.err, HasSubstr("2 of 2 assets baked"));
  EXPECT_THAT(baked.err, HasSubstr("paint: a BRDF has no --profile"));
  const Json json = LastLine(baked.out);
  ASSERT_EQ(json["assets"].size(), 2u) << baked.out;
  EXPECT_EQ(json["assets"][0]["asset"], "floor");
  EXPECT_EQ(json["assets"][0]["profile"], "bcf-0.5k");
  EXPECT_EQ(json["assets"][1]["asset"], "paint");
  EXPECT_TRUE(fs::exists(folder / "out/floor/current/features_0.dds"));
  EXPECT_TRUE(fs::exists(folder / "out/paint/current/grid.hpx"));
  // An evaluation needs a BRDF.
  const Outcome material = Patina({"eval", folder / "out/floor", "--pairs", folder / "none.csv"});
  EXPECT_EQ(material.exit_code, 3);
  EXPECT_THAT(material.err, HasSubstr("patina unpack"));
}

TEST(BakeBrdf, SharesACodebookAmongMaterialsAndKeepsTheRest) {
  const TempFolder folder;
  MakeSamples(folder / "samples");
  fs::create_directories(folder / "in");
  fs::copy_file(folder / "samples/brdf/brushed.bin", folder / "in/one.bin");
  fs::copy_file(folder / "samples/brdf/brushed.bin", folder / "in/two.bin");
  fs::copy_file(folder / "samples/brdf/sparse.csv", folder / "in/list.csv");
  Write(folder / "in/cut.bsdf", "tensor_file");
  const Outcome baked = Patina({"bake", folder / "in", "--out", folder / "out", "--share", "8",
                                "--quality", "preview", "--json"});
  EXPECT_EQ(baked.exit_code, 3) << "of the file that is damaged";
  EXPECT_THAT(baked.err, HasSubstr("cut.bsdf"));
  std::vector<std::string> codebooks;
  for (const auto& entry : fs::directory_iterator(folder / "out")) {
    if (entry.path().extension() == ".hpc") codebooks.push_back(entry.path().filename());
  }
  ASSERT_EQ(codebooks.size(), 1u);
  for (const char* asset : {"one", "two"}) {
    const Json manifest =
        Json::parse(ReadAll(folder / ("out/" + std::string(asset) + "/current/manifest.json")));
    EXPECT_EQ(manifest["brdf"]["codebook"]["file"], codebooks[0]);
    EXPECT_GT(manifest["quality"]["image_ssim"], 0.8);
    BrdfDecoder decoder;
    std::string problem;
    EXPECT_EQ(BrdfDecoder::Load(folder / ("out/" + std::string(asset)), &decoder, &problem),
              BrdfDecoder::LoadStatus::kOk)
        << problem;
  }
  const Json list = Json::parse(ReadAll(folder / "out/list/current/manifest.json"));
  EXPECT_FALSE(list["brdf"].contains("codebook")) << "lists stand alone";
  EXPECT_FALSE(fs::exists(folder / "out/cut"));
}

TEST(BakeBrdf, RefusesDamagedFilesByName) {
  TempFolder folder;
  const std::string row = "0,0,1,0,0,1,";
  const std::pair<const char*, std::string> files[] = {
      {"short.binary", std::string(1000, '\1')},
      {"empty.binary", ""},
      {"empty.bsdf", ""},
      {"short.bsdf", std::string("tensor_file\0\1\0", 14)},
      {"short.bin", std::string(5000, 'x')},
      {"words.csv", "these are no measurements\n"},
      {"negative.csv", row + "-1,-1,-1\n"},
      {"list.json", R"({"samples": [)"},
      {"below.json", R"({"samples": [{"wi": [0, 0, -1], "wo": [0, 0, 1], "rgb": [1, 1, 1]}]})"}};
  for (const auto& [name, text] : files) {
    Write(folder / name, text);
    const Outcome outcome = Patina({"bake", folder / name, "--out", folder / "out"});
    EXPECT_EQ(outcome.exit_code, 3) << name << ": " << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(name));
    EXPECT_FALSE(fs::exists(folder / ("out/" + fs::path(name).stem().string()))) << name;
  }
}

// The format has azimuths, the material needs none.
TEST(BakeBrdf, DoesNotLearnAzimuthsThatChangeNothing) {
  TempFolder folder;
  const auto bake = [&](const char* name, const brdf::BrdfFunction& f) {
    const std::vector<uint8_t> bytes = brdf::EncodeUtia(f);
    Write(folder / (std::string(name) + ".bin"), std::string(bytes.begin(), bytes.end()));
    const Outcome baked = Patina({"bake", folder / (std::string(name) + ".bin"), "--out",
                                  folder / "out", "--quality", "preview", "--json"});
    EXPECT_EQ(baked.exit_code, 0) << baked.err;
    const std::string container = LastLine(baked.out)["container"];
    const Json manifest = Json::parse(ReadAll(container + "/manifest.json"));
    EXPECT_TRUE(CheckAgainstSchema("manifest", manifest));
    EXPECT_THAT(Patina({"info", container}).out, HasSubstr("f(wo, wi)"));
    EXPECT_EQ(Patina({"validate", container}).exit_code, 0);
    return manifest;
  };
  const Json plain =
      bake("plain", [](const brdf::Direction& wi, const brdf::Direction& wo, float* rgb) {
        rgb[0] = rgb[1] = rgb[2] = 0.2f + 0.1f * wi.z * wo.z;
      });
  EXPECT_TRUE(plain["brdf"]["isotropic"]);
  ASSERT_EQ(plain["effects"][0]["what"], "azimuth");
  EXPECT_EQ(plain["effects"][0]["state"], "left_out");
  EXPECT_THAT(plain["effects"][0]["reason"].get<std::string>(), HasSubstr("counts as isotropic"));
  // The samples are as many, of a third of the weights.
  for (const char* saving : {"bytes", "decode_multiply_adds", "train_multiply_adds"})
    EXPECT_GT(plain["effects"][0]["saved"][saving], 0) << saving;
  const Json sided =
      bake("sided", [](const brdf::Direction& wi, const brdf::Direction& wo, float* rgb) {
        rgb[0] = rgb[1] = rgb[2] = 0.2f + 0.1f * wi.x * wi.x + 0.1f * wo.x * wo.x;
      });
  EXPECT_FALSE(sided["brdf"]["isotropic"]);
  EXPECT_EQ(sided["effects"][0]["state"], "learned");
  const auto loaded = [](const Json& manifest) {
    uint64_t bytes = 0;
    for (const Json& payload : manifest["payloads"]) {
      const std::string role = payload["role"];
      if (role != "preview" && role != "report") bytes += payload["bytes"].get<uint64_t>();
    }
    return bytes;
  };
  // What it says it saves is what it saves, but for headers and biases, and codes that are not
  // used.
  const double saved = static_cast<double>(loaded(sided) - loaded(plain));
  EXPECT_NEAR(plain["effects"][0]["saved"]["bytes"].get<double>() / saved, 1, 0.3);
}

TEST(BakeBrdf, TellsAListOfMeasurementsFromAJob) {
  TempFolder folder;
  Write(folder / "job.json", R"({"version": 1, "kind": "brdf", "samples": [], "asset": "a"})");
  const Outcome job = Patina({"bake", folder / "job.json", "--out", folder / "out"});
  EXPECT_EQ(job.exit_code, 3);
  EXPECT_THAT(job.err, HasSubstr("/samples"));
  Write(folder / "list.json", R"({"samples": []})");
  const Outcome list = Patina({"bake", folder / "list.json", "--out", folder / "out"});
  EXPECT_EQ(list.exit_code, 3);
  EXPECT_THAT(list.err, Not(HasSubstr("/asset")));
}

TEST(BakeBrdf, RefusesAListOfMapsForABrdf) {
  TempFolder folder;
  Write(folder / "one.csv", "0,0,1,0,0,1,1,1,1\n");
  Write(folder / "maps.json", R"([{"role": "albedo", "file": "a.png"}])");
  const Outcome outcome =
      Patina({"bake", folder / "one.csv", "--out", folder / "out", "--maps", folder / "maps.json"});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("--maps"));
}

}  // namespace
}  // namespace patina
