// How long a lookup takes: containers in turn, mip 0 or the finest one that is stored.
//
//   patina_decode_bench CONTAINER... -> one line of JSON: {"<container>": nanoseconds a texel, ...}
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "formats/container.h"
#include "formats/decoder/patina_decoder.h"

namespace {

constexpr int kRounds = 7;
constexpr double kSecondsARound = 0.05;

struct Subject {
  std::string name;
  patina::Decoder decoder;
  int mip = 0;
  std::vector<float> out;
  std::vector<double> ns_per_texel;
};

// Decodes rows for about kSecondsARound; on one core.
void Measure(Subject* subject) {
  using Clock = std::chrono::steady_clock;
  const patina::Decoder& decoder = subject->decoder;
  const int width = decoder.MipWidth(subject->mip), height = decoder.MipHeight(subject->mip);
  const int rows = std::min(height, 64);
  const size_t plane = static_cast<size_t>(width) * static_cast<size_t>(rows);
  subject->out.resize(plane * static_cast<size_t>(std::max(1, decoder.outputs())));
  const Clock::time_point start = Clock::now();
  double seconds = 0, texels = 0;
  for (int y = 0; seconds < kSecondsARound; y = (y + rows) % std::max(1, height - rows + 1)) {
    decoder.DecodeRows(subject->mip, y, y + rows, subject->out.data(), plane);
    texels += static_cast<double>(plane);
    seconds = std::chrono::duration<double>(Clock::now() - start).count();
  }
  subject->ns_per_texel.push_back(1e9 * seconds / texels);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<Subject> subjects;
  for (int i = 1; i < argc; ++i) {
    Subject subject;
    subject.name = argv[i];
    std::string problem;
    const auto container = patina::OpenContainer(subject.name);
    if (!container) {
      std::fprintf(stderr, "%s\n", container.error().message.c_str());
      return 3;
    }
    if (patina::Decoder::Load(container->directory, &subject.decoder, &problem) !=
        patina::Decoder::LoadStatus::kOk) {
      std::fprintf(stderr, "%s\n", problem.c_str());
      return 3;
    }
    if (container->manifest.lod_range) subject.mip = (*container->manifest.lod_range)[0];
    subjects.push_back(std::move(subject));
  }
  for (int round = 0; round < kRounds; ++round) {
    for (Subject& subject : subjects) Measure(&subject);
  }
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (Subject& subject : subjects) {
    auto& times = subject.ns_per_texel;
    std::nth_element(times.begin(), times.begin() + kRounds / 2, times.end());
    // Without outputs nothing is decoded at all.
    json[subject.name] = subject.decoder.outputs() == 0 ? 0.0 : times[kRounds / 2];
  }
  std::printf("%s\n", json.dump().c_str());
  return 0;
}
