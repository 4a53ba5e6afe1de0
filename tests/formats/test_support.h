// Small things that several tests of formats/ share.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/bc6h.h"
#include "formats/dds.h"

namespace patina::test {

// A repeatable stream of numbers (SplitMix64).
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t Next() {
    uint64_t z = state_ += 0x9E3779B97F4A7C15ull;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
  }
  int Below(int bound) { return static_cast<int>(Next() % static_cast<uint64_t>(bound)); }
  double Unit() { return static_cast<double>(Next() >> 11) * 0x1p-53; }

 private:
  uint64_t state_;
};

// A directory of its own that goes away with its content.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string pattern = (std::filesystem::temp_directory_path() / "patina-test-XXXXXX").string();
    path_ = mkdtemp(pattern.data());
  }
  ~TemporaryDirectory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  const std::string& path() const { return path_; }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

inline constexpr int kReservedModeBits[4] = {0x13, 0x17, 0x1B, 0x1F};

// Random bits with a given mode; 14..17 are the reserved ones.
inline bc6h::Block RandomBlock(Random& random, int mode) {
  bc6h::Block block;
  for (auto& byte : block) byte = static_cast<uint8_t>(random.Next());
  const int bits = mode < bc6h::kModeCount ? bc6h::Mode(mode).mode_bits
                                           : kReservedModeBits[mode - bc6h::kModeCount];
  const int count = mode < bc6h::kModeCount ? bc6h::Mode(mode).mode_bit_count : 5;
  block[0] = static_cast<uint8_t>((block[0] & ~((1 << count) - 1)) | bits);
  return block;
}

inline std::vector<std::vector<bc6h::Block>> RandomLevels(Random& random, int width, int height,
                                                          int levels) {
  std::vector<std::vector<bc6h::Block>> result(static_cast<size_t>(levels));
  for (int level = 0; level < levels; ++level) {
    const int count =
        DdsBlocks(DdsLevelSide(width, level)) * DdsBlocks(DdsLevelSide(height, level));
    for (int i = 0; i < count; ++i) result[level].push_back(RandomBlock(random, random.Below(18)));
  }
  return result;
}

// Finite halves of three features, of both signs and all sizes; see DdsTexture::halves.
inline std::vector<std::vector<uint16_t>> RandomHalfLevels(Random& random, int width, int height,
                                                           int levels) {
  std::vector<std::vector<uint16_t>> result(static_cast<size_t>(levels));
  for (int level = 0; level < levels; ++level) {
    const int count = 3 * DdsLevelSide(width, level) * DdsLevelSide(height, level);
    for (int i = 0; i < count; ++i) {
      const auto magnitude = static_cast<uint16_t>(random.Below(0x7C00));
      result[level].push_back(static_cast<uint16_t>(magnitude | random.Below(2) << 15));
    }
  }
  return result;
}

// The message of an error, or "" for success.
template <class T>
std::string MessageOf(const Result<T>& result) {
  return result ? std::string() : result.error().message;
}

// What a fresh heap buffer of exactly this size holds: reads beyond it are then seen by the address
// sanitizer.
inline std::vector<uint8_t> Prefix(std::span<const uint8_t> bytes, size_t size) {
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)};
}

}  // namespace patina::test

#define ASSERT_OK(expression)                                                          \
  do {                                                                                 \
    const auto& patina_test_result = (expression);                                     \
    ASSERT_TRUE(patina_test_result.has_value()) << patina_test_result.error().message; \
  } while (false)
