#include "pipeline/jobs/job_sets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "formats/base/file_io.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/brdf_files.h"
#include "pipeline/jobs/ingest.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class JobSets : public testing::Test {
 protected:
  JobSets() : folder_(testing::TempDir() + "patina_job_sets") {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~JobSets() override { fs::remove_all(folder_); }

  // Writes a small image that is not constant; `shade` makes it differ from others.
  void Image(const std::string& name, float shade = 0.5f) {
    fs::create_directories(fs::path(folder_ + "/" + name).parent_path());
    std::vector<float> values(4 * 4 * 3);
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = shade * static_cast<float>(i) / static_cast<float>(values.size());
    }
    const Status written =
        WriteImage(folder_ + "/" + name, WriteFormat::kPng8, 4, 4, 3, values.data());
    ASSERT_TRUE(written) << written.error().message;
  }

  void Text(const std::string& name, const std::string& text) {
    fs::create_directories(fs::path(folder_ + "/" + name).parent_path());
    ASSERT_TRUE(WriteFileDurably(folder_ + "/" + name, std::string_view(text)));
  }

  Job JobFor(const std::string& subfolder) const {
    Job job;
    job.asset = "a";
    job.folder = folder_ + subfolder;
    return job;
  }

  std::string FingerprintOfJob(const Job& job) {
    auto set = MapsOfJob(job);
    if (!set) return set.error().message;
    ThreadPool pool(1);
    CancelToken cancel;
    auto source = ReadSource(job, *set, pool, cancel, NoProgress());
    return source ? source->fingerprint : source.error().message;
  }

  std::string folder_;
};

TEST_F(JobSets, AFolderOfMapsIsOneAsset) {
  Image("wall/wall_albedo.png");
  Image("wall/wall_roughness.png");
  auto found = FindAssets(folder_ + "/wall", "");
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_EQ(found->assets.size(), 1u);
  EXPECT_EQ(found->assets[0].asset, "wall");
  EXPECT_EQ(found->assets[0].set, "");
}

TEST_F(JobSets, AFolderOfSeveralSetsIsSeveralAssetsThatAJobMustName) {
  for (const char* stem : {"oak", "pine"}) {
    Image("wood/" + std::string(stem) + "_albedo.png");
    Image("wood/" + std::string(stem) + "_roughness.png");
  }
  auto found = FindAssets(folder_ + "/wood", "");
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_EQ(found->assets.size(), 2u);
  Job job = JobFor("/wood");
  auto ambiguous = MapsOfJob(job);
  ASSERT_FALSE(ambiguous);
  EXPECT_EQ(ambiguous.error().code, ErrorCode::kInvalidArgument);
  for (const FoundAsset& asset : found->assets) {
    EXPECT_THAT(ambiguous.error().message, HasSubstr(asset.set));
    job.set = asset.set;
    auto maps = MapsOfJob(job);
    ASSERT_TRUE(maps) << maps.error().message;
    EXPECT_EQ(maps->maps.size(), 2u);
  }
  job.set = "birch";
  auto unknown = MapsOfJob(job);
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::kNotFound);
}

TEST_F(JobSets, AFolderOfFoldersKeepsTheBadApartFromTheGood) {
  Image("library/a/x_albedo.png");
  Image("library/b/IMG_1.png");
  fs::create_directories(folder_ + "/library/c");
  Image("library/.hidden/x_albedo.png");
  Image("library/baked/x_albedo.png");
  auto found = FindAssets(folder_ + "/library", folder_ + "/library/baked");
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_EQ(found->assets.size(), 2u);
  EXPECT_EQ(found->assets[0].asset, "a");
  EXPECT_EQ(found->assets[0].problem, "");
  EXPECT_EQ(found->assets[1].asset, "b");
  EXPECT_THAT(found->assets[1].problem, HasSubstr("IMG_1.png"));
  ASSERT_EQ(found->skipped.size(), 1u);
  EXPECT_THAT(found->skipped[0], HasSubstr("library/c"));
}

