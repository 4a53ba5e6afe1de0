// A counter-based random generator: the same numbers for a seed on every machine and in any order of use.
#pragma once

#include <cstdint>

namespace patina {

// SplitMix64 (Steele, Lea, Flood 2014). Cheap enough to make one for each work item: Rng(seed, stream).
class Rng {
 public:
  explicit Rng(uint64_t seed, uint64_t stream = 0) : state_(Mix(seed + 0x9E3779B97F4A7C15ull * (stream + 1))) {}

  uint64_t Next() { return Mix(state_ += 0x9E3779B97F4A7C15ull); }
  // Uniform in [0, bound), bound >= 1.
  uint32_t Below(uint32_t bound) { return static_cast<uint32_t>(((Next() >> 32) * bound) >> 32); }
  // Uniform in [0, 1), 24 bits.
  float Uniform() { return static_cast<float>(Next() >> 40) * 0x1p-24f; }

 private:
  static uint64_t Mix(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
  }
  uint64_t state_;
};

}  // namespace patina
