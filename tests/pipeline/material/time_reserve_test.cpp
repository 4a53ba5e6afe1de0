#include "pipeline/material/time_reserve.h"

#include <gtest/gtest.h>

#include "tests/pipeline/material/synthetic_reference.h"

namespace patina {
namespace {

class TimeReserveTest : public testing::Test {
 protected:
  TimeReserveTest() : reference_(test::MakeReference(256, 256, 4, AddressMode::kWrap, [](double, double, int) { return 0.5f; })) {
    store_.Allocate(ShapeForProfile(Profile::kBcf1k, 256, 256), BlockForm::kSegments, StoreUse::kAdam);
  }
  TimeReserve Make(int encodes, int threads = 2) const { return TimeReserve(reference_, store_, encodes, 1e5, threads); }
  // So fast that steps take 10 ms.
  static void Train(TimeReserve* reserve, double samples_per_s, double seconds) {
    for (double t = 0; t < seconds; t += 0.01) reserve->CountStep(0.01 * samples_per_s, 0.01);
  }

  MaterialReference reference_;
  FeatureStore store_;
};

TEST_F(TimeReserveTest, FollowsTheMachine) {
  TimeReserve fast = Make(2), slow = Make(2);
  Train(&fast, 4e7, 3);
  Train(&slow, 1e7, 3);
  EXPECT_NEAR(slow.Seconds() / fast.Seconds(), 4, 0.05);
  EXPECT_NEAR(Make(2, 1).Seconds() / Make(2, 4).Seconds(), 4, 1e-9);
}

TEST_F(TimeReserveTest, ForgetsTheFirstSteps) {
  TimeReserve woken = Make(2), steady = Make(2);
  Train(&woken, 1e5, 0.5);
  Train(&woken, 3e7, 4);
  Train(&steady, 3e7, 4.5);
  EXPECT_NEAR(woken.Seconds(), steady.Seconds(), 0.02 * steady.Seconds());
}

TEST_F(TimeReserveTest, EncodesOnTheWayAreMeasuredAndDone) {
  TimeReserve reserve = Make(2);
  Train(&reserve, 2e7, 3);
  const double later = Make(0).Seconds();
  EXPECT_GT(reserve.Seconds(), later);  // the quick export has fewer passes, and none on the way
  reserve.CountEncode(10);
  const double one_left = reserve.Seconds();
  EXPECT_GT(one_left, 30);  // one on the way, and the export
  reserve.CountEncode(10);
  EXPECT_NEAR(one_left - reserve.Seconds(), 10, 1e-6);
  reserve.CountEncode(10);
  EXPECT_GT(reserve.Seconds(), 20);
}

}  // namespace
}  // namespace patina