TEST_F(JobSets, NamesWhatIsNotThere) {
  EXPECT_EQ(FindAssets(folder_ + "/nowhere", "").error().code, ErrorCode::kNotFound);
  Image("file.png");
  EXPECT_EQ(FindAssets(folder_ + "/file.png", "").error().code, ErrorCode::kInvalidArgument);
  fs::create_directories(folder_ + "/empty");
  EXPECT_EQ(FindAssets(folder_ + "/empty", "").error().code, ErrorCode::kNotFound);
}

TEST_F(JobSets, AListOfMapsIsTakenAtItsWord) {
  Image("wall/c.png");
  Image("wall/p.png", 0.75f);
  Job job = JobFor("/wall");
  job.maps_folder = job.folder;
  job.maps = {{"albedo", "c.png", "", "auto", "auto", false},
              {"roughness", folder_ + "/wall/p.png", "g", "auto", "auto", true}};
  auto set = MapsOfJob(job);
  ASSERT_TRUE(set) << set.error().message;
  ASSERT_EQ(set->maps.size(), 2u);
  EXPECT_EQ(set->maps[1].role, "roughness");
  EXPECT_TRUE(set->maps[1].invert);
  EXPECT_EQ(set->maps[1].file, "p.png") << "a place on this machine must not reach the manifest";
  job.maps[0].role = "flavour";
  auto unknown = MapsOfJob(job);
  ASSERT_FALSE(unknown);
  EXPECT_THAT(unknown.error().message, HasSubstr("flavour"));
}

TEST_F(JobSets, TheFingerprintFollowsContentAndNotPlace) {
  Image("one/x_albedo.png");
  Image("one/x_roughness.png");
  Image("two/y_albedo.png");
  Image("two/y_roughness.png");
  const std::string one = FingerprintOfJob(JobFor("/one"));
  ASSERT_EQ(one.size(), 64u) << one;
  EXPECT_EQ(FingerprintOfJob(JobFor("/two")), one);
  Job seeded = JobFor("/one");
  seeded.seed = 2;
  EXPECT_NE(FingerprintOfJob(seeded), one);
  fs::rename(folder_ + "/two/y_roughness.png", folder_ + "/two/y_gloss.png");
  EXPECT_NE(FingerprintOfJob(JobFor("/two")), one) << "the same bytes, read another way";
  Image("one/x_roughness.png", 0.9f);
  EXPECT_NE(FingerprintOfJob(JobFor("/one")), one);
}

TEST_F(JobSets, BrdfFilesStandBesideTheSetsOfAFolder) {
  Image("mixed/wall_albedo.png");
  Text("mixed/chrome.binary", "");
  Text("mixed/brushed.bsdf", "");
  Text("mixed/brushed.csv", "wix,wiy,wiz,wox,woy,woz,r,g,b\n");
  Text("mixed/list.json", R"({"samples": []})");
  Text("mixed/.hidden.binary", "");
  // What other programs leave in a folder of textures.
  Text("mixed/buffer.bin", "geometry");
  Text("mixed/licences.csv", "file,author\n");
  Text("mixed/job.json", R"({"version": 1, "kind": "material", "samples": 0})");
  auto found = FindAssets(folder_ + "/mixed", "");
  ASSERT_TRUE(found) << found.error().message;
  std::vector<std::string> names;
  for (const FoundAsset& asset : found->assets) {
    EXPECT_EQ(asset.problem, "");
    EXPECT_EQ(asset.file.empty(), asset.asset == "mixed");
    names.push_back(asset.asset);
  }
  EXPECT_THAT(names,
              testing::ElementsAre("mixed", "brushed_bsdf", "brushed_csv", "chrome", "list"));
}

