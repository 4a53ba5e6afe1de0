#include "daemon/config/config.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "daemon/config/config_paths.h"
#include "formats/schema_check.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

using nlohmann::json;

class ConfigTest : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"drop", "drop2", "out"})
      std::filesystem::create_directories(folder_ / name);
    std::ofstream(folder_ / "worker") << "#!/bin/sh\n";
    ::chmod((folder_ / "worker").c_str(), 0755);
    flags_.out = folder_ / "out";
    flags_.worker = folder_ / "worker";
    flags_.state_dir = folder_ / "state";
  }

  LoadedConfig Load(const json& file) {
    std::ofstream(folder_ / "config.json") << file;
    return LoadConfig(folder_ / "config.json", environment_, flags_);
  }
  LoadedConfig Load() { return LoadConfig("", environment_, flags_); }

  static std::string Problems(const LoadedConfig& loaded) {
    std::string text;
    for (const ConfigProblem& problem : loaded.problems)
      text += problem.where + ": " + problem.message + "\n";
    return text;
  }
  static bool Has(const LoadedConfig& loaded, const std::string& where, const std::string& what) {
    return std::any_of(loaded.problems.begin(), loaded.problems.end(), [&](const auto& problem) {
      return problem.where.find(where) != std::string::npos &&
             problem.message.find(what) != std::string::npos;
    });
  }

  patina::test::TemporaryDirectory folder_;
  std::vector<std::string> environment_;
  ConfigOverrides flags_;
};

TEST_F(ConfigTest, NeedsLittle) {
  flags_.watch = {folder_ / "drop/"};
  const LoadedConfig loaded = Load();
  EXPECT_EQ(Problems(loaded), "");
  const Config& c = loaded.config;
  EXPECT_EQ(c.out, folder_ / "out");
  ASSERT_EQ(c.watch.size(), 1u);
  EXPECT_EQ(c.watch[0].path, folder_ / "drop");
  EXPECT_EQ(c.api.socket, folder_ / "state/patinad.sock");
  EXPECT_GE(c.cores, 1);
  EXPECT_TRUE(c.api.listen_host.empty());
}

TEST_F(ConfigTest, FlagsComeOverTheEnvironmentAndThatOverTheFile) {
  const json file{{"version", 1}, {"cores", 1}, {"log", {{"level", "error"}}}, {"nice", 3}};
  environment_ = {"PATINA_CORES=2", "PATINA_LOG_LEVEL=debug", "HOME=/nowhere"};
  EXPECT_EQ(Load(file).config.cores, 2);
  flags_.cores = "1";
  const LoadedConfig loaded = Load(file);
  EXPECT_EQ(Problems(loaded), "");
  EXPECT_EQ(loaded.config.cores, 1);
  EXPECT_EQ(loaded.config.log_level, LogLevel::kDebug);
  EXPECT_EQ(loaded.config.nice, 3);
}

TEST_F(ConfigTest, NamesAFarm) {
  const LoadedConfig loaded = Load({{"version", 1},
                                    {"cores", 500},
                                    {"executor",
                                     {{"kind", "slurm"},
                                      {"jobs", 1000},
                                      {"shared_dir", "shared"},
                                      {"poll_s", 0.5},
                                      {"partition", "p"},
                                      {"sbatch_arguments", {"--constraint=avx2"}}}}});
  EXPECT_EQ(Problems(loaded), "");
  EXPECT_TRUE(loaded.warnings.empty()) << "a node may have more cores than this machine";
  const ExecutorConfig& executor = loaded.config.executor;
  EXPECT_TRUE(OnFarm(loaded.config));
  EXPECT_EQ(executor.jobs, 1000);
  EXPECT_EQ(executor.poll_s, 0.5);
  EXPECT_EQ(WorkFolderOf(loaded.config), folder_ / "shared");
  EXPECT_EQ(UploadFolderOf(loaded.config), folder_ / "shared/uploads");
  // What is printed can be read again.
  const json printed = json::parse(ConfigToJson(loaded.config));
  const LoadedConfig again = Load(printed);
  EXPECT_EQ(Problems(again), "");
  EXPECT_EQ(again.config.executor.sbatch_arguments, executor.sbatch_arguments);
  EXPECT_EQ(json::parse(ConfigToJson(again.config)), printed);
  EXPECT_FALSE(OnFarm(Load().config));
  EXPECT_EQ(RestartOnlyChanges(loaded.config, again.config), std::vector<std::string>());
}

