// Spatially varying BRDFs through the command `patina`: from a sample to a container, its decoder,
// and what is checked of it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

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
              AllOf(HasSubstr("spatially varying BRDF"), HasSubstr("neural texture: 2 x 16 x 16"),
                    HasSubstr("5 mips, BC6H_UF16, wrap")));
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

TEST_F(BakedBtf, EvaluatesAtPlacesAsTheDecoderDoes) {
  SvbrdfDecoder decoder;
  std::string problem;
  ASSERT_EQ(SvbrdfDecoder::Load(Container(), &decoder, &problem), SvbrdfDecoder::LoadStatus::kOk)
      << problem;
  const std::string pairs = *folder_ / "places.csv";
  std::ofstream(pairs) << "wix,wiy,wiz,wox,woy,woz,u,v,level\n"
                          "0,0,1,0.6,0,0.8,0.25,0.5,0\n"
                          "0,0,1,0.6,0,0.8,-1.3,7.5,1.5\n"
                          "0.6,0,0.8,0,0.8,0.6,0.9,0.1,99\n"
                          "0,0,1,0.6,0,-0.8,0.9,0.1,0\n";
  const float up[3] = {0, 0, 1}, right[3] = {0.6f, 0, 0.8f}, down[3] = {0, 0.8f, 0.6f};
  float expected[4][3] = {};
  decoder.Evaluate(up, right, 0.25, 0.5, 0, expected[0]);
  decoder.Evaluate(up, right, -1.3, 7.5, 1.5, expected[1]);
  decoder.Evaluate(right, down, 0.9, 0.1, 4, expected[2]);
  const Outcome outcome = Patina({"eval", Container(), "--pairs", pairs});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  std::istringstream lines(outcome.out);
  for (const auto& rgb : expected) {
    std::string line;
    ASSERT_TRUE(std::getline(lines, line));
    float read[3];
    ASSERT_EQ(std::sscanf(line.c_str(), "%f,%f,%f", read, read + 1, read + 2), 3) << line;
    for (int c = 0; c < 3; ++c) EXPECT_EQ(read[c], rgb[c]) << line;
  }
  EXPECT_FALSE(lines.peek() != EOF);
  EXPECT_NE(expected[0][0], expected[1][0]);

  std::ofstream(pairs) << "0,0,1,0.6,0,0.8\n";
  const Outcome bare = Patina({"eval", Container(), "--pairs", pairs});
  EXPECT_EQ(bare.exit_code, 3);
  EXPECT_EQ(bare.out, "");
  EXPECT_THAT(bare.err, AllOf(HasSubstr("places.csv: line 1"), HasSubstr("columns u and v")));
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

// Little-endian halves of a file, from a byte on.
void PutHalf(const std::string& path, std::streamoff at, uint16_t half) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(at);
  const char bytes[2] = {static_cast<char>(half & 0xFF), static_cast<char>(half >> 8)};
  file.write(bytes, 2);
  ASSERT_TRUE(file.good());
}

