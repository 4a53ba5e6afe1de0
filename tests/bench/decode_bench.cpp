// How long a lookup takes: containers in turn, mip 0 or the finest one that is stored.
//
//   patina_decode_bench CONTAINER... -> one line of JSON: {"<container>": nanoseconds of a lookup, ...}
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pipeline/tradeoff/decode_time.h"

int main(int argc, char** argv) {
  std::vector<std::unique_ptr<patina::DecodeTimer>> timers;
  for (int i = 1; i < argc; ++i) {
    auto timer = patina::DecodeTimer::Open(argv[i]);
    if (!timer) {
      std::fprintf(stderr, "%s\n", timer.error().message.c_str());
      return 3;
    }
    timers.push_back(std::move(*timer));
  }
  for (int round = 0; round < patina::DecodeTimer::kRounds; ++round) {
    for (const auto& timer : timers) timer->Round();
  }
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (int i = 1; i < argc; ++i) json[argv[i]] = timers[static_cast<size_t>(i) - 1]->MedianNs();
  std::printf("%s\n", json.dump().c_str());
  return 0;
}
