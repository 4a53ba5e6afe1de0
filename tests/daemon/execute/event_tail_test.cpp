#include "daemon/execute/event_tail.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

using Lines = std::vector<std::string>;

class EventTailTest : public testing::Test {
 protected:
  void Append(const std::string& text) {
    std::ofstream(folder_ / "events", std::ios::app | std::ios::binary) << text;
  }
  Lines Read() { return tail_.Read(RealFileCalls()); }

  patina::test::TemporaryDirectory folder_;
  EventTail tail_{folder_ / "events"};
};

TEST_F(EventTailTest, GivesCompleteLinesOnce) {
  EXPECT_EQ(Read(), Lines());
  Append("one\ntwo\nthr");
  EXPECT_EQ(Read(), (Lines{"one", "two"}));
  EXPECT_EQ(Read(), Lines());
  Append("ee\n\n");
  EXPECT_EQ(Read(), (Lines{"three", ""}));
}

TEST_F(EventTailTest, LeavesOutALineWithoutEnd) {
  Append(std::string(3 << 20, 'x'));
  for (int i = 0; i < 8; ++i) EXPECT_EQ(Read(), Lines());
  Append("\nafter\n");
  EXPECT_EQ(Read(), Lines{"after"});
}

TEST_F(EventTailTest, ReadsMuchInParts) {
  for (int i = 0; i < 3000; ++i) Append(std::string(1000, 'a') + "\n");
  size_t lines = 0;
  for (Lines part = Read(); !part.empty(); part = Read()) lines += part.size();
  EXPECT_EQ(lines, 3000u);
}

}  // namespace
}  // namespace patina::daemon
