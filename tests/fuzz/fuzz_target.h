// What each fuzz_*.cpp defines.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <vector>

// Takes any bytes. Aborts (or is stopped by a sanitizer) when a property does not hold.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

// Valid inputs to start from.
std::vector<std::vector<uint8_t>> FuzzSeeds();

#define FUZZ_CHECK(condition)                                                             \
  do {                                                                                    \
    if (!(condition)) {                                                                   \
      std::fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                       \
    }                                                                                     \
  } while (false)

// Texts as seeds, each of which `accepts` must take.
template <class Texts, class Accepts>
std::vector<std::vector<uint8_t>> SeedsOf(const Texts& texts, Accepts accepts) {
  std::vector<std::vector<uint8_t>> seeds;
  for (const std::string_view text : texts) {
    FUZZ_CHECK(accepts(text));
    seeds.emplace_back(text.begin(), text.end());
  }
  return seeds;
}
