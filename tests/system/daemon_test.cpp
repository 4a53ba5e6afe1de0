// The real patinad with the real `patina run`.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "tests/formats/test_support.h"
#include "tests/system/child_process.h"
#include "tests/system/daemon_process.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using testing_support::DaemonProcess;
using testing_support::Patina;
using testing_support::ReadAll;
using testing_support::Snapshot;

class DaemonTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "drop");
    std::ofstream(folder_ / "config.json") << R"({"version": 1, "stop_grace_s": 60,
      "watch": [{"path": "drop", "settle_ms": 50}], "retry": {"base_ms": 1, "max_ms": 1}})";
  }

  std::vector<std::string> Arguments() const {
    return {"--config", folder_ / "config.json", "--out",        folder_ / "out",
            "--state",  folder_ / "state",       "--log-format", "text"};
  }
  std::unique_ptr<DaemonProcess> Start(const std::vector<std::string>& environment = {}) {
    return std::make_unique<DaemonProcess>("patinad", Arguments(), folder_ / "log", environment);
  }
  std::string Log() const { return ReadAll(folder_ / "log"); }
  static size_t Count(const std::string& text, const std::string& part) {
    size_t count = 0;
    for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
      ++count;
    return count;
  }

  // Looks again every few milliseconds, for a minute at most.
  void Until(DaemonProcess* daemon, const std::function<bool()>& condition) {
    for (int i = 0; i < 6000 && !condition(); ++i)
      ASSERT_FALSE(daemon->Ended(10)) << "the daemon ended: " << Log();
    ASSERT_TRUE(condition()) << Log();
  }
  void Stop(DaemonProcess* daemon) {
    daemon->Signal(SIGTERM);
    ASSERT_TRUE(daemon->Ended(60000)) << Log();
    EXPECT_EQ(daemon->exit_code(), 0) << Log();
  }

  // A texture set in the drop folder, as a copy would put it there.
  void Drop(const std::string& asset, int seed) {
    const std::string sample = folder_ / ("sample" + std::to_string(seed));
    ASSERT_EQ(Patina({"sample", "--out", sample, "--size", "32", "--kind", "material", "--seed",
                      std::to_string(seed)})
                  .exit_code,
              0);
    fs::remove(sample + "/job.json");
    fs::copy(sample, folder_ / ("drop/" + asset),
             fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  }

  patina::test::TemporaryDirectory folder_;
};

// A configuration with a table beside it, which the sandbox must let through too.
void WriteColorConfig(const std::string& folder) {
  fs::create_directories(folder + "/luts");
  std::ofstream(folder + "/config.ocio") << R"(ocio_profile_version: 2
search_path: luts
roles: {aces_interchange: ap0, default: ap0}
displays:
  sRGB:
    - !<View> {name: Raw, colorspace: ap0}
colorspaces:
  - !<ColorSpace>
    name: ap0
  - !<ColorSpace>
    name: tabled
    to_scene_reference: !<FileTransform> {src: table.spi1d, interpolation: linear}
)";
  std::ofstream(folder + "/luts/table.spi1d")
      << "Version 1\nFrom 0.0 1.0\nLength 3\nComponents 1\n{\n0.0\n0.25\n1.0\n}\n";
}

TEST_F(DaemonTest, ColourConfigurationsAreTheOperatorsOrLieInTheInputFolders) {
  WriteColorConfig(folder_ / "studio");
  auto daemon = Start({"OCIO=" + (folder_ / "studio/config.ocio")});
  Drop("floor", 1);
  const std::string manifest = folder_ / "out/floor/current/manifest.json";
  Until(daemon.get(), [&] { return fs::exists(manifest); });
  EXPECT_NE(ReadAll(manifest).find("\"source\": \"environment\""), std::string::npos);
  // Named by a job: within the input folders, with its table.
  WriteColorConfig(folder_ / "drop/floor/colors");
  const std::vector<std::string> submit{"submit",
                                        folder_ / "drop/floor",
                                        "--wait",
                                        "--socket",
                                        folder_ / "state/patinad.sock",
                                        "--color-space",
                                        "tabled",
                                        "--working-space",
                                        "acescg",
                                        "--ocio"};
  std::vector<std::string> inside = submit, outside = submit;
  inside.push_back(folder_ / "drop/floor/colors/config.ocio");
  outside.push_back(folder_ / "studio/config.ocio");
  const auto done = Patina(inside);
  EXPECT_EQ(done.exit_code, 0) << done.err << Log();
  const std::string text = ReadAll(manifest);
  EXPECT_NE(text.find("\"source\": \"file\""), std::string::npos);
  EXPECT_NE(text.find("\"color_space\": \"tabled\""), std::string::npos);
  EXPECT_NE(text.find("\"working_space\": \"acescg\""), std::string::npos);
  const auto refused = Patina(outside);
  EXPECT_EQ(refused.exit_code, 3) << refused.err;
  EXPECT_NE(refused.err.find("/ocio"), std::string::npos) << refused.err;
  Stop(daemon.get());
}