TEST_F(ConfigTest, TellsWhatIsWrongWithAFarm) {
  LoadedConfig loaded = Load({{"version", 1},
                              {"sandbox", "require"},
                              {"executor",
                               {{"kind", "command"},
                                {"partition", "p"},
                                {"submit", {"qsub", "{script}"}},
                                {"status", {"qstat", "{ids}"}}}}});
  EXPECT_TRUE(Has(loaded, "/executor/partition", "is for the kind \"slurm\"")) << Problems(loaded);
  EXPECT_TRUE(Has(loaded, "/executor/cancel", "is missing")) << Problems(loaded);
  EXPECT_TRUE(Has(loaded, "/sandbox", "no sandbox")) << Problems(loaded);
  EXPECT_EQ(loaded.problems.size(), 3u) << Problems(loaded);
  loaded = Load({{"version", 1}, {"executor", {{"kind", "pbs"}, {"jobs", 0}, {"submit", "qsub"}}}});
  for (const char* where : {"/executor/kind", "/executor/jobs", "/executor/submit"})
    EXPECT_TRUE(Has(loaded, where, "")) << where << "\n" << Problems(loaded);
  loaded = Load({{"version", 1}, {"executor", {{"kind", "local"}, {"shared_dir", "x"}}}});
  EXPECT_TRUE(Has(loaded, "/executor/shared_dir", "is for farms")) << Problems(loaded);
}

TEST_F(ConfigTest, PathsOfTheFileAreRelativeToIt) {
  flags_.out.reset();
  const LoadedConfig loaded =
      Load({{"version", 1}, {"out", "x/../out"}, {"watch", {{{"path", "drop"}}}}});
  EXPECT_EQ(Problems(loaded), "");
  EXPECT_EQ(loaded.config.out, folder_ / "out");
  EXPECT_EQ(loaded.config.watch[0].path, folder_ / "drop");
}

TEST_F(ConfigTest, TellsEverythingThatIsWrong) {
  flags_ = {};
  flags_.cores = "many";
  environment_ = {"PATINA_LISTEN=0.0.0.0:80"};
  const LoadedConfig loaded =
      Load({{"version", 2},
            {"nonsense", true},
            {"watch", {{{"path", "missing"}}, {{"path", "out/inner"}, {"mode", "psychic"}}}},
            {"out", "out"},
            {"state_dir", "state"},
            {"worker", "no worker"},
            {"nice", 40},
            {"retry", {{"base_ms", 1000}, {"max_ms", 10}, {"jitter", 2}}},
            {"limits", {{"memory_mb", 100}, {"max_memory_mb", 50}, {"wall_s", "long"}}}});
  const std::string all = Problems(loaded);
  for (const auto& [where, what] :
       std::vector<std::pair<std::string, std::string>>{{"/version", ""},
                                                        {"config.json", ""},
                                                        {"/watch/1/mode", ""},
                                                        {"/nice", ""},
                                                        {"/retry/jitter", ""},
                                                        {"/limits/wall_s", ""},
                                                        {"--cores", "whole number"},
                                                        {"PATINA_LISTEN", "loopback"},
                                                        {"/watch/0/path", "not a folder"},
                                                        {"/worker", "no worker"},
                                                        {"/retry/base_ms", "max_ms"},
                                                        {"/limits/max_memory_mb", "memory_mb"}}) {
    EXPECT_TRUE(Has(loaded, where, what)) << where << " " << what << "\n" << all;
  }
}