TEST_F(JobSets, AFolderOfBrdfsAndOfFoldersIsBoth) {
  Text("library/chrome.binary", "");
  Image("library/wall/wall_albedo.png");
  Text("library/measured/steel.bsdf", "");
  Image("library/measured/photo.png");
  fs::create_directories(folder_ + "/library/nothing");
  auto found = FindAssets(folder_ + "/library", "");
  ASSERT_TRUE(found) << found.error().message;
  std::vector<std::string> names;
  for (const FoundAsset& asset : found->assets) names.push_back(asset.asset + asset.problem);
  EXPECT_THAT(names, testing::ElementsAre("chrome", "steel", "wall"));
  ASSERT_EQ(found->skipped.size(), 1u);
  EXPECT_THAT(found->skipped[0], HasSubstr("nothing"));
}

TEST_F(JobSets, AListOfMeasurementsIsToldFromAJob) {
  for (const auto& [text, is_list] : {std::pair(R"({"samples": [{"wi": [0, 0, 1]}]})", true),
                                      {R"({"isotropic": false, "samples": []})", true},
                                      {R"({"samples": [{"kind": 1, "version": 2}]})", true},
                                      {R"({"samples": [{"wi": [0,)", true},
                                      {R"({"samples": [], "kind": "brdf"})", false},
                                      {R"({"version": 1, "samples": 0})", false},
                                      {R"({"a": {"samples": []}})", false},
                                      {R"([{"samples": []}])", false},
                                      {"", false},
                                      {"samples", false}}) {
    Text("x.json", text);
    EXPECT_EQ(IsMeasurementList(folder_ + "/x.json"), is_list) << text;
  }
  EXPECT_FALSE(IsMeasurementList(folder_ + "/nowhere.json"));
}

TEST_F(JobSets, LayeredMaterialsAreKnownByTheirName) {
  Text("wood.layers.json", "{");
  EXPECT_TRUE(LooksLikeBrdfFile(folder_ + "/wood.layers.json"));
  EXPECT_EQ(BrdfAssetName(folder_ + "/wood.layers.json"), "wood");
  const auto files = FindBrdfFiles(folder_);
  ASSERT_TRUE(files.has_value());
  EXPECT_EQ(*files, std::vector<std::string>{folder_ + "/wood.layers.json"});
}

TEST_F(JobSets, LayersOwnTheMapsThatTheyName) {
  Image("lab/wood_albedo.png");
  Image("lab/lacquer_roughness.png", 0.2f);
  Text("lab/lacquer.layers.json", R"({"version": 1,
    "layers": [{"ior": 1.5, "roughness": {"map": "lacquer_roughness.png"}}],
    "base": {"kind": "diffuse", "albedo": {"map": "wood_albedo.png"}}})");
  Text("lab/plain.layers.json", R"({"version": 1, "base": {"kind": "diffuse", "albedo": 0.5}})");
  for (const char* where : {"", "/lab"}) {
    const auto found = FindAssets(folder_ + where, "");
    ASSERT_TRUE(found) << found.error().message;
    ASSERT_EQ(found->assets.size(), 2u) << where;
    EXPECT_EQ(found->assets[0].asset, "lacquer");
    EXPECT_EQ(found->assets[0].problem, "");
    EXPECT_EQ(JobOfBrdfFile("a", found->assets[0].file).kind, JobKind::kSvbrdf);
    EXPECT_EQ(JobOfBrdfFile("a", found->assets[1].file).kind, JobKind::kBrdf);
  }
  EXPECT_EQ(FindMappedStacks(folder_ + "/lab"),
            std::vector<std::string>{folder_ + "/lab/lacquer.layers.json"});
  // Maps that nobody names are a set as ever.
  Image("lab/wall_basecolor.png");
  const auto both = FindAssets(folder_ + "/lab", "");
  ASSERT_TRUE(both) << both.error().message;
  ASSERT_EQ(both->assets.size(), 3u);
  EXPECT_EQ(both->assets[0].file, "");
  Job job = JobFor("/lab");
  job.set = both->assets[0].set;
  const auto wall = MapsOfJob(job);
  ASSERT_TRUE(wall) << wall.error().message;
  EXPECT_EQ(wall->maps[0].file, "wall_basecolor.png");
}

}  // namespace
}  // namespace patina
