// Spatially varying BRDFs through the command `patina`: from a sample to a container, its decoder,
// and what is checked of it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "formats/decoder/patina_svbrdf_decoder.h"
#include "formats/schema_check.h"
#include "tests/system/child_process.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing_support::Outcome;
using testing_support::Patina;
using testing_support::ReadAll;
using testing_support::TempFolder;
using Json = nlohmann::json;

// A job, whose model is small enough to be learned in a second.
std::string WriteJob(const std::string& path, const std::string& list, const std::string& out) {
  const Json job = {{"version", 1},
                    {"kind", "svbrdf"},
                    {"asset", "bumps"},
                    {"file", list},
                    {"out", out},
                    {"quality", "preview"},
                    {"model", {{"nside", 4}, {"hidden", 32}, {"textures", 2}}}};
  std::ofstream(path) << job.dump();
  return path;
}

class BakedBtf : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    made_ = Patina({"sample", "--kind", "btf", "--out", In(), "--size", "16", "--images", "25"});
    baked_ =
        Patina({"bake", WriteJob(*folder_ / "job.json", "in/bumps.btf.json", "out"), "--json"});
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::string In() { return *folder_ / "in"; }
  static std::string Container() { return *folder_ / "out/bumps"; }

  static TempFolder* folder_;
  static Outcome made_, baked_;
};
TempFolder* BakedBtf::folder_ = nullptr;
Outcome BakedBtf::made_, BakedBtf::baked_;

TEST_F(BakedBtf, IsDescribedAndGood) {
  ASSERT_EQ(made_.exit_code, 0) << made_.err;
  EXPECT_THAT(made_.out, HasSubstr("bumps.btf.json"));
  ASSERT_EQ(baked_.exit_code, 0) << baked_.err;
  const Json manifest = Json::parse(ReadAll(Container() + "/current/manifest.json"));
  const Status status = CheckAgainstSchema("manifest", manifest);
  EXPECT_TRUE(status) << status.error().message;
  EXPECT_EQ(manifest["kind"], "svbrdf");
  EXPECT_EQ(manifest["source"]["images"]["count"], 25);
  EXPECT_EQ(manifest["source"]["images"]["address"], "wrap");
  EXPECT_EQ(manifest["source"]["cells"], 25 * 16 * 16);
  EXPECT_EQ(manifest["features"].size(), 2u);
  EXPECT_EQ(manifest["features"][1]["levels"], 5);
  EXPECT_EQ(manifest["brdf"]["network"]["layers"][0], 2 * 16 + 5 + 6);
  // A small model after a second of training: .83, the same everywhere.
  EXPECT_GT(manifest["quality"]["image_ssim"], 0.8);
  const Json result = Json::parse(baked_.out);
  const Status fits = CheckAgainstSchema("result", result);
  EXPECT_TRUE(fits) << fits.error().message;
  EXPECT_GT(result["svbrdf"]["psnr"], 22);
  const std::string page = ReadAll(Container() + "/current/report.html");
  EXPECT_THAT(page, AllOf(HasSubstr("The lit plane"), HasSubstr("times smaller than the images")));
  EXPECT_THAT(Patina({"info", Container()}).out,
              AllOf(HasSubstr("spatially varying BRDF"), HasSubstr("neural texture: 2 x 16 x 16")));
}

TEST_F(BakedBtf, IsValidAndMeasuredTheSameAgain) {
  const Outcome valid = Patina(
      {"validate", Container(), "--against", In() + "/bumps.btf.json", "--fail-on", "warning"});
  EXPECT_EQ(valid.exit_code, 0) << valid.out << valid.err;
  // A texture that nobody refers to any more, and an image that is another one.
  const std::string copy = *folder_ / "broken";
  fs::copy(Container() + "/r0001", copy, fs::copy_options::recursive);
  Json manifest = Json::parse(ReadAll(copy + "/manifest.json"));
  manifest["features"].erase(1);
  std::ofstream(copy + "/manifest.json") << manifest.dump(2);
  const Outcome broken = Patina({"validate", copy});
  EXPECT_EQ(broken.exit_code, 1);
  EXPECT_THAT(broken.out, HasSubstr("/brdf/network/layers"));
}

TEST_F(BakedBtf, IsTheSameToTheByteForAnyThreadCountAndTarget) {
  for (const char* threads : {"1", "3"}) {
    TempFolder again;
    fs::create_directory_symlink(In(), again / "in");
    const std::string job = WriteJob(again / "job.json", "in/bumps.btf.json", "out");
    const Outcome baked = Patina({"bake", job, "--threads", threads, "--simd", "avx2"});
    ASSERT_EQ(baked.exit_code, 0) << baked.err;
    for (const char* file : {"manifest.json", "features_0.dds", "features_1.dds", "grid.hpx",
                             "decoder.weights", "preview.png", "report.json"}) {
      EXPECT_EQ(ReadAll(again / ("out/bumps/current/" + std::string(file))),
                ReadAll(Container() + "/current/" + file))
          << file << ", " << threads << " threads";
    }
  }
}

