// The command `patina` as a user meets it: the real program, real files, exit codes.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "formats/schema_check.h"
#include "pipeline/image/image_io.h"
#include "pipeline/kernels/dispatch.h"
#include "tests/system/child_process.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;
using testing_support::Child;
using testing_support::Outcome;
using testing_support::Patina;
using testing_support::ReadAll;
using testing_support::Snapshot;
using testing_support::TempFolder;
using Json = nlohmann::json;

void MakeSample(const std::string& folder, int size = 64) {
  const Outcome made = Patina(
      {"sample", "--kind", "material", "--out", folder, "--size", std::to_string(size), "--quiet"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
}

Json LastLine(const std::string& text) {
  std::istringstream lines(text);
  std::string line, last;
  while (std::getline(lines, line)) last = line;
  return Json::parse(last, nullptr, false);
}

std::vector<std::string> Preview(std::vector<std::string> arguments) {
  arguments.insert(arguments.end(), {"--quality", "preview"});
  return arguments;
}

void Write(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
}

bool HasStaging(const std::string& folder) {
  std::error_code ignored;
  for (const auto& entry : fs::recursive_directory_iterator(folder, ignored)) {
    if (entry.path().filename().string().rfind(".staging", 0) == 0) return true;
  }
  return false;
}

// ---- what it makes ----

TEST(Bake, MakesAContainerAndSaysSoInJson) {
  TempFolder folder;
  MakeSample(folder / "floor");
  const Outcome baked =
      Patina(Preview({"bake", folder / "floor", "--out", folder / "out", "--json"}));
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const Json json = LastLine(baked.out);
  const Status status = CheckAgainstSchema("result", json);
  EXPECT_TRUE(status) << status.error().message;
  for (const char* key : {"asset", "container", "profile", "seconds", "cpu_seconds", "samples",
                          "bytes", "psnr", "ssim", "flip"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  EXPECT_EQ(json["asset"], "floor");
  EXPECT_EQ(json["profile"], "bcf-1k");
  EXPECT_GT(json["psnr"]["overall"], 20);
  EXPECT_GT(json["psnr"]["mean_mips"], json["psnr"]["mip0"]);
  for (const char* map :
       {"albedo", "normal", "ao", "roughness", "metalness", "displacement", "emissive"}) {
    EXPECT_TRUE(json["psnr"]["maps"].contains(map)) << map;
  }
  const std::string container = json["container"];
  EXPECT_TRUE(fs::equivalent(container, folder / "out/floor/current"));
  for (const char* file : {"manifest.json", "features_0.dds", "features_3.dds", "decoder.weights",
                           "preview.png", "report.html", "report.json", "run.json"}) {
    EXPECT_TRUE(fs::is_regular_file(container + "/" + file)) << file;
  }
  EXPECT_FALSE(HasStaging(folder / "out"));
  const Json manifest = Json::parse(ReadAll(container + "/manifest.json"));
  const Status manifest_status = CheckAgainstSchema("manifest", manifest);
  EXPECT_TRUE(manifest_status) << manifest_status.error().message;
  EXPECT_EQ(manifest["fingerprint"], json["fingerprint"]);
  EXPECT_THAT(ReadAll(container + "/manifest.json"), Not(HasSubstr(folder.path())));
  EXPECT_THAT(ReadAll(container + "/report.json"), Not(HasSubstr(folder.path())));
}

TEST(Bake, IsTheSameToTheByteForAnyThreadCountAndInstructionSet) {
  TempFolder folder;
  MakeSample(folder / "floor");
  std::vector<std::vector<std::string>> variants = {
      {"--threads", "1"}, {"--threads", "2"}, {"--threads", "3"}, {"--simd", "avx2"}};
  if (SimdTargetSupported(SimdTarget::kAvx512)) variants.push_back({"--simd", "avx512"});
  std::vector<std::pair<std::string, std::string>> first;
  for (size_t i = 0; i < variants.size(); ++i) {
    const std::string out = folder / ("out" + std::to_string(i));
    std::vector<std::string> arguments =
        Preview({"bake", folder / "floor", "--out", out, "--quiet"});
    arguments.insert(arguments.end(), variants[i].begin(), variants[i].end());
    const Outcome baked = Patina(arguments);
    ASSERT_EQ(baked.exit_code, 0) << baked.err;
    const auto files = Snapshot(out);
    ASSERT_GT(files.size(), 7u);
    if (i == 0) first = files;
    ASSERT_EQ(files.size(), first.size());
    for (size_t f = 0; f < files.size(); ++f) {
      EXPECT_EQ(files[f].first, first[f].first);
      EXPECT_TRUE(files[f].second == first[f].second)
          << files[f].first << " differs with " << variants[i][0] << " " << variants[i][1];
    }
  }
}

TEST(Bake, GoesOnAfterAnAssetThatFails) {
  TempFolder folder;
  MakeSample(folder / "library/a_good", 32);
  fs::create_directories(folder / "library/b_bad");
  fs::copy_file(folder / "library/a_good/mosaic_floor_arm.png",
                folder / "library/b_bad/broken_albedo.png");
  fs::resize_file(folder / "library/b_bad/broken_albedo.png", 200);
  MakeSample(folder / "library/c_good", 32);
  fs::create_directories(folder / "library/d_no_images");
  const Outcome baked =
      Patina(Preview({"bake", folder / "library", "--out", folder / "out", "--json"}));
  EXPECT_EQ(baked.exit_code, 3);
  EXPECT_THAT(baked.err, HasSubstr("broken_albedo.png"));
  EXPECT_THAT(baked.err, HasSubstr("2 of 3 assets baked"));
  const Json json = LastLine(baked.out);
  ASSERT_EQ(json["assets"].size(), 3u) << baked.out;
  EXPECT_EQ(json["exit_code"], 3);
  EXPECT_EQ(json["assets"][0]["status"], "done");
  EXPECT_EQ(json["assets"][1]["status"], "failed");
  EXPECT_EQ(json["assets"][1]["exit_code"], 3);
  EXPECT_EQ(json["assets"][2]["status"], "done");
  EXPECT_TRUE(fs::exists(folder / "out/a_good/current"));
  EXPECT_FALSE(fs::exists(folder / "out/b_bad"));
  EXPECT_TRUE(fs::exists(folder / "out/c_good/current"));
}

TEST(Bake, KeepsTwoInputsOfOneNameApart) {
  TempFolder folder;
  MakeSample(folder / "x/floor", 16);
  MakeSample(folder / "y/floor", 16);
  const Outcome baked =
      Patina(Preview({"bake", folder / "x/floor", folder / "y/floor", "--out", folder / "out"}));
  EXPECT_EQ(baked.exit_code, 3);
  EXPECT_THAT(baked.err, HasSubstr("also named floor"));
  EXPECT_TRUE(fs::exists(folder / "out/floor/r0001"));
  EXPECT_FALSE(fs::exists(folder / "out/floor/r0002"));
}

TEST(Bake, TakesAnExplicitListOfMaps) {
  TempFolder folder;
  MakeSample(folder / "floor", 32);
  Write(folder / "maps.json", R"([
    {"role": "albedo", "file": "floor/mosaic_floor_basecolor.png"},
    {"role": "roughness", "file": "floor/mosaic_floor_height.png", "invert": true}])");
  const Outcome baked = Patina(Preview({"bake", folder / "floor", "--out", folder / "out", "--maps",
                                        folder / "maps.json", "--json"}));
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const Json maps = LastLine(baked.out)["psnr"]["maps"];
  EXPECT_EQ(maps.size(), 2u);
  EXPECT_TRUE(maps.contains("roughness"));
}

TEST(Bake, PublishesConstantMapsAsNumbers) {
  TempFolder folder;
  const std::vector<float> grey(16 * 16 * 3, 0.5f);
  fs::create_directories(folder / "plain");
  ASSERT_TRUE(
      WriteImage(folder / "plain/plain_basecolor.png", WriteFormat::kPng8, 16, 16, 3, grey.data()));
  const Outcome baked =
      Patina(Preview({"bake", folder / "plain", "--out", folder / "out", "--json"}));
  ASSERT_EQ(baked.exit_code, 0) << baked.err;
  const Json json = LastLine(baked.out);
  EXPECT_EQ(json["bytes"], 0);
  EXPECT_EQ(json["psnr"]["overall"], 99.99);
  EXPECT_FALSE(fs::exists(folder / "out/plain/current/features_0.dds"));
  const Outcome unpacked = Patina({"unpack", folder / "out/plain", "--out", folder / "maps"});
  EXPECT_EQ(unpacked.exit_code, 0) << unpacked.err;
  auto image = ReadImage(folder / "maps/albedo.png");
  ASSERT_TRUE(image);
  EXPECT_EQ(image->bytes[0], 128);
}

// ---- what it refuses ----

TEST(Usage, ExitsWithTwo) {
  TempFolder folder;
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"bake"},
        {"bake", "x", "--colour"},
        {"bake", "x", "--out", "o", "--profile", "huge"},
        {"bake", "x", "--out", "o", "--seed", "-1"},
        {"bake", "x", "--out", "o", "--min-psnr", "1000"},
        {"frobnicate"},
        {"run"},
        {"unpack", "x"},
        {"sample", "--out", folder / "s", "--size", "0"},
        {"help", "frobnicate"},
        {"bake", "x", "y", "--out", "o", "--maps", "m.json"},
        {"unpack", "x", "--out", "o", "--format", "bmp"}}) {
    const Outcome outcome = Patina(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments[0] << ": " << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("patina: error: "));
    EXPECT_EQ(outcome.out, "");
  }
}

