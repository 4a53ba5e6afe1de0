#include "pipeline/validate/validate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/container_archive.h"
#include "formats/schema_check.h"
#include "pipeline/validate/report.h"
#include "pipeline/validate/settings.h"
#include "tests/formats/sample_brdf.h"
#include "tests/formats/sample_container.h"

namespace patina::validate {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

std::string Example(const std::string& name) {
  return std::string(PATINA_SOURCE_DIR) + "/schemas/examples/" + name;
}

ValidationReport Judge(const ValidateOptions& options, int threads = 2) {
  ThreadPool pool(threads);
  const CancelToken cancel;
  return Validate(options, pool, cancel, NoProgress());
}

ValidationReport JudgeAt(const std::string& path) {
  ValidateOptions options;
  options.paths = {path};
  return Judge(options);
}

// "1103 wall/r0001/a.dds" of what is above a note.
std::vector<std::string> Lines(const ValidationReport& report) {
  std::vector<std::string> lines;
  for (const PlacedFinding& placed : report.findings) {
    if (placed.finding.severity <= Severity::kNote) continue;
    lines.push_back(std::to_string(placed.finding.number) + " " + placed.finding.file +
                    (placed.finding.pointer.empty() ? "" : " ") + placed.finding.pointer);
  }
  return lines;
}

// <out>/baked with two materials and a BRDF that shares its codebook. The samples' effects list
// only some of their channels, and their quality no map.
class ValidateTree : public ::testing::Test {
 protected:
  void SetUp() override {
    baked_ = out_ / "baked";
    for (const char* asset : {"wall", "floor"}) {
      auto staging = test::StageSample(baked_, asset, 1);
      ASSERT_OK(staging);
      ASSERT_OK(staging->Publish());
    }
    test::BrdfSampleOptions shared;
    shared.shared_codebook = true;
    auto staging = test::StageBrdfSample(baked_, "chrome", 2, shared);
    ASSERT_OK(staging);
    ASSERT_OK(staging->Publish());
    options_.paths = {baked_};
    for (const int known : {1301, 1302, 1305, 1306}) options_.severities[known] = Severity::kOff;
  }