TEST_F(ConfigTest, RefusesFoldersThatLieInEachOther) {
  std::filesystem::create_directories(folder_ / "drop/inner");
  std::filesystem::create_directories(folder_ / "out/drop");
  flags_.watch = {folder_ / "drop", folder_ / "drop/inner"};
  EXPECT_TRUE(Has(Load(), "--watch", "watched as well"));
  flags_.watch = {folder_ / "drop", folder_ / "drop"};
  EXPECT_TRUE(Has(Load(), "--watch", "watched as well"));
  flags_.watch = {folder_ / "out/drop"};
  EXPECT_TRUE(Has(Load(), "--watch", "keep them apart"));
  flags_.watch = {folder_ / "drop"};
  flags_.state_dir = folder_ / "drop/state";
  EXPECT_TRUE(Has(Load(), "--state", "keep them apart"));
  // Containers within the drop folder are passed over by the watcher.
  flags_.state_dir = folder_ / "state";
  flags_.out = folder_ / "drop/out";
  EXPECT_EQ(Problems(Load()), "");
}

TEST_F(ConfigTest, WithoutATokenFileTheStateFolderHasOne) {
  flags_.listen = "127.0.0.1:7420";
  const LoadedConfig loaded = Load();
  EXPECT_EQ(Problems(loaded), "");
  EXPECT_EQ(loaded.config.api.token_file, loaded.config.state_dir + "/token");
  EXPECT_TRUE(loaded.config.api.makes_token);
}

TEST_F(ConfigTest, ATokenFileThatIsNamedMustBeOneThatOthersCannotRead) {
  flags_.listen = "127.0.0.1:7420";
  flags_.token_file = folder_ / "token";
  EXPECT_TRUE(Has(Load(), "--token-file", "cannot open"));
  std::ofstream(folder_ / "token") << "short\n";
  ::chmod((folder_ / "token").c_str(), 0644);
  EXPECT_TRUE(Has(Load(), "--token-file", "chmod 600"));
  ::chmod((folder_ / "token").c_str(), 0600);
  EXPECT_TRUE(Has(Load(), "--token-file", "16 characters"));
  std::ofstream(folder_ / "token") << "0123456789abcdef0123456789abcdef\n";
  const LoadedConfig loaded = Load();
  EXPECT_EQ(Problems(loaded), "");
  EXPECT_EQ(loaded.config.api.listen_host, "127.0.0.1");
  EXPECT_EQ(loaded.config.api.listen_port, 7420);
  for (const char* listen : {"[::1]:1", "localhost:0", "127.9.9.9:65535"}) {
    flags_.listen = listen;
    EXPECT_EQ(Problems(Load()), "") << listen;
  }
  for (const char* listen : {"", "7420", "::1:x", "10.0.0.1:1", "127.0.0.1:65536",
                             "127.0.0.1:", "example.org:80", "127.0.0.1:-1"}) {
    flags_.listen = listen;
    EXPECT_FALSE(Load().problems.empty()) << listen;
  }
}

TEST_F(ConfigTest, WarnsOfVariablesThatItDoesNotKnow) {
  environment_ = {"PATINA_WACTH=/x", "PATINA_SIMD=avx2", "OTHER=1"};
  const LoadedConfig loaded = Load();
  EXPECT_EQ(Problems(loaded), "");
  ASSERT_EQ(loaded.warnings.size(), 1u);
  EXPECT_EQ(loaded.warnings[0].where, "PATINA_WACTH");
}

TEST_F(ConfigTest, FilesThatAreNoConfigurationAreProblems) {
  for (const char* text : {"", "[]", "{", "null", "{\"version\": 1} x",
                           "{\"version\": 1, \"cores\": 1, \"cores\": 2}"}) {
    std::ofstream(folder_ / "c") << text;
    EXPECT_FALSE(LoadConfig(folder_ / "c", {}, flags_).problems.empty()) << text;
  }
  EXPECT_FALSE(LoadConfig(folder_ / "missing", {}, flags_).problems.empty());
  std::ofstream(folder_ / "big") << std::string(kMaxConfigBytes + 1, ' ');
  EXPECT_FALSE(LoadConfig(folder_ / "big", {}, flags_).problems.empty());
  std::ofstream(folder_ / "deep") << std::string(100000, '[');
  EXPECT_FALSE(LoadConfig(folder_ / "deep", {}, flags_).problems.empty());
}