TEST(Usage, HelpsOnStandardOutput) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{},
                                                    {"--help"},
                                                    {"help"},
                                                    {"bake", "--help"},
                                                    {"help", "bake"},
                                                    {"unpack", "-h"}}) {
    const Outcome outcome = Patina(arguments);
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_THAT(outcome.out, HasSubstr("Example"));
  }
  const Outcome version = Patina({"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_THAT(version.out, HasSubstr("patina "));
}

TEST(BadInput, ExitsWithThreeAndNamesTheCulprit) {
  TempFolder folder;
  const Outcome missing = Patina({"bake", folder / "nowhere", "--out", folder / "out"});
  EXPECT_EQ(missing.exit_code, 3);
  EXPECT_THAT(missing.err, HasSubstr("nowhere"));

  fs::create_directories(folder / "empty");
  EXPECT_EQ(Patina({"bake", folder / "empty", "--out", folder / "out"}).exit_code, 3);

  MakeSample(folder / "floor", 16);
  fs::create_directories(folder / "holiday");
  fs::copy_file(folder / "floor/mosaic_floor_arm.png", folder / "holiday/IMG_0001.png");
  const Outcome no_maps = Patina({"bake", folder / "holiday", "--out", folder / "out"});
  EXPECT_EQ(no_maps.exit_code, 3);
  EXPECT_THAT(no_maps.err, HasSubstr("IMG_0001.png"));

  // Not beside the other files of the set, whose stem decides what belongs to it.
  fs::create_directories(folder / "twice");
  fs::copy_file(folder / "floor/mosaic_floor_basecolor.png", folder / "twice/floor_basecolor.png");
  fs::copy_file(folder / "floor/mosaic_floor_basecolor.png", folder / "twice/floor_albedo.png");
  const Outcome twice = Patina({"bake", folder / "twice", "--out", folder / "out"});
  EXPECT_EQ(twice.exit_code, 3);
  EXPECT_THAT(twice.err, HasSubstr("floor_basecolor.png"));
  EXPECT_THAT(twice.err, HasSubstr("floor_albedo.png"));

  Write(folder / "job.json", "{\"version\": 1}");
  const Outcome job = Patina({"bake", folder / "job.json"});
  EXPECT_EQ(job.exit_code, 3);
  EXPECT_THAT(job.err, HasSubstr("/asset"));
  EXPECT_FALSE(fs::exists(folder / "out"));
}

TEST(BadInput, ADamagedImageLeavesNothingBehind) {
  TempFolder folder;
  MakeSample(folder / "floor", 64);
  const std::string victim = folder / "floor/mosaic_floor_normal_gl.png";
  const auto size = fs::file_size(victim);
  for (const uintmax_t keep : {uintmax_t{0}, uintmax_t{20}, size / 2, size - 20}) {
    fs::resize_file(victim, keep);
    const Outcome outcome = Patina({"bake", folder / "floor", "--out", folder / "out"});
    EXPECT_EQ(outcome.exit_code, 3) << keep;
    EXPECT_THAT(outcome.err, HasSubstr("mosaic_floor_normal_gl.png")) << keep;
    EXPECT_FALSE(fs::exists(folder / "out/floor")) << keep;
  }
}

TEST(BadInput, RefusesNonFiniteTexelsUnlessToldToRepairThem) {
  TempFolder folder;
  fs::create_directories(folder / "hdr");
  std::vector<float> values(32 * 32 * 3);
  for (size_t i = 0; i < values.size(); ++i) values[i] = 0.01f * static_cast<float>(i % 97);
  values[3 * (32 * 5 + 7)] = std::numeric_limits<float>::quiet_NaN();
  ASSERT_TRUE(WriteImage(folder / "hdr/hdr_basecolor.exr", WriteFormat::kExrFloat, 32, 32, 3,
                         values.data()));
  const Outcome refused = Patina(Preview({"bake", folder / "hdr", "--out", folder / "out"}));
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_THAT(refused.err, HasSubstr("hdr_basecolor.exr"));
  EXPECT_THAT(refused.err, HasSubstr("--repair-nonfinite"));
  EXPECT_FALSE(fs::exists(folder / "out/hdr"));
  const Outcome repaired =
      Patina(Preview({"bake", folder / "hdr", "--out", folder / "out", "--repair-nonfinite"}));
  EXPECT_EQ(repaired.exit_code, 0) << repaired.err;
}

TEST(BadInput, InfoUnpackAndCompareRefuseADamagedContainer) {
  TempFolder folder;
  MakeSample(folder / "floor", 32);
  ASSERT_EQ(Patina(Preview({"bake", folder / "floor", "--out", folder / "out", "-q"})).exit_code,
            0);
  EXPECT_EQ(Patina({"info", folder / "nowhere"}).exit_code, 3);
  const std::string features = folder / "out/floor/current/features_1.dds";
  std::string bytes = ReadAll(features);
  bytes[200] = static_cast<char>(bytes[200] ^ 1);
  Write(features, bytes);
  const Outcome unpacked = Patina({"unpack", folder / "out/floor", "--out", folder / "maps"});
  EXPECT_EQ(unpacked.exit_code, 3);
  EXPECT_THAT(unpacked.err, HasSubstr("features_1.dds"));
  EXPECT_FALSE(fs::exists(folder / "maps"));
  EXPECT_EQ(Patina({"compare", folder / "out/floor", folder / "floor", "-q"}).exit_code, 3);
  Write(folder / "out/floor/current/manifest.json", "{");
  EXPECT_EQ(Patina({"info", folder / "out/floor"}).exit_code, 3);
}

// ---- what it leaves alone ----

TEST(Publish, AnUnwritableOutputFailsBeforeTheWork) {
  TempFolder folder;
  MakeSample(folder / "floor", 16);
  Write(folder / "file", "not a folder");
  const Outcome outcome =
      Patina({"bake", folder / "floor", "--out", folder / "file/out", "--quality", "reference"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr(folder / "file"));
}

TEST(Publish, AWriteThatFailsLeavesTheEarlierContainer) {
  TempFolder folder;
  MakeSample(folder / "floor", 64);
  ASSERT_EQ(Patina(Preview({"bake", folder / "floor", "--out", folder / "out", "-q"})).exit_code,
            0);
  const auto before = Snapshot(folder / "out");
  for (const uint64_t limit : {100u, 2000u, 20000u}) {
    // Quiet, because the limit holds for the file that catches the messages too.
    const Outcome outcome =
        Patina(Preview({"bake", folder / "floor", "--out", folder / "out", "--seed", "2", "-q"}),
               {.max_file_bytes = limit});
    EXPECT_EQ(outcome.exit_code, 1) << limit << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("patina: error: floor: ")) << limit;
    EXPECT_TRUE(Snapshot(folder / "out") == before) << limit;
  }
}

TEST(Publish, TheQualityGateKeepsTheEarlierContainer) {
  TempFolder folder;
  MakeSample(folder / "floor", 32);
  ASSERT_EQ(Patina(Preview({"bake", folder / "floor", "--out", folder / "out", "-q"})).exit_code,
            0);
  const auto before = Snapshot(folder / "out/floor/r0001");
  for (int round = 0; round < 2; ++round) {
    const Outcome outcome = Patina(
        Preview({"bake", folder / "floor", "--out", folder / "out", "--min-psnr", "90", "--json"}));
    EXPECT_EQ(outcome.exit_code, 4);
    EXPECT_THAT(outcome.err, HasSubstr("below the gate of 90.00 dB"));
    const Json json = LastLine(outcome.out);
    EXPECT_EQ(json["status"], "rejected");
    EXPECT_EQ(json["error"]["code"], "quality_gate");
    EXPECT_TRUE(CheckAgainstSchema("result", json));
    EXPECT_EQ(json["container"], folder / "out/floor/rejected");
  }
  EXPECT_TRUE(Snapshot(folder / "out/floor/r0001") == before);
  EXPECT_EQ(fs::read_symlink(folder / "out/floor/current"), "r0001");
  EXPECT_FALSE(fs::exists(folder / "out/floor/r0002"));
  EXPECT_FALSE(HasStaging(folder / "out"));
  EXPECT_EQ(Patina({"info", folder / "out/floor/rejected"}).exit_code, 0);
}

// ---- run ----

TEST(Run, WritesEventsAndAResult) {
  TempFolder folder;
  MakeSample(folder / "floor", 32);
  Json job = Json::parse(ReadAll(folder / "floor/job.json"));
  job["quality"] = "preview";
  Write(folder / "floor/job.json", job.dump());
  const Outcome outcome =
      Patina({"run", folder / "floor/job.json", "--events", folder / "events.ndjson", "-q"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(folder / "floor/baked/mosaic_floor/current/manifest.json"));
  const Json result = Json::parse(ReadAll(folder / "result.json"));
  EXPECT_TRUE(CheckAgainstSchema("result", result));
  EXPECT_EQ(result["status"], "done");

  std::istringstream lines(ReadAll(folder / "events.ndjson"));
  std::string line;
  std::vector<std::string> started, finished;
  Json last;
  while (std::getline(lines, line)) {
    last = Json::parse(line);
    const Status status = CheckAgainstSchema("events", last);
    EXPECT_TRUE(status) << status.error().message << "\n" << line;
    if (last["type"] == "stage_started") started.push_back(last["stage"]);
    if (last["type"] == "stage_finished") finished.push_back(last["stage"]);
  }
  EXPECT_EQ(started, (std::vector<std::string>{"ingest", "reference", "train", "package", "verify",
                                               "report", "publish"}));
  EXPECT_EQ(finished, started);
  EXPECT_EQ(last["type"], "result");
  EXPECT_EQ(last["result"], result);
}

TEST(Run, WritesAResultForAJobThatCannotBeRead) {
  TempFolder folder;
  Write(folder / "job.json", "{}");
  const Outcome outcome = Patina({"run", folder / "job.json", "--events", folder / "events.ndjson",
                                  "--result", folder / "r.json"});
  EXPECT_EQ(outcome.exit_code, 3);
  const Json result = Json::parse(ReadAll(folder / "r.json"));
  EXPECT_TRUE(CheckAgainstSchema("result", result));
  EXPECT_EQ(result["status"], "failed");
  EXPECT_EQ(result["error"]["code"], "invalid_argument");
  EXPECT_EQ(LastLine(ReadAll(folder / "events.ndjson"))["type"], "error");
}

TEST(Run, AnInterruptPublishesNothing) {
  TempFolder folder;
  MakeSample(folder / "floor", 32);
  Json job = Json::parse(ReadAll(folder / "floor/job.json"));
  job["quality"] = "preview";
  Write(folder / "floor/job.json", job.dump());
  ASSERT_EQ(Patina({"run", folder / "floor/job.json", "-q"}).exit_code, 0);
  const auto before = Snapshot(folder / "floor/baked");

  job["samples"] = 1e12;  // days of training
  Write(folder / "floor/job.json", job.dump());
  // The events go through a pipe, so that the test sees the training begin.
  const std::string pipe = folder / "events";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const int signal : {SIGINT, SIGTERM}) {
    Child child({"run", folder / "floor/job.json", "--events", pipe, "--result",
                 folder / "result.json", "-q"});
    std::ifstream events(pipe);
    std::string line;
    Json last;
    bool sent = false;
    while (std::getline(events, line)) {
      last = Json::parse(line);
      if (!sent && last["type"] == "progress" && last["stage"] == "train") {
        child.Signal(signal);
        sent = true;
      }
    }
    const Outcome outcome = child.Wait();
    ASSERT_TRUE(sent) << outcome.err;
    EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
    EXPECT_EQ(last["type"], "error");
    EXPECT_EQ(last["code"], "cancelled");
    const Json result = Json::parse(ReadAll(folder / "result.json"));
    EXPECT_EQ(result["status"], "cancelled");
    EXPECT_TRUE(CheckAgainstSchema("result", result));
    EXPECT_TRUE(Snapshot(folder / "floor/baked") == before);
  }
}

TEST(Run, ASecondBakeOfTheSameAssetIsRefusedWhileTheFirstRuns) {
  TempFolder folder;
  MakeSample(folder / "floor", 32);
  Json job = Json::parse(ReadAll(folder / "floor/job.json"));
  job["samples"] = 1e12;
  Write(folder / "floor/job.json", job.dump());
  const std::string pipe = folder / "events";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  Child child({"run", folder / "floor/job.json", "--events", pipe, "-q"});
  std::ifstream events(pipe);
  std::string line;
  bool tried = false;
  while (std::getline(events, line)) {
    const Json event = Json::parse(line);
    if (!tried && event["type"] == "stage_started" && event["stage"] == "train") {
      tried = true;
      const Outcome second =
          Patina({"run", folder / "floor/job.json", "--result", folder / "second.json"});
      EXPECT_EQ(second.exit_code, 1);
      EXPECT_THAT(second.err, HasSubstr("another bake"));
      child.Signal(SIGINT);
    }
  }
  EXPECT_TRUE(tried);
  EXPECT_EQ(child.Wait().exit_code, 130);
}

// ---- containers back ----

// A sample of 64 x 64 and its container, baked once. The tests only read them.
class Baked : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TempFolder;
    MakeSample(*shared_ / "floor");
    const Outcome baked =
        Patina(Preview({"bake", *shared_ / "floor", "--out", *shared_ / "out", "--json"}));
    ASSERT_EQ(baked.exit_code, 0) << baked.err;
    result_ = LastLine(baked.out);
  }
  static void TearDownTestSuite() { delete std::exchange(shared_, nullptr); }

  static std::string Source() { return *shared_ / "floor"; }
  static std::string Asset() { return *shared_ / "out/floor"; }
  static const Json& Measured() { return result_; }

 private:
  static inline TempFolder* shared_ = nullptr;
  static inline Json result_;
};

