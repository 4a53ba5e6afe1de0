#include "pipeline/jobs/run_guards.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <fstream>

#include "tests/formats/test_support.h"

namespace patina {
namespace {

class FenceTest : public testing::Test {
 protected:
  void Write(const std::string& text) { std::ofstream(fence_) << text; }
  // Whether somebody else could lock the file like this now.
  bool CanLock(int how) {
    const int fd = ::open(fence_.c_str(), O_RDWR);
    const bool locked = ::flock(fd, how | LOCK_NB) == 0;
    ::close(fd);
    return locked;
  }
  test::TemporaryDirectory folder_;
  const std::string fence_ = folder_ / "fence";
};

TEST_F(FenceTest, LetsTheCurrentAttemptPass) {
  ASSERT_OK(MoveFence(fence_, 9));
  EXPECT_TRUE(FenceHold::Acquire(fence_, 9));
  ASSERT_OK(MoveFence(fence_, 10));
  EXPECT_TRUE(FenceHold::Acquire(fence_, 10));
  ASSERT_OK(MoveFence(fence_, 10));
}

TEST_F(FenceTest, StopsEveryOther) {
  ASSERT_OK(MoveFence(fence_, 10));
  for (const int64_t attempt : {int64_t{9}, int64_t{11}, int64_t{0}, int64_t{1}}) {
    const auto hold = FenceHold::Acquire(fence_, attempt);
    ASSERT_FALSE(hold) << attempt;
    EXPECT_EQ(hold.error().code, ErrorCode::kConflict);
  }
  EXPECT_EQ(MoveFence(fence_, 9).error().code, ErrorCode::kConflict);
  EXPECT_EQ(FenceHold::Acquire(folder_ / "none", 1).error().code, ErrorCode::kNotFound);
}

TEST_F(FenceTest, StopsAllWhereItHoldsNoNumber) {
  for (const char* text :
       {"", "7", "seven\n", "7 \n", "-7\n", "99999999999999999999999999\n", "\n"}) {
    Write(text);
    EXPECT_FALSE(FenceHold::Acquire(fence_, 7)) << text;
  }
  Write("7\nrest");
  EXPECT_TRUE(FenceHold::Acquire(fence_, 7));
}

TEST_F(FenceTest, WaitsForWhoPublishes) {
  ASSERT_OK(MoveFence(fence_, 1));
  {
    const auto hold = FenceHold::Acquire(fence_, 1);
    ASSERT_OK(hold);
    EXPECT_FALSE(CanLock(LOCK_EX));
    EXPECT_TRUE(CanLock(LOCK_SH));
  }
  EXPECT_TRUE(CanLock(LOCK_EX));
}

}  // namespace
}  // namespace patina