TEST_F(ConfigTest, NamesThatAreTooLongForASocketAreProblems) {
  flags_.socket = folder_ / std::string(120, 's');
  EXPECT_TRUE(Has(Load(), "--socket", "longer than"));
}

TEST_F(ConfigTest, WhatIsPrintedIsReadBackTheSame) {
  flags_.watch = {folder_ / "drop", folder_ / "drop2"};
  Config config = Load().config;
  config.watch[1].mode = WatchMode::kPolling;
  config.watch[1].settle_ms = 77;
  config.watch[1].as_svbrdf = true;
  config.failed_dir = folder_ / "failed";
  config.input_roots = {folder_ / "in"};
  config.job.quality = Quality::kReference;
  config.limits = {1, 2, 3, 4, 5, 6};
  config.retry = {7, 8, 9, 0.25};
  config.retention = {10, 11, 12, 130};
  config.sandbox = SandboxMode::kRequire;
  config.log_format = LogFormat::kText;
  const json printed = json::parse(ConfigToJson(config));
  EXPECT_TRUE(FindSchemaProblems("config", printed)->empty());
  flags_ = {};
  const LoadedConfig again = Load(printed);
  EXPECT_EQ(Problems(again), "");
  EXPECT_EQ(ConfigToJson(again.config), ConfigToJson(config));
}

TEST_F(ConfigTest, SaysWhatBecomesOfSets) {
  const json file = {
      {"version", 1},
      {"watch", {{{"path", folder_ / "drop"}}, {{"path", folder_ / "drop2"}, {"as", "svbrdf"}}}}};
  const LoadedConfig loaded = Load(file);
  EXPECT_EQ(Problems(loaded), "");
  ASSERT_EQ(loaded.config.watch.size(), 2u);
  EXPECT_FALSE(loaded.config.watch[0].as_svbrdf);
  EXPECT_TRUE(loaded.config.watch[1].as_svbrdf);
  json wrong = file;
  wrong["watch"][0]["as"] = "brdf";
  EXPECT_TRUE(Has(Load(wrong), "/watch/0/as", "enum")) << Problems(Load(wrong));
}

TEST_F(ConfigTest, KnowsWhatNeedsARestart) {
  const Config before = Load().config;
  Config after = before;
  after.limits.wall_s = 5;
  after.cores = 1;
  EXPECT_TRUE(RestartOnlyChanges(before, after).empty());
  after.out = "/elsewhere";
  after.api.max_event_clients = 1;
  EXPECT_EQ(RestartOnlyChanges(before, after), (std::vector<std::string>{"out", "api"}));
}

TEST(ConfigSchema, ItsDefaultsAreThoseOfTheProgram) {
  const json schema = json::parse(*SchemaText("config"));
  const json printed = json::parse(ConfigToJson(Config()));
  for (const char* group : {"job", "api", "limits", "retry", "retention", "log"}) {
    for (const auto& [key, property] : schema["properties"][group]["properties"].items()) {
      if (property.contains("default")) {
        EXPECT_EQ(property["default"], printed[group][key]) << group << "/" << key;
      }
    }
  }
  for (const char* key : {"cores", "nice", "sandbox", "stop_grace_s"})
    EXPECT_EQ(schema["properties"][key]["default"], printed[key]) << key;
}

TEST(ConfigPaths, AreMadeAbsolute) {
  EXPECT_EQ(AbsolutePath("/a/./b/../c/", ""), "/a/c");
  EXPECT_EQ(AbsolutePath("c", "/a/b"), "/a/b/c");
  EXPECT_EQ(AbsolutePath("..", "/a/b"), "/a");
  EXPECT_EQ(AbsolutePath("/", ""), "/");
}

}  // namespace
}  // namespace patina::daemon