TEST_F(Baked, UnpacksToMapsThatTheContainerAgreesWith) {
  TempFolder folder;
  for (const char* format : {"png", "exr"}) {
    const std::string maps = folder / (std::string("maps_") + format);
    const Outcome unpacked = Patina({"unpack", Asset(), "--out", maps, "--format", format});
    ASSERT_EQ(unpacked.exit_code, 0) << unpacked.err;
    for (const char* role :
         {"albedo", "normal", "ao", "roughness", "metalness", "displacement", "emissive"}) {
      const std::string path = maps + "/" + role + "." + format;
      EXPECT_THAT(unpacked.out, HasSubstr(path));
      auto info = ReadImageInfo(path);
      ASSERT_TRUE(info) << path;
      EXPECT_EQ(info->width, 64);
      EXPECT_EQ(info->channels, std::string(role) == "albedo" || std::string(role) == "normal" ||
                                        std::string(role) == "emissive"
                                    ? 3
                                    : 1);
      if (std::string(format) == "png") {
        const bool wide = std::string(role) == "normal" || std::string(role) == "displacement";
        EXPECT_EQ(info->type, wide ? SampleType::kUint16 : SampleType::kUint8) << role;
      }
    }
  }
  // Only the rounding to 8 bits lies between the container and its own maps.
  const Outcome compared = Patina({"compare", Asset(), folder / "maps_png", "--json", "-q"});
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  const Json json = LastLine(compared.out);
  EXPECT_GT(json["psnr"]["mip0"], 55) << json;
  EXPECT_GT(json["psnr"]["maps"].size(), 6u);
  EXPECT_EQ(json["same_source"], false);
  EXPECT_TRUE(json["not_compared"].empty());
}