TEST_F(BakedBtf, UncompressedTexturesAreAnOption) {
  TempFolder folder;
  fs::create_directory_symlink(In(), folder / "in");
  const std::string job = WriteJob(folder / "job.json", "in/bumps.btf.json", "out");
  const Outcome baked = Patina({"bake", job, "--texture-format", "fp16", "--json"});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const std::string container = folder / "out/bumps";
  const Json manifest = Json::parse(ReadAll(container + "/current/manifest.json"));
  const Status fits = CheckAgainstSchema("manifest", manifest);
  EXPECT_TRUE(fits) << fits.error().message;
  const Json blocks = Json::parse(ReadAll(Container() + "/current/manifest.json"));
  EXPECT_NE(manifest["fingerprint"], blocks["fingerprint"]);
  EXPECT_EQ(manifest["format_version"], 1);
  constexpr uint64_t kBytes = 148 + 8 * (256 + 64 + 16 + 4 + 1);
  for (size_t t = 0; t < 2; ++t) {
    EXPECT_EQ(manifest["features"][t]["format"], "RGBA16F");
    EXPECT_EQ(blocks["features"][t]["format"], "BC6H_UF16");
    EXPECT_EQ(manifest["payloads"][t]["bytes"], kBytes);
    EXPECT_EQ(fs::file_size(container + "/current/features_" + std::to_string(t) + ".dds"), kBytes);
  }
  // No worse than blocks, whose test asks for .8 of the same model.
  EXPECT_GT(manifest["quality"]["image_ssim"], 0.8);
  EXPECT_GT(Json::parse(baked.out)["bytes"], 2 * kBytes);
  EXPECT_THAT(ReadAll(container + "/current/report.html"),
              AllOf(HasSubstr("2 uncompressed fp16 textures of 16"),
                    HasSubstr("behind texels of half precision")));
  EXPECT_THAT(Patina({"info", container}).out, HasSubstr("5 mips, RGBA16F, wrap"));

  const Outcome valid = Patina(
      {"validate", container, "--against", In() + "/bumps.btf.json", "--fail-on", "warning"});
  EXPECT_EQ(valid.exit_code, 0) << valid.out << valid.err;
  const Outcome unpacked = Patina({"unpack", container, "--out", folder / "maps"});
  const Outcome as_blocks = Patina({"unpack", Container(), "--out", folder / "maps"});
  EXPECT_EQ(unpacked.exit_code, as_blocks.exit_code);
  // Through one file and back.
  ASSERT_EQ(Patina({"pack", container, "-o", folder / "bumps.patina"}).exit_code, 0);
  ASSERT_EQ(
      Patina({"unpack-archive", folder / "bumps.patina", "--out", folder / "unpacked"}).exit_code,
      0);
  EXPECT_EQ(ReadAll(folder / "unpacked/features_1.dds"),
            ReadAll(container + "/current/features_1.dds"));
  const Outcome shader = Patina({"shader", container, "--out", folder / "shader"});
  EXPECT_EQ(shader.exit_code, 0) << shader.err;
  EXPECT_EQ(Patina({"shader", Container(), "--out", folder / "blocks"}).exit_code, 0);
  EXPECT_EQ(ReadAll(folder / "shader/brdf.glsl"), ReadAll(folder / "blocks/brdf.glsl"));
  EXPECT_THAT(ReadAll(folder / "shader/bindings.json"), HasSubstr("\"RGBA16_FLOAT\""));

  // The same bytes for other threads.
  const Outcome again =
      Patina({"bake", job, "--texture-format", "fp16", "--threads", "3", "--simd", "avx2"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  for (const char* file : {"manifest.json", "features_0.dds", "features_1.dds", "decoder.weights"})
    EXPECT_EQ(ReadAll(container + "/r0001/" + file), ReadAll(container + "/r0002/" + file)) << file;
  // What is the default is no other bake.
  const Outcome named = Patina({"bake", job, "--texture-format", "bc6h"});
  ASSERT_EQ(named.exit_code, 0) << named.err;
  for (const char* file : {"manifest.json", "features_0.dds", "features_1.dds"})
    EXPECT_EQ(ReadAll(container + "/current/" + file), ReadAll(Container() + "/current/" + file));
}

TEST_F(BakedBtf, UncompressedTexturesThatAreDamagedAreRefused) {
  TempFolder folder;
  fs::create_directory_symlink(In(), folder / "in");
  const std::string job = WriteJob(folder / "job.json", "in/bumps.btf.json", "out");
  ASSERT_EQ(Patina({"bake", job, "--texture-format", "fp16", "-q"}).exit_code, 0);
  const std::string good = folder / "out/bumps/r0001";
  SvbrdfDecoder decoder;
  std::string problem;
  ASSERT_EQ(SvbrdfDecoder::Load(good, &decoder, &problem), SvbrdfDecoder::LoadStatus::kOk)
      << problem;
  const std::string texture = "/features_1.dds";
  for (const uint16_t half : std::initializer_list<uint16_t>{0x7C00, 0xFC00, 0x7E00, 0xFFFF}) {
    // Of the first texel, one within, and the last.
    for (const std::streamoff at : {148, 148 + 8 * 100 + 2, 148 + 8 * 340 + 4}) {
      const std::string copy = folder / "damaged";
      fs::remove_all(copy);
      fs::copy(good, copy, fs::copy_options::recursive);
      PutHalf(copy + texture, at, half);
      EXPECT_EQ(SvbrdfDecoder::Load(copy, &decoder, &problem), SvbrdfDecoder::LoadStatus::kCorrupt);
      EXPECT_THAT(problem, AllOf(HasSubstr("features_1.dds"), HasSubstr("not finite")));
      if (half != 0x7E00) continue;
      const Outcome found = Patina({"validate", copy});
      EXPECT_EQ(found.exit_code, 1);
      EXPECT_THAT(found.out, AllOf(HasSubstr("PAT-2103"), HasSubstr("PAT-1103")));
    }
  }
  // Alpha means nothing to a decoder, but is not what FORMATS.md says.
  const std::string copy = folder / "alpha";
  fs::copy(good, copy, fs::copy_options::recursive);
  PutHalf(copy + texture, 148 + 6, 0x7E00);
  EXPECT_EQ(SvbrdfDecoder::Load(copy, &decoder, &problem), SvbrdfDecoder::LoadStatus::kOk);
  EXPECT_THAT(Patina({"validate", copy}).out, HasSubstr("PAT-2007"));
  // Every length but the right one, and blocks under the name of halves.
  const uint64_t whole = fs::file_size(good + texture);
  for (uint64_t size = 0; size < whole; size += size < 160 ? 1 : 97) {
    fs::resize_file(copy + texture, size);
    ASSERT_EQ(SvbrdfDecoder::Load(copy, &decoder, &problem), SvbrdfDecoder::LoadStatus::kCorrupt)
        << size;
  }
  fs::copy_file(Container() + "/r0001" + texture, copy + texture,
                fs::copy_options::overwrite_existing);
  EXPECT_EQ(SvbrdfDecoder::Load(copy, &decoder, &problem), SvbrdfDecoder::LoadStatus::kCorrupt);
  Json manifest = Json::parse(ReadAll(copy + "/manifest.json"));
  manifest["features"][1]["format"] = "RGB16F";
  std::ofstream(copy + "/manifest.json") << manifest.dump(2);
  EXPECT_EQ(SvbrdfDecoder::Load(copy, &decoder, &problem), SvbrdfDecoder::LoadStatus::kUnsupported);
  EXPECT_THAT(problem, HasSubstr("/features/1/format"));
}

TEST_F(BakedBtf, ATextureFormatIsRefusedWhereThereIsNoNeuralTexture) {
  TempFolder folder;
  ASSERT_EQ(Patina({"sample", "--kind", "material", "--out", folder / "floor", "--size", "16"})
                .exit_code,
            0);
  const Outcome material = Patina(
      {"bake", folder / "floor", "--out", folder / "out", "--texture-format", "fp16"});
  EXPECT_EQ(material.exit_code, 3);
  EXPECT_THAT(material.err, AllOf(HasSubstr("--texture-format is of the neural texture"),
                                  HasSubstr("this is a material"), HasSubstr("--as svbrdf")));
  EXPECT_FALSE(fs::exists(folder / "out"));
  const std::string job = folder / "job.json";
  std::ofstream(job) << Json{{"version", 1},
                             {"kind", "brdf"},
                             {"asset", "chrome"},
                             {"file", "chrome.binary"},
                             {"out", "out"},
                             {"model", {{"texture_format", "fp16"}}}};
  const Outcome brdf = Patina({"bake", job});
  EXPECT_EQ(brdf.exit_code, 3);
  EXPECT_THAT(brdf.err, HasSubstr("\"texture_format\" belongs to jobs of kind \"svbrdf\""));
  EXPECT_EQ(Patina({"bake", In(), "--out", folder / "out", "--texture-format", "bc7"}).exit_code, 2);
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

// A material of a scene: packed channels, factors and one transform; what else there is, is refused
// by name.
TEST_F(BakedMaps, AMaterialOfASceneBecomesReflectance) {
  const std::string in = folder_ / "in";
  ASSERT_EQ(Patina({"sample", "--kind", "material", "--out", in, "--size", "16"}).exit_code, 0);
  const Json turned = {{"KHR_texture_transform", {{"scale", {2, 2}}}}};
  const Json base = {{"index", 0}, {"extensions", turned}};
  const auto coat = [&base](const char* extension, const char* factor) {
    return Json{{"name", extension},
                {"pbrMetallicRoughness", {{"baseColorTexture", base}}},
                {"extensions", {{extension, {{factor, 1}}}}}};
  };
  Json gltf = {{"asset", {{"version", "2.0"}}},
               {"images",
                {{{"uri", "mosaic_floor_basecolor.png"}}, {{"uri", "mosaic_floor_normal_gl.png"}}}},
               {"textures", {{{"source", 0}}, {{"source", 1}}}}};
  gltf["materials"] =
      Json::array({{{"name", "floor"},
                    {"alphaMode", "MASK"},
                    {"emissiveFactor", {1, 1, 1}},
                    {"emissiveTexture", {{"index", 0}}},
                    {"normalTexture", {{"index", 1}, {"scale", 0.5}, {"extensions", turned}}},
                    {"extensions", {{"KHR_materials_ior", {{"ior", 1.8}}}}},
                    {"pbrMetallicRoughness",
                     {{"baseColorTexture", base},
                      {"baseColorFactor", {0.5, 1, 1, 1}},
                      {"metallicRoughnessTexture", base},
                      {"metallicFactor", 0.25}}}},
                   {{"name", "plain"}},
                   {{"name", "torn"},
                    {"normalTexture", {{"index", 1}}},
                    {"pbrMetallicRoughness", {{"baseColorTexture", base}}}},
                   coat("KHR_materials_clearcoat", "clearcoatFactor"),
                   coat("KHR_materials_transmission", "transmissionFactor"),
                   coat("KHR_materials_unlit", "nothing")});
  std::ofstream(in + "/hall.gltf") << gltf.dump();
  const std::string job =
      WriteJobOf(folder_ / "job.json",
                 {{"asset", "hall_floor"}, {"scene", "in/hall.gltf"}, {"material", "floor"}});
  const Outcome baked = Patina({"bake", job});
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  EXPECT_THAT(baked.err, HasSubstr("no part of the reflectance: emissive, opacity"));
  const std::string container = folder_ / "out/hall_floor/current";
  const Json manifest = Json::parse(ReadAll(container + "/manifest.json"));
  EXPECT_TRUE(CheckAgainstSchema("manifest", manifest));
  EXPECT_EQ(manifest["kind"], "svbrdf");
  EXPECT_EQ(manifest["source"]["format"], "texture_set");
  EXPECT_EQ(manifest["source"]["files"].size(), 2u);
  const Json& look = manifest["scene"];
  EXPECT_EQ(look["material"], "floor");
  EXPECT_EQ(look["alpha_mode"], "mask");
  EXPECT_TRUE(look["factors"].empty() && look["parameters"].empty()) << look;
  ASSERT_EQ(look["bindings"].size(), 3u) << look;
  for (const Json& binding : look["bindings"])
    EXPECT_EQ(binding["transform"]["scale"], Json({2.0, 2.0}));
  EXPECT_FALSE(fs::exists(container + "/source"));
  // The scene says where it is, and is right.
  const Json scene = Json::parse(ReadAll(folder_ / "out/hall.scene.json"));
  EXPECT_EQ(scene["materials"][0]["kind"], "svbrdf");
  EXPECT_EQ(scene["materials"][0]["scene"], look);
  const Outcome valid = Patina({"validate", folder_ / "out", "--fail-on", "warning"});
  EXPECT_EQ(valid.exit_code, 0) << valid.out << valid.err;
  EXPECT_THAT(Patina({"info", container}).out, HasSubstr("hall.gltf, material 0"));

  // Numbers that f follows from are part of what is baked.
  const std::string fingerprint = manifest["fingerprint"];
  gltf["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {0.5, 1, 0.5, 1};
  std::ofstream(in + "/hall.gltf") << gltf.dump();
  ASSERT_EQ(Patina({"bake", job}).exit_code, 0);
  EXPECT_NE(Json::parse(ReadAll(container + "/manifest.json"))["fingerprint"], fingerprint);

  const Outcome refused = Patina(
      {"bake", in + "/hall.gltf", "--as", "svbrdf", "--material", "plain", "--material", "torn",
       "--material", "KHR_materials_clearcoat", "--material", "KHR_materials_transmission",
       "--material", "KHR_materials_unlit", "--out", folder_ / "refused"});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("/materials/1: it has no texture"),
                    HasSubstr("/materials/2: pbrMetallicRoughness.baseColorTexture and "
                              "normalTexture have different coordinates"),
                    HasSubstr("/materials/3: its clearcoat (KHR_materials_clearcoat)"),
                    HasSubstr("/materials/4: its transmission (KHR_materials_transmission)"),
                    HasSubstr("/materials/5: it is unlit (KHR_materials_unlit)")));
  EXPECT_FALSE(fs::exists(folder_ / "refused/hall_plain/current"));
}

}  // namespace
}  // namespace patina
