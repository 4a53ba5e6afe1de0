#include "pipeline/client/client_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace patina {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

TEST(ClientText, ListsJobs) {
  const Json answer = Json::parse(R"({"jobs": [
    {"id": 12, "asset": "wall", "state": "running", "priority": 0,
     "progress": {"stage": "train", "fraction": 0.631, "psnr_db": 31.24, "gain_10s_db": 0.118, "eta_s": 75}},
    {"id": 3, "asset": "flo\u001bor", "state": "failed", "priority": -5,
     "error": {"code": "corrupt_data", "message": "a.png: cut off"}}], "next_cursor": "3"})");
  EXPECT_EQ(JobsText(answer),
            "ID  STATE          PRIO  ASSET   REMARK\n"
            "12  running        0     wall    train 63 %, 31.2 dB (+0.12 in 10 s), 1 min 15 s left\n"
            "3   failed         -5    flo?or  a.png: cut off\n"
            "there are more; see --limit\n");
  EXPECT_EQ(JobsText(Json::parse(R"({"jobs": []})")), "no jobs\n");
}

TEST(ClientText, MakesDoWithAnythingItGets) {
  for (const char* text :
       {"null", "[]", "{}", "1", R"({"jobs": 1})", R"({"jobs": [1, null, {}]})",
        R"({"jobs": [{"id": "x", "progress": 1, "error": []}]})",
        R"({"watch": [], "pending": [1], "problems": [2], "jobs": {"a": "b"}})"}) {
    const Json json = Json::parse(text);
    JobsText(json);
    JobLine(json);
    EventLine(json);
    EXPECT_THAT(StatusText(json), HasSubstr("patinad"));
    EXPECT_EQ(ExitCodeOfJob(json), 1);
  }
}

TEST(ClientText, SaysWhatHappened) {
  EXPECT_EQ(EventLine(Json::parse(
                R"({"type": "started", "job": 4, "data": {"asset": "wall", "attempt": 2}})")),
            "4 wall: started (attempt 2)");
  EXPECT_EQ(EventLine(Json::parse(R"({"type": "queue_paused", "data": {}})")), "queue_paused");
}

TEST(ClientText, GivesTheExitCodeOfTheJob) {
  EXPECT_EQ(ExitCodeOfJob(Json::parse(R"({"state": "succeeded"})")), 0);
  EXPECT_EQ(ExitCodeOfJob(Json::parse(R"({"state": "cancelled"})")), 130);
  EXPECT_EQ(ExitCodeOfJob(Json::parse(R"({"state": "buried"})")), 1);
  EXPECT_EQ(ExitCodeOfJob(Json::parse(R"({"state": "failed", "result": {"exit_code": 4}})")), 4);
  EXPECT_EQ(ExitCodeOfJob(Json::parse(R"({"state": "failed", "result": {"exit_code": 3}})")), 3);
}

TEST(ClientText, TellsAStatus) {
  const std::string text = StatusText(Json::parse(R"({"version": "1", "state": "running", "pid": 5,
    "cores": 2, "cores_used": 1, "queue_paused": true, "jobs": {"queued": 3, "failed": 0},
    "watch": {"roots": [{"path": "/drop", "mode": "polling", "mode_reason": "nfs", "folders": 4,
                         "assets": 2}, {"path": "/surfaces", "as": "svbrdf"}]},
    "pending": [{"name": "wall", "reason": "still being written"}], "problems": ["disk full"]})"));
  EXPECT_THAT(text, HasSubstr("cores 1 of 2 in use; the queue is paused\n"));
  EXPECT_THAT(text, HasSubstr("jobs 3 queued\n"));
  EXPECT_THAT(text, HasSubstr("watches /drop by polling (nfs): 4 folders, 2 assets\n"));
  EXPECT_THAT(text,
              HasSubstr("/surfaces by  (): 0 folders, 0 assets, texture sets as reflectance"));
  EXPECT_THAT(text, HasSubstr("  wall: still being written\n"));
  EXPECT_THAT(text, HasSubstr("problems:\n  disk full\n"));
}

}  // namespace
}  // namespace patina