TEST_F(DaemonTest, BakesWhatIsDroppedAsTheCommandDoesAndOnlyOnce) {
  auto daemon = Start();
  Drop("floor", 1);
  std::ofstream(folder_ / "drop/bad.bsdf") << "junk";
  Until(daemon.get(), [&] {
    return fs::exists(folder_ / "out/floor/current/manifest.json") &&
           fs::exists(folder_ / "drop/bad.failed.json");
  });
  EXPECT_NE(ReadAll(folder_ / "drop/bad.failed.json").find("truncated"), std::string::npos);
  // Another attempt may just be at work, if the file was seen half written.
  Until(daemon.get(), [&] { return !fs::exists(folder_ / "out/bad"); });
  Stop(daemon.get());

  ASSERT_EQ(Patina({"bake", folder_ / "drop/floor", "--out", folder_ / "direct"}).exit_code, 0);
  EXPECT_EQ(Snapshot(folder_ / "out/floor/r0001"), Snapshot(folder_ / "direct/floor/r0001"));

  // A new daemon looks at both and starts nothing; touched files are looked into and found
  // unchanged; a changed map bakes its asset again.
  const size_t started = Count(Log(), "job_started");
  daemon = Start();
  Until(daemon.get(), [&] { return Count(Log(), "unchanged=true") >= 2; });
  EXPECT_EQ(Count(Log(), "job_started"), started) << Log();
  for (const auto& entry : fs::directory_iterator(folder_ / "drop/floor"))
    fs::last_write_time(entry.path(), fs::file_time_type::clock::now());
  Until(daemon.get(), [&] { return Count(Log(), "state=succeeded") == 2; });
  EXPECT_FALSE(fs::exists(folder_ / "out/floor/r0002")) << Log();
  Drop("floor", 2);
  Until(daemon.get(), [&] { return fs::exists(folder_ / "out/floor/r0002/manifest.json"); });
  Until(daemon.get(), [&] { return Count(Log(), "state=succeeded") >= 3; });
  Stop(daemon.get());
  EXPECT_EQ(fs::read_symlink(folder_ / "out/floor/current"), "r0002");
}

TEST_F(DaemonTest, BakesEveryMaterialOfAFolder) {
  Drop("set", 1);
  for (const char* maps : {"basecolor", "normal_gl"}) {
    const std::string stem = folder_ / "drop/set/";
    fs::copy(stem + "mosaic_floor_" + maps + ".png", stem + "wall_" + maps + ".png");
  }
  auto daemon = Start();
  Until(daemon.get(), [&] {
    return fs::exists(folder_ / "out/set_mosaic_floor/current/manifest.json") &&
           fs::exists(folder_ / "out/set_wall/current/manifest.json");
  });
  Stop(daemon.get());
  EXPECT_FALSE(fs::exists(folder_ / "out/set"));
}

TEST_F(DaemonTest, BakesTheMaterialsOfASceneAndNotItsTextures) {
  Drop("car", 1);
  std::ofstream(folder_ / "drop/car/car.gltf") << R"({
    "asset": {"version": "2.0"},
    "materials": [{"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
                  {"name": "chrome"},
                  {"name": "broken", "normalTexture": {"index": 7}}],
    "textures": [{"source": 0}], "images": [{"uri": "mosaic_floor_basecolor.png"}]})";
  auto daemon = Start();
  Until(daemon.get(), [&] {
    return fs::exists(folder_ / "out/car_car_paint/current/manifest.json") &&
           fs::exists(folder_ / "out/car_car_chrome/current/manifest.json") &&
           fs::exists(folder_ / "drop/car_car_broken.failed.json");
  });
  Stop(daemon.get());
  EXPECT_NE(ReadAll(folder_ / "drop/car_car_broken.failed.json").find("/textures/7"),
            std::string::npos);
  std::vector<std::string> assets;
  for (const auto& entry : fs::directory_iterator(folder_ / "out")) {
    if (fs::exists(entry.path() / "current")) assets.push_back(entry.path().filename().string());
  }
  std::sort(assets.begin(), assets.end());
  EXPECT_EQ(assets, (std::vector<std::string>{"car_car_chrome", "car_car_paint"})) << Log();
}