TEST_F(Baked, KnowsTheMipsThereAre) {
  TempFolder folder;
  ASSERT_EQ(Patina({"unpack", Asset(), "--out", folder / "maps", "--mip", "6"}).exit_code, 0);
  auto info = ReadImageInfo(folder / "maps/albedo.png");
  ASSERT_TRUE(info);
  EXPECT_EQ(info->width, 1);
  const Outcome beyond = Patina({"unpack", Asset(), "--out", folder / "maps", "--mip", "7"});
  EXPECT_EQ(beyond.exit_code, 3);
  EXPECT_THAT(beyond.err, HasSubstr("0 to 6"));
}

TEST_F(Baked, ComparesAsItWasMeasured) {
  TempFolder folder;
  const Json& expected = Measured();
  const Outcome compared = Patina({"compare", Asset(), Source(), "--json"});
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  const Json json = LastLine(compared.out);
  EXPECT_EQ(json["psnr"], expected["psnr"]);
  EXPECT_EQ(json["ssim"], expected["ssim"]);
  EXPECT_EQ(json["flip"], expected["flip"]);
  EXPECT_EQ(json["same_source"], true);
  MakeSample(folder / "other", 32);
  const Outcome other = Patina({"compare", Asset(), folder / "other"});
  EXPECT_EQ(other.exit_code, 3);
  EXPECT_THAT(other.err, HasSubstr("64 x 64"));
}

