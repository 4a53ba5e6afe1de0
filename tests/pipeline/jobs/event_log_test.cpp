#include "pipeline/jobs/event_log.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "formats/base/file_io.h"
#include "formats/schema_check.h"

namespace patina {
namespace {

using Json = nlohmann::json;

JobResult Done() {
  JobResult result;
  result.asset = "floor";
  result.container = "out/floor/1";
  result.revision = "1";
  result.fingerprint = std::string(64, 'a');
  result.profile = "bcf-1k";
  result.quality = "preview";
  result.recipe = "patina";
  result.seed = 1;
  result.seconds = 1.5;
  result.cpu_seconds = 2.5;
  result.samples = 1e6;
  result.stopped_by = "budget";
  result.bytes = 1000;
  result.psnr = PsnrSummary{31.5, 30, 36, {{"albedo", 29}, {"normal", 33}}};
  result.ssim = 0.9;
  result.warnings = {"a warning", "bad utf-8: \xFF"};
  return result;
}

JobResult Failed(int exit_code) {
  JobResult result;
  result.asset = "floor";
  result.exit_code = exit_code;
  result.error = Error{ErrorCode::kNotFound, "no map in \"floor\"\nlook again"};
  result.error_stage = "ingest";
  return result;
}

TEST(JobResultToJson, FollowsItsSchema) {
  for (const JobResult& result :
       {Done(), Failed(kExitBadInput), Failed(kExitFailed), Failed(kExitQualityGate),
        Failed(kExitInterrupted), JobResult{}}) {
    const std::string line = JobResultToJson(result, -1);
    EXPECT_EQ(line.find('\n'), std::string::npos);
    const Status status = CheckAgainstSchema("result", Json::parse(line));
    EXPECT_TRUE(status) << status.error().message << "\n" << line;
  }
  const Json json = Json::parse(JobResultToJson(Done(), 2));
  EXPECT_EQ(json["psnr"]["maps"]["normal"], 33);
  EXPECT_TRUE(json["flip"].is_null());
  EXPECT_EQ(Json::parse(JobResultToJson(Failed(kExitQualityGate), -1))["error"]["code"],
            "quality_gate");
}

TEST(ExitCodeFor, TellsBadInputFromOtherFailures) {
  EXPECT_EQ(ExitCodeFor({ErrorCode::kCorruptData, ""}, true), kExitBadInput);
  EXPECT_EQ(ExitCodeFor({ErrorCode::kCorruptData, ""}, false), kExitFailed);
  EXPECT_EQ(ExitCodeFor({ErrorCode::kResourceExhausted, ""}, true), kExitFailed);
  EXPECT_EQ(ExitCodeFor({ErrorCode::kCancelled, ""}, true), kExitInterrupted);
  EXPECT_EQ(ExitCodeFor({ErrorCode::kCancelled, ""}, false), kExitInterrupted);
}

TEST(EventLog, WritesLinesThatFollowTheirSchema) {
  const std::string path = testing::TempDir() + "patina_events.ndjson";
  {
    auto log = EventLog::Open(path);
    ASSERT_TRUE(log);
    log->OnStageStarted("ingest");
    log->OnNote("guessed", "a.png: albedo");
    log->OnWarning("odd \"file\" \xFF");
    log->OnStageFinished("ingest", 0.25);
    log->OnStageStarted("train");
    ProgressEvent event;
    event.stage = "train";
    event.fraction = 1;  // never thinned out
    event.samples = 1e6;
    event.samples_per_s = 2e6;
    event.psnr_db = 30;
    event.eta_s = 0;
    event.message = "done";
    log->OnProgress(event);
    log->OnProgress({.stage = "train", .fraction = 1.5, .message = ""});
    log->OnResult(Done());
    log->OnResult(Failed(kExitFailed));
    EXPECT_FALSE(log->failed());
  }
  auto text = ReadTextFile(path, 1 << 20);
  ASSERT_TRUE(text);
  std::istringstream lines(*text);
  std::string line;
  int seq = 0;
  std::vector<std::string> types;
  while (std::getline(lines, line)) {
    const Json json = Json::parse(line);
    const Status status = CheckAgainstSchema("events", json);
    EXPECT_TRUE(status) << status.error().message << "\n" << line;
    EXPECT_EQ(json["seq"], seq++);
    types.push_back(json["type"]);
  }
  EXPECT_EQ(types,
            (std::vector<std::string>{"stage_started", "note", "warning", "stage_finished",
                                      "stage_started", "progress", "progress", "result", "error"}));
  std::filesystem::remove(path);
}

TEST(EventLog, ThinsProgressToTenASecond) {
  const std::string path = testing::TempDir() + "patina_thin.ndjson";
  {
    auto log = EventLog::Open(path);
    ASSERT_TRUE(log);
    for (int i = 0; i < 10000; ++i)
      log->OnProgress({.stage = "train", .fraction = 0.5, .message = ""});
  }
  auto text = ReadTextFile(path, 10 << 20);
  ASSERT_TRUE(text);
  EXPECT_LT(std::count(text->begin(), text->end(), '\n'), 5000);
  std::filesystem::remove(path);
}

TEST(EventLog, GoesOnWhenTheDiskIsFull) {
  auto log = EventLog::Open("/dev/full");
  ASSERT_TRUE(log);
  log->OnStageStarted("ingest");
  log->OnStageStarted("train");
  EXPECT_TRUE(log->failed());
}

TEST(EventLog, SaysWhyAFileCannotBeWritten) {
  auto log = EventLog::Open("/nonexistent-folder/events");
  ASSERT_FALSE(log);
  EXPECT_EQ(log.error().code, ErrorCode::kNotFound);
  EXPECT_NE(log.error().message.find("/nonexistent-folder/events"), std::string::npos);
}

}  // namespace
}  // namespace patina
