#include "pipeline/base/aligned_buffer.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <utility>

namespace patina {
namespace {

template <class T>
bool AllZero(const AlignedBuffer<T>& buffer) {
  for (size_t i = 0; i < buffer.size(); ++i) {
    if (buffer[i] != T{}) return false;
  }
  return true;
}

TEST(AlignedBuffer, IsEmptyByDefault) {
  const AlignedBuffer<float> buffer;
  EXPECT_EQ(buffer.size(), 0u);
  EXPECT_EQ(buffer.data(), nullptr);
}

TEST(AlignedBuffer, StartsOnACacheLineWithZeros) {
  for (const size_t count : {1, 3, 16, 17, 1000}) {
    const AlignedBuffer<float> buffer(count);
    EXPECT_EQ(buffer.size(), count);
    EXPECT_EQ(reinterpret_cast<uintptr_t>(buffer.data()) % 64, 0u);
    EXPECT_TRUE(AllZero(buffer));
  }
}

TEST(AlignedBuffer, AlignsLargeArraysToHugePages) {
  const size_t count = (size_t{1} << 20) + 5;  // four megabytes and a bit
  const AlignedBuffer<float> buffer(count);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(buffer.data()) % (size_t{1} << 21), 0u);
  EXPECT_TRUE(AllZero(buffer));
}

TEST(AlignedBuffer, ResetClearsAndResizes) {
  AlignedBuffer<int> buffer(10);
  for (size_t i = 0; i < 10; ++i) buffer[i] = 7;
  buffer.Reset(20);
  EXPECT_EQ(buffer.size(), 20u);
  EXPECT_TRUE(AllZero(buffer));
  buffer.Reset(0);
  EXPECT_EQ(buffer.size(), 0u);
  EXPECT_EQ(buffer.data(), nullptr);
}

TEST(AlignedBuffer, MovesWithoutCopying) {
  AlignedBuffer<int> from(4);
  from[2] = 9;
  const int* data = from.data();
  const AlignedBuffer<int> to = std::move(from);
  EXPECT_EQ(to.data(), data);
  EXPECT_EQ(to[2], 9);
  EXPECT_EQ(to.size(), 4u);
}

}  // namespace
}  // namespace patina