// With images beside the list and below it.
TEST_F(DaemonTest, BakesASetOfImages) {
  ASSERT_EQ(Patina({"sample", "--kind", "btf", "--out", folder_ / "bumps", "--size", "8",
                    "--images", "16"})
                .exit_code,
            0);
  nlohmann::json list = nlohmann::json::parse(ReadAll(folder_ / "bumps/bumps.btf.json"));
  fs::create_directories(folder_ / "bumps/tilted");
  const std::string last = list["images"].back()["file"];
  fs::rename(folder_ / ("bumps/" + last), folder_ / ("bumps/tilted/" + last));
  list["images"].back()["file"] = "tilted/" + last;
  std::ofstream(folder_ / "bumps/bumps.btf.json") << list.dump();
  fs::rename(folder_ / "bumps", folder_ / "drop/cloth");
  auto daemon = Start();
  Until(daemon.get(), [&] {
    return fs::exists(folder_ / "out/cloth/current/manifest.json") ||
           Log().find("state=failed") != std::string::npos;
  });
  // Whoever asks for it again asks for the same asset.
  const auto submitted = Patina(
      {"submit", folder_ / "drop/cloth", "--wait", "--socket", folder_ / "state/patinad.sock"});
  EXPECT_EQ(submitted.exit_code, 0) << submitted.err;
  EXPECT_NE(submitted.out.find(" cloth\n"), std::string::npos) << submitted.out;
  Stop(daemon.get());
  EXPECT_FALSE(fs::exists(folder_ / "out/bumps"));
  EXPECT_FALSE(fs::exists(folder_ / "out/cloth/r0002"));
  EXPECT_TRUE(fs::exists(folder_ / "out/cloth/current/features_0.dds")) << Log();
  EXPECT_EQ(Count(Log(), "state=failed"), 0u) << Log();
  EXPECT_EQ(Patina({"validate", folder_ / "out/cloth"}).exit_code, 0);
}

TEST_F(DaemonTest, BakesSetsOfAFolderAsReflectance) {
  std::ofstream(folder_ / "config.json") << R"({"version": 1, "job": {"quality": "preview"},
    "watch": [{"path": "drop", "settle_ms": 50, "as": "svbrdf"}]})";
  ASSERT_EQ(
      Patina({"sample", "--out", folder_ / "floor", "--size", "8", "--kind", "material"}).exit_code,
      0);
  fs::remove(folder_ / "floor/job.json");
  fs::rename(folder_ / "floor", folder_ / "drop/floor");
  auto daemon = Start();
  const std::string manifest = folder_ / "out/floor/current/manifest.json";
  Until(daemon.get(),
        [&] { return fs::exists(manifest) || Log().find("state=failed") != std::string::npos; });
  const std::string socket = folder_ / "state/patinad.sock";
  const auto status =
      nlohmann::json::parse(Patina({"status", "--json", "--socket", socket}).out, nullptr, false);
  EXPECT_EQ(status["watch"]["roots"][0]["as"], "svbrdf") << status;
  Stop(daemon.get());
  ASSERT_TRUE(fs::exists(manifest)) << Log();
  EXPECT_EQ(nlohmann::json::parse(ReadAll(manifest))["kind"], "svbrdf");
}

// They take half a second and 60 MB, and one of them starts threads that signals would go to.
TEST_F(DaemonTest, LoadsNoImageLibraries) {
  const auto daemon = Start();
  Until(daemon.get(), [&] { return Log().find("ready") != std::string::npos; });
  const std::string maps = ReadAll("/proc/" + std::to_string(daemon->pid()) + "/maps");
  EXPECT_NE(maps.find("libsqlite3"), std::string::npos);
  EXPECT_EQ(maps.find("libOpenImageIO"), std::string::npos);
  EXPECT_EQ(maps.find("libOpenColorIO"), std::string::npos);
  Stop(daemon.get());
}

TEST_F(DaemonTest, ASecondOneOnTheSameStateRefusesAndSaysWhoHasIt) {
  auto daemon = Start();
  Until(daemon.get(), [&] { return Count(Log(), " ready ") == 1; });
  DaemonProcess second("patinad", Arguments(), folder_ / "log2");
  ASSERT_TRUE(second.Ended(60000));
  EXPECT_EQ(second.exit_code(), 1);
  EXPECT_NE(ReadAll(folder_ / "log2").find("process \\\"" + std::to_string(daemon->pid())),
            std::string::npos)
      << ReadAll(folder_ / "log2");
  Stop(daemon.get());
}