TEST_F(Baked, DescribesItself) {
  TempFolder folder;
  const Outcome text = Patina({"info", Asset()});
  EXPECT_EQ(text.exit_code, 0);
  for (const char* word :
       {"64 x 64", "bcf-1k", "albedo", "features_0.dds", "mosaic_floor_arm.png", "r0001"}) {
    EXPECT_THAT(text.out, HasSubstr(word));
  }
  const Json json = LastLine(Patina({"info", Asset() + "/current", "--json"}).out);
  EXPECT_EQ(json["manifest"], Json::parse(ReadAll(Asset() + "/current/manifest.json")));
  EXPECT_GT(json["bytes"], 1000);
}

TEST(Sample, IsTheSameForASeed) {
  TempFolder folder;
  ASSERT_EQ(Patina({"sample", "--kind", "material", "--out", folder / "a", "--size", "32",
                    "--threads", "1"})
                .exit_code,
            0);
  ASSERT_EQ(Patina({"sample", "--kind", "material", "--out", folder / "b", "--size", "32",
                    "--threads", "2"})
                .exit_code,
            0);
  ASSERT_EQ(
      Patina({"sample", "--kind", "material", "--out", folder / "c", "--size", "32", "--seed", "2"})
          .exit_code,
      0);
  EXPECT_TRUE(Snapshot(folder / "a") == Snapshot(folder / "b"));
  EXPECT_FALSE(Snapshot(folder / "a") == Snapshot(folder / "c"));
}

}  // namespace
}  // namespace patina