TEST_F(BakedBtf, DecodesAtAnyPlaceAndRefusesWhatIsDamaged) {
  SvbrdfDecoder decoder;
  std::string problem;
  ASSERT_EQ(SvbrdfDecoder::Load(Container(), &decoder, &problem), SvbrdfDecoder::LoadStatus::kOk)
      << problem;
  EXPECT_EQ(decoder.width(), 16);
  EXPECT_EQ(decoder.levels(), 5);
  const float up[3] = {0, 0, 1}, low[3] = {0.99999f, 0, 0.003f}, below[3] = {0, 0.6f, -0.8f};
  float rgb[3], other[3];
  for (const double u : {-3.7, 0.0, 0.31, 1e9, std::nan("")}) {
    for (const double s : {-1.0, 0.0, 1.5, 4.0, 99.0, std::nan("")}) {
      decoder.Evaluate(low, up, u, 0.5, s, rgb);
      for (const float value : rgb) EXPECT_TRUE(std::isfinite(value) && value >= 0);
    }
  }
  // The texture repeats, and varies.
  decoder.Evaluate(up, up, 0.25, 0.5, 0, rgb);
  decoder.Evaluate(up, up, 2.25, -0.5, 0, other);
  for (int c = 0; c < 3; ++c) EXPECT_EQ(rgb[c], other[c]);
  float least = 1e9f, most = 0;
  for (int x = 0; x < 16; ++x) {
    decoder.Evaluate(up, up, (x + 0.5) / 16, 0.5, 0, rgb);
    least = std::min(least, rgb[0]);
    most = std::max(most, rgb[0]);
  }
  EXPECT_GT(most, 2 * least);
  decoder.Evaluate(below, up, 0, 0, 0, rgb);
  EXPECT_EQ(rgb[0], 0);

  const std::string copy = *folder_ / "damaged";
  fs::copy(Container() + "/r0001", copy, fs::copy_options::recursive);
  fs::resize_file(copy + "/features_1.dds", 200);
  EXPECT_EQ(SvbrdfDecoder::Load(copy, &decoder, &problem), SvbrdfDecoder::LoadStatus::kCorrupt);
  EXPECT_THAT(problem, HasSubstr("features_1.dds"));
  fs::remove(copy + "/features_1.dds");
  EXPECT_EQ(SvbrdfDecoder::Load(copy, &decoder, &problem), SvbrdfDecoder::LoadStatus::kNotFound);
  BrdfDecoder plain;
  EXPECT_EQ(BrdfDecoder::Load(Container(), &plain, &problem),
            BrdfDecoder::LoadStatus::kUnsupported);
}

TEST_F(BakedBtf, IsFoundInAFolderAndItsImagesAreNoMaps) {
  TempFolder library;
  fs::create_directory_symlink(In(), library / "cloth");
  const Outcome baked = Patina({"bake", library.path(), "--out", library / "out", "--quality",
                                "preview", "--profile", "bcf-2k"});
  EXPECT_EQ(baked.exit_code, 0) << baked.err;
  EXPECT_TRUE(fs::exists(library / "out/bumps/current/features_3.dds"));
  EXPECT_THAT(baked.err, HasSubstr("has no --profile"));
}

TEST_F(BakedBtf, BadSetsAreBadInput) {
  TempFolder folder;
  fs::copy(In(), folder / "in", fs::copy_options::recursive);
  fs::remove(folder / "in/l001_v001.exr");
  const Outcome baked = Patina({"bake", folder / "in", "--out", folder / "out"});
  EXPECT_EQ(baked.exit_code, 3);
  EXPECT_THAT(baked.err, AllOf(HasSubstr("bumps.btf.json: /images/6/file"),
                               HasSubstr("l001_v001.exr"), HasSubstr("take its entry out")));
  std::ofstream(folder / "in/l001_v001.exr") << "not an image";
  const Outcome damaged = Patina({"bake", folder / "in", "--out", folder / "out"});
  EXPECT_EQ(damaged.exit_code, 3);
  EXPECT_THAT(damaged.err, HasSubstr("/images/6/file"));
  EXPECT_FALSE(fs::exists(folder / "out/bumps/current"));
}

// Layers with maps, and a texture set: the same way as measured images.
class BakedMaps : public testing::Test {
 protected:
  // With a model that is small enough to be learned in a second.
  static std::string WriteJobOf(const std::string& path, Json input) {
    Json job = {{"version", 1},         {"kind", "svbrdf"},
                {"asset", "maps"},      {"out", "out"},
                {"quality", "preview"}, {"model", {{"nside", 4}, {"hidden", 32}, {"textures", 2}}}};
    job.update(input);
    std::ofstream(path) << job.dump();
    return path;
  }
  Json Manifest() {
    Json manifest = Json::parse(ReadAll(folder_ / "out/maps/current/manifest.json"));
    const Status status = CheckAgainstSchema("manifest", manifest);
    EXPECT_TRUE(status) << status.error().message;
    return manifest;
  }

