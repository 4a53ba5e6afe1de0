#include <gtest/gtest.h>

#include <filesystem>

#include "daemon/service/job_folders.h"
#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

class TrainingCurve : public ::testing::Test {
 protected:
  std::vector<CurvePoint> Read(const std::string& events) {
    std::filesystem::create_directories(folder_ / "jobs/7/a2");
    EXPECT_TRUE(WriteFileDurably(folder_ / "jobs/7/a2/events.ndjson", events));
    return JobFolders(folder_.path(), RealFileCalls()).ReadCurve(7, 2);
  }
  static std::string Progress(double time_s, double psnr_db) {
    return "{\"type\":\"progress\",\"stage\":\"train\",\"time_s\":" + std::to_string(time_s) +
           ",\"psnr_db\":" + std::to_string(psnr_db) + "}\n";
  }
  test::TemporaryDirectory folder_;
};

TEST_F(TrainingCurve, IsEmptyWhereNothingWasLearned) {
  EXPECT_TRUE(JobFolders(folder_.path(), RealFileCalls()).ReadCurve(7, 1).empty());
  EXPECT_TRUE(Read("").empty());
  EXPECT_TRUE(Read("{\"type\":\"stage_started\",\"stage\":\"train\",\"time_s\":1}\n").empty());
}

TEST_F(TrainingCurve, LeavesOutWhatIsNoPoint) {
  const auto curve = Read(Progress(1, 20) + "not JSON\n[1]\n{\"time_s\":\"2\",\"psnr_db\":21}\n" +
                          "{\"time_s\":2}\n{\"time_s\":1e999,\"psnr_db\":1}\n" + Progress(3, 22) +
                          "{\"time_s\":4,\"psnr_db\":23}");  // still being written
  ASSERT_EQ(curve.size(), 2u);
  EXPECT_EQ(curve[0].time_s, 1);
  EXPECT_EQ(curve[0].psnr_db, 20);
  EXPECT_EQ(curve[1].time_s, 3);
}

TEST_F(TrainingCurve, IsThinnedAndKeepsItsEnds) {
  std::string events;
  constexpr int kPoints = 20000;  // more than is read at once
  for (int i = 0; i < kPoints; ++i) events += Progress(i, 20 + i / 1000.0);
  const auto curve = Read(events);
  ASSERT_GT(curve.size(), 200u);
  ASSERT_LE(curve.size(), 500u);
  EXPECT_EQ(curve.front().time_s, 0);
  EXPECT_EQ(curve.back().time_s, kPoints - 1);
  // As dense at its beginning as at its end.
  for (size_t i = 1; i + 1 < curve.size(); ++i)
    EXPECT_EQ(curve[i].time_s - curve[i - 1].time_s, curve[1].time_s);
  EXPECT_LT(curve[curve.size() - 2].time_s, curve.back().time_s);
}

}  // namespace
}  // namespace patina::daemon