  const test::TemporaryDirectory out_;
  std::string baked_;
  ValidateOptions options_;
};

TEST(ValidateCatalogue, IsTheDocument) {
  const auto document =
      ReadTextFile(std::string(PATINA_SOURCE_DIR) + "/pipeline/validate/FINDINGS.md", 1 << 20);
  ASSERT_OK(document);
  EXPECT_EQ(*document, CatalogueText()) << "run `patina validate --list-codes` again";
}

TEST(ValidateCatalogue, HasOneEntryForEachCode) {
  int before = 1000;
  std::set<std::string> names;
  for (const FindingKind& kind : Catalogue()) {
    EXPECT_GT(kind.number, before);
    before = kind.number;
    EXPECT_TRUE(names.insert(kind.name).second) << kind.name;
    EXPECT_EQ(ParseCode(CodeText(kind.number)), kind.number);
  }
  EXPECT_EQ(ParseCode("PAT-9999"), std::nullopt);
  EXPECT_EQ(ParseCode("1103"), std::nullopt);
}

TEST_F(ValidateTree, IsValidAndComplete) {
  const ValidationReport report = Judge(options_);
  EXPECT_THAT(Lines(report), IsEmpty());
  std::vector<std::string> targets;
  for (const Target& target : report.targets)
    targets.push_back(std::string(KindName(target)) + " " + target.label);
  EXPECT_THAT(targets, ElementsAre("asset baked/chrome", "container baked/chrome/r0001",
                                   "asset baked/floor", "container baked/floor/r0001",
                                   "asset baked/wall", "container baked/wall/r0001"));
  EXPECT_TRUE(report.valid());
  for (const char* inner : {"wall", "wall/r0001", "wall/current", "wall/current/manifest.json"}) {
    ValidateOptions one = options_;
    one.paths = {baked_ + "/" + inner};
    EXPECT_TRUE(Judge(one).valid()) << inner;
    EXPECT_THAT(FormatReport(Judge(one), ReportFormat::kJson), Not(HasSubstr(out_.path())));
  }
}

TEST_F(ValidateTree, TellsWhatIsWrongWithAssetFolders) {
  fs::remove(baked_ + "/wall/current");
  fs::create_symlink("r0007", baked_ + "/wall/current");
  fs::create_directory(baked_ + "/floor/.staging-1-1");
  fs::remove(baked_ + "/chrome/current");
  fs::create_directory(baked_ + "/chrome/current");
  fs::create_directory(baked_ + "/floor/r0001/inner");
  EXPECT_THAT(Lines(Judge(options_)),
              ElementsAre("1203 baked/chrome/current", "1105 baked/floor/r0001/inner",
                          "1201 baked/wall/current"));
  fs::rename(baked_ + "/floor", baked_ + "/ground");
  options_.paths = {baked_ + "/ground"};
  fs::remove(baked_ + "/ground/r0001/inner");
  EXPECT_THAT(Lines(Judge(options_)), ElementsAre("1205 ground/r0001/manifest.json /asset"));
}

TEST_F(ValidateTree, ReportsDoNotDependOnThreadsOrPlace) {
  std::ofstream(baked_ + "/wall/r0001/decoder.weights", std::ios::app) << "x";
  fs::remove(baked_ + "/floor/r0001/report.json");
  const std::string one = ReportSarif(Judge(options_, 1)) + ReportJson(Judge(options_, 1));
  EXPECT_EQ(one, ReportSarif(Judge(options_, 3)) + ReportJson(Judge(options_, 3)));
  const test::TemporaryDirectory elsewhere;
  fs::copy(baked_, elsewhere / "baked",
           fs::copy_options::recursive | fs::copy_options::copy_symlinks);
  options_.paths = {elsewhere / "baked/"};
  EXPECT_EQ(one, ReportSarif(Judge(options_, 2)) + ReportJson(Judge(options_, 2)));
}

TEST_F(ValidateTree, SeveritiesThresholdAndBaselineDecide) {
  std::ofstream(baked_ + "/wall/r0001/notes.txt") << "x";
  const ValidationReport warned = Judge(options_);
  EXPECT_THAT(Lines(warned), ElementsAre("1104 baked/wall/r0001/notes.txt"));
  EXPECT_TRUE(warned.valid());
  options_.fail_on = Severity::kWarning;
  EXPECT_FALSE(Judge(options_).valid());

  ASSERT_OK(WriteFileDurably(out_ / "known.json", std::string_view(BaselineText(warned))));
  auto baseline = ReadBaseline(out_ / "known.json");
  ASSERT_OK(baseline);
  options_.baseline = *baseline;
  const ValidationReport accepted = Judge(options_);
  EXPECT_TRUE(accepted.valid());
  EXPECT_GE(accepted.accepted(), 1u);
  EXPECT_EQ(accepted.stale, 0u);
  EXPECT_THAT(ReportText(accepted), Not(HasSubstr("PAT-1104")));
  EXPECT_THAT(ReportSarif(accepted), HasSubstr("suppressions"));
  fs::remove(baked_ + "/wall/r0001/notes.txt");
  EXPECT_EQ(Judge(options_).stale, 1u);

  options_.baseline.clear();
  std::ofstream(baked_ + "/wall/r0001/notes.txt") << "x";
  ASSERT_OK(WriteFileDurably(
      out_ / "config.json",
      std::string_view(R"({"version": 1, "fail_on": "note", "severity": {"PAT-1104": "off"}})")));
  ASSERT_OK(ReadSettings(out_ / "config.json", &options_));
  EXPECT_EQ(options_.fail_on, Severity::kNote);
  EXPECT_THAT(Lines(Judge(options_)), IsEmpty());
  ASSERT_OK(ReadSeverity("PAT-1104=error", &options_.severities));
  EXPECT_EQ(Judge(options_).Count(Severity::kError), 1u);
  EXPECT_FALSE(ReadSeverity("PAT-1104=bad", &options_.severities).has_value());
  EXPECT_FALSE(ReadSeverity("PAT-1=error", &options_.severities).has_value());
  ASSERT_OK(WriteFileDurably(out_ / "config.json",
                             std::string_view(R"({"version": 1, "fail": "note"})")));
  EXPECT_THAT(test::MessageOf(ReadSettings(out_ / "config.json", &options_)), HasSubstr("fail"));
}

TEST_F(ValidateTree, ComparesInputsThatArePresent) {
  options_.inputs = out_ / "textures";
  options_.paths = {baked_ + "/wall"};
  fs::create_directories(out_ / "textures/wall/sub");
  std::ofstream(out_ / "textures/wall/cobblestone_diff_64.png") << "changed";
  const ValidationReport report = Judge(options_);
  EXPECT_THAT(Lines(report), ElementsAre("1401 wall/r0001/manifest.json /source/files/0"));
  EXPECT_EQ(report.Count(Severity::kNote), 2u);  // the other two are not there
}

TEST_F(ValidateTree, LooksIntoArchives) {
  std::vector<uint8_t> bytes;
  const auto container = OpenContainer(baked_ + "/chrome");
  ASSERT_OK(container);
  ASSERT_OK(PackContainer(
      *container, 3,
      [&](std::span<const uint8_t> more) -> Status {
        bytes.insert(bytes.end(), more.begin(), more.end());
        return {};
      },
      [](const ArchiveMember&) {}));
  const auto check = [&](std::vector<uint8_t> changed) {
    EXPECT_TRUE(WriteFileDurably(out_ / "a.patina", changed).has_value());
    options_.paths = {out_ / "a.patina"};
    return Lines(Judge(options_));
  };
  EXPECT_THAT(check(bytes), IsEmpty());
  auto changed = bytes;
  changed[8] = 'x';
  EXPECT_THAT(check(changed), ElementsAre("7001 a.patina"));
  changed = bytes;
  changed[16] = 9;
  EXPECT_THAT(check(changed), ElementsAre("7003 a.patina"));
  changed = bytes;
  changed[bytes.size() - 30] ^= 1;
  EXPECT_THAT(check(changed), ElementsAre("7006 a.patina"));
  changed = bytes;
  changed[bytes.size() / 2] ^= 1;
  EXPECT_THAT(check(changed), ElementsAre("7008 a.patina"));
  changed = bytes;
  changed.resize(bytes.size() - 1);
  EXPECT_THAT(check(changed), ElementsAre("7004 a.patina"));
}

TEST_F(ValidateTree, ReportsAreWhatTheirSchemasSay) {
  std::ofstream(baked_ + "/wall/r0001/a<&>\"\x01 b.txt") << "x";
  fs::remove(baked_ + "/floor/r0001/features_1.dds");
  const ValidationReport report = Judge(options_);
  const json document = json::parse(ReportJson(report));
  ASSERT_OK(CheckAgainstSchema("validate-report", document));
  EXPECT_EQ(document["counts"]["error"], 1);
  EXPECT_EQ(document["findings"][0]["code"], "PAT-1101");

  const json sarif = json::parse(ReportSarif(report));
  EXPECT_EQ(sarif["version"], "2.1.0");
  const json& run = sarif["runs"][0];
  EXPECT_EQ(run["tool"]["driver"]["rules"].size(), Catalogue().size());
  for (const json& result : run["results"]) {
    EXPECT_EQ(run["tool"]["driver"]["rules"][result["ruleIndex"].get<size_t>()]["id"],
              result["ruleId"]);
    ASSERT_TRUE(result["locations"].is_array());
    const json& where = result["locations"][0]["physicalLocation"]["artifactLocation"];
    EXPECT_EQ(where["uriBaseId"], "%SRCROOT%");
    EXPECT_EQ(where["uri"].get<std::string>().find_first_of(" <>\"\x01"), std::string::npos);
  }
  const std::string junit = ReportJunit(report);
  EXPECT_THAT(junit, HasSubstr("tests=\"6\" failures=\"1\" errors=\"0\""));
  EXPECT_THAT(junit, HasSubstr("a&lt;&amp;&gt;&quot;\xEF\xBF\xBD b.txt"));
  EXPECT_THAT(ReportText(report), Not(HasSubstr("\x01")));
}

TEST(ValidateDocuments, NamesEveryProblemOfAJob) {
  const ValidationReport report = JudgeAt(Example("job_invalid_many_problems.json"));
  EXPECT_EQ(report.targets[0].kind, TargetKind::kDocument);
  EXPECT_GE(report.findings.size(), 3u);
  for (const PlacedFinding& placed : report.findings) {
    EXPECT_EQ(placed.finding.number, 5002);
    EXPECT_EQ(placed.finding.file, "job_invalid_many_problems.json");
    EXPECT_EQ(placed.finding.pointer.rfind("/", 0), 0u) << placed.finding.message;
  }
  EXPECT_THAT(Lines(JudgeAt(Example("job_minimal.json"))),
              ElementsAre("5004 job_minimal.json /folder"));
}

TEST(ValidateDocuments, KnowsThemByTheirContent) {
  const test::TemporaryDirectory folder;
  const auto check = [&](const char* name, std::string_view text) {
    EXPECT_TRUE(WriteFileDurably(folder / name, text).has_value());
    const ValidationReport report = JudgeAt(folder / name);
    const auto lines = Lines(report);
    return std::string(KindName(report.targets[0])) + (lines.empty() ? "" : ": " + lines[0]);
  };
  EXPECT_EQ(check("a.json", R"({"version": 1, "watch": [{"path": "drop"}]})"), "config");
  EXPECT_EQ(check("a.json", R"({"version": 1, "watch": [{"path": 3}]})"),
            "config: 5101 a.json /watch/0/path");
  EXPECT_EQ(check("a.patina.json", R"({"version": 1, "materials": []})"),
            "scene: 5202 a.patina.json /materials");
  EXPECT_EQ(check("a.patina.json", "{"), "scene: 5001 a.patina.json");
  EXPECT_EQ(check("a.scene.json", R"({"format": "patina-scene"})"),
            "scene-manifest: 5301 a.scene.json");
  EXPECT_EQ(check("bindings.json", R"({"format": "patina-shader"})"),
            "bindings: 5401 bindings.json");
  EXPECT_EQ(check("a.json", R"({"version": 1, "kind": "material", "asset": "a",})"),
            "job: 5001 a.json");
  EXPECT_EQ(check("a.json", R"({"some": "thing"})"), "unknown: 9003 a.json");
  EXPECT_EQ(check("a.txt", "text"), "unknown: 9003 a.txt");
  const ValidationReport nothing = JudgeAt(folder / "none");
  EXPECT_THAT(Lines(nothing), ElementsAre("9001 none"));
  EXPECT_TRUE(nothing.unreadable());
}

TEST(ValidateDocuments, ComparesBakedScenesWithTheirContainers) {
  const test::TemporaryDirectory out;
  auto staging = test::StageSample(out.path(), "wall", 1);
  ASSERT_OK(staging);
  ASSERT_OK(staging->Publish());
  const auto scene = [&](const std::string& container, const std::string& fingerprint) {
    const json material = {{"asset", "wall"},
                           {"pointer", "/materials/0"},
                           {"revision", "r0001"},
                           {"container", container},
                           {"fingerprint", fingerprint},
                           {"scene", json::object()},
                           {"constants", json::array()},
                           {"effects", json::array()}};
    const json document = {{"format", "patina-scene"},
                           {"format_version", 1},
                           {"name", "s"},
                           {"file", "s.gltf"},
                           {"sha256", std::string(64, '0')},
                           {"materials", {material}}};
    EXPECT_TRUE(
        WriteFileDurably(out / "s.scene.json", std::string_view(document.dump())).has_value());
    return Lines(JudgeAt(out / "s.scene.json"));
  };
  EXPECT_THAT(scene("gone/r0001", std::string(64, 'a')),
              ElementsAre("5302 s.scene.json /materials/0/container"));
  EXPECT_THAT(scene("../wall/r0001", std::string(64, 'a')),
              ElementsAre("5301 s.scene.json /materials/0/container"));
  // The sample is of no scene, and has a constant and effects that this does not list.
  EXPECT_THAT(scene("wall/r0001", std::string(64, 'b')),
              ElementsAre("5303 s.scene.json /materials/0/fingerprint",
                          "5303 s.scene.json /materials/0/constants",
                          "5303 s.scene.json /materials/0/effects",
                          "5303 s.scene.json /materials/0/scene"));
}

}  // namespace
}  // namespace patina::validate