  TempFolder folder_;
};

TEST_F(BakedMaps, LayersAreSimulatedAtEachTexel) {
  const std::string in = folder_ / "in", list = in + "/scratched_lacquer.layers.json";
  ASSERT_EQ(Patina({"sample", "--kind", "svlayers", "--out", in, "--size", "16"}).exit_code, 0);
  const std::string job =
      WriteJobOf(folder_ / "job.json", {{"file", "in/scratched_lacquer.layers.json"}});
  const Outcome baked = Patina({"bake", job, "--json"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const Json result = Json::parse(baked.out);
  EXPECT_TRUE(CheckAgainstSchema("result", result));
  EXPECT_GT(result["svbrdf"]["psnr"], 22);
  const Json manifest = Manifest();
  const Json& source = manifest["source"];
  EXPECT_EQ(source["format"], "layered");
  EXPECT_EQ(source["images"]["count"], 0);
  EXPECT_EQ(source["files"].size(), 4u);
  EXPECT_GT(source["simulation"]["paths"], 100000);
  EXPECT_EQ(source["simulation"]["effects"],
            Json::array({"rough refraction", "absorption", "colour"}));
  EXPECT_TRUE(manifest["brdf"]["isotropic"] && manifest["brdf"]["canonical_order"]);
  EXPECT_THAT(Patina({"info", folder_ / "out/maps"}).out,
              AllOf(HasSubstr("maps of 16 x 16 texels"), HasSubstr("simulated"),
                    HasSubstr("no texel has one")));
  EXPECT_THAT(ReadAll(folder_ / "out/maps/current/report.html"),
              AllOf(HasSubstr("Three of 64 pairs"), HasSubstr("rough refraction"),
                    HasSubstr("What the accuracy of the simulation costs")));
  EXPECT_EQ(Json::parse(ReadAll(folder_ / "out/maps/current/run.json"))["simulation"].size(), 4u);
  const Outcome valid =
      Patina({"validate", folder_ / "out/maps", "--against", list, "--fail-on", "warning"});
  EXPECT_EQ(valid.exit_code, 0) << valid.out << valid.err;

  // The same bytes for other threads; another map is found out.
  ASSERT_EQ(Patina({"bake", job, "--threads", "3", "--simd", "avx2"}).exit_code, 0);
  for (const char* file : {"manifest.json", "features_0.dds", "decoder.weights", "preview.png"}) {
    EXPECT_EQ(ReadAll(folder_ / ("out/maps/r0001/" + std::string(file))),
              ReadAll(folder_ / ("out/maps/r0002/" + std::string(file))))
        << file;
  }
  fs::copy_file(in + "/lacquer_roughness.png", in + "/lacquer_thickness.png",
                fs::copy_options::overwrite_existing);
  const Outcome other =
      Patina({"validate", folder_ / "out/maps", "--against", list, "--fail-on", "warning"});
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_THAT(other.out, HasSubstr("are not those"));
}

TEST_F(BakedMaps, ATextureSetBecomesReflectance) {
  const std::string in = folder_ / "in";
  ASSERT_EQ(Patina({"sample", "--kind", "material", "--out", in, "--size", "16"}).exit_code, 0);
  fs::remove(in + "/job.json");
  const std::string job = WriteJobOf(folder_ / "job.json", {{"folder", "in"}});
  const Outcome baked = Patina({"bake", job, "--address", "clamp"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  EXPECT_THAT(baked.err, HasSubstr("no part of the reflectance: ao, displacement, emissive"));
  const Json manifest = Manifest();
  EXPECT_EQ(manifest["source"]["format"], "texture_set");
  EXPECT_EQ(manifest["source"]["images"]["address"], "clamp");
  // Files that hold several maps are listed once.
  std::set<std::string> files;
  for (const Json& file : manifest["source"]["files"]) files.insert(file["path"]);
  EXPECT_EQ(files.size(), manifest["source"]["files"].size());
  EXPECT_FALSE(Json::parse(ReadAll(folder_ / "out/maps/current/run.json")).contains("simulation"));
  EXPECT_EQ(manifest["effects"][0]["what"], "ao");
  EXPECT_EQ(manifest["effects"][0]["state"], "left_out");
  EXPECT_FALSE(manifest["brdf"]["isotropic"]);
  EXPECT_GT(manifest["quality"]["image_ssim"], 0.5);
  const Outcome valid =
      Patina({"validate", folder_ / "out/maps", "--against", in, "--fail-on", "warning"});
  EXPECT_EQ(valid.exit_code, 0) << valid.out << valid.err;

  // What cannot become reflectance says why.
  fs::remove(in + "/mosaic_floor_basecolor.png");
  const Outcome bare = Patina({"bake", in, "--as", "svbrdf", "--out", folder_ / "bare"});
  EXPECT_EQ(bare.exit_code, 3);
  EXPECT_THAT(bare.err, HasSubstr("no base colour"));
}

}  // namespace
}  // namespace patina