TEST_F(DaemonTest, HandsBackWhatDoesNotEndInTimeAndTheNextOneFinishesIt) {
  std::ofstream(folder_ / "config.json") << R"({"version": 1, "stop_grace_s": 0,
    "watch": [{"path": "drop", "settle_ms": 50}], "job": {"quality": "reference"}})";
  auto daemon = Start();
  Drop("floor", 1);
  Until(daemon.get(), [&] { return Count(Log(), "job_started") == 1; });
  Stop(daemon.get());
  const bool finished = fs::exists(folder_ / "out/floor/current");
  daemon = Start();
  // Where the first one finished it, nothing below waits for this one, which a signal would end
  // before it listens to any.
  Until(daemon.get(), [&] { return Count(Log(), "info ready") == 2; });
  Until(daemon.get(), [&] { return fs::exists(folder_ / "out/floor/current/manifest.json"); });
  Until(daemon.get(), [&] { return Count(Log(), "state=succeeded") == 1; });
  EXPECT_EQ(Count(Log(), "job_started"), finished ? 1u : 2u) << Log();
  EXPECT_FALSE(fs::exists(folder_ / "out/floor/r0002"));
  Stop(daemon.get());
}

TEST_F(DaemonTest, TellsTheServiceManagerAndReadsItsConfigurationAgain) {
  const int fd = ::socket(AF_UNIX, SOCK_DGRAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = folder_ / "notify";
  std::memcpy(address.sun_path, path.data(), path.size());
  ASSERT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  const auto message = [fd] {
    pollfd ready{fd, POLLIN, 0};
    char text[256];
    ssize_t n = 0;
    if (::poll(&ready, 1, 60000) == 1) n = ::recv(fd, text, sizeof text, 0);
    return std::string(text, static_cast<size_t>(n > 0 ? n : 0));
  };
  auto daemon = Start({"NOTIFY_SOCKET=" + path});
  EXPECT_EQ(message(), "READY=1");
  std::ofstream(folder_ / "config.json") << R"({"version": 1, "cores": -1})";
  daemon->Signal(SIGHUP);
  EXPECT_EQ(message().rfind("RELOADING=1\n", 0), 0u);
  EXPECT_EQ(message(), "READY=1");
  EXPECT_NE(Log().find("config_problem"), std::string::npos);
  std::ofstream(folder_ / "config.json") << R"({"version": 1, "limits": {"wall_s": 7}})";
  daemon->Signal(SIGHUP);
  EXPECT_EQ(message().rfind("RELOADING=1\n", 0), 0u);
  EXPECT_EQ(message(), "READY=1");
  EXPECT_NE(Log().find("reloaded"), std::string::npos);
  EXPECT_NE(Log().find("config_needs_restart setting=watch"), std::string::npos) << Log();
  daemon->Signal(SIGTERM);
  EXPECT_EQ(message(), "STOPPING=1");
  ASSERT_TRUE(daemon->Ended(60000));
  EXPECT_EQ(daemon->exit_code(), 0);
  ::close(fd);
}

TEST_F(DaemonTest, CommandLineHasTheExitCodesOfTheProgram) {
  const auto run = [&](const std::vector<std::string>& arguments,
                       const std::vector<std::string>& environment = {}) {
    fs::remove(folder_ / "said");
    DaemonProcess process("patinad", arguments, folder_ / "said", environment);
    EXPECT_TRUE(process.Ended(60000));
    return process.exit_code();
  };
  EXPECT_EQ(run({"--help"}), 0);
  EXPECT_NE(ReadAll(folder_ / "said").find("--watch DIR"), std::string::npos);
  EXPECT_EQ(run({"--version"}), 0);
  EXPECT_EQ(run({"--frobnicate"}), 2);
  EXPECT_EQ(run({"--out"}), 2);
  EXPECT_EQ(run({"stray"}), 2);
  EXPECT_EQ(run({"--check-config", "--out", folder_ / "o", "--state", folder_ / "s"}), 0);
  EXPECT_EQ(run({"--check-config", "--watch", folder_ / "none", "--listen", "1.2.3.4:5", "--cores",
                 "x", "--state", folder_ / "s"}),
            3);
  for (const char* what : {"--watch", "--listen", "--cores", "/out", "4 problems"})
    EXPECT_NE(ReadAll(folder_ / "said").find(what), std::string::npos) << what;
  EXPECT_EQ(run({"--config", folder_ / "none"}), 3);
  // A farm whose programs are not here: unlike one that does not answer, this stays so.
  std::ofstream(folder_ / "farm.json") << R"({"version": 1, "executor": {"kind": "slurm"}})";
  EXPECT_EQ(run({"--check-config", "--config", folder_ / "farm.json", "--out", folder_ / "o",
                 "--state", folder_ / "s"},
                {"PATH=" + (folder_ / "nothing")}),
            3);
  EXPECT_NE(ReadAll(folder_ / "said").find("cannot run sbatch"), std::string::npos);
}

}  // namespace
}  // namespace patina
