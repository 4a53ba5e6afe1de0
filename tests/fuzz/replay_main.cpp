// Runs a fuzz target without libFuzzer: the seeds, the files of a folder, and mutations of all of
// them that are the same in every run. The input that is being tried when the program dies is in
// replay-crash.bin.
//   fuzz_x [CORPUS_FOLDER] [MUTATIONS]      runs
//   fuzz_x --write-seeds FOLDER             writes the seeds, to start libFuzzer from
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/fuzz/fuzz_target.h"

namespace {

using Bytes = std::vector<uint8_t>;

constexpr const char* kCrashFile = "replay-crash.bin";
Bytes g_current;

void KeepCurrentInput(int signal_number) {
  if (std::FILE* file = std::fopen(kCrashFile, "wb")) {
    std::fwrite(g_current.data(), 1, g_current.size(), file);
    std::fclose(file);
  }
  std::signal(signal_number, SIG_DFL);
  std::raise(signal_number);
}

// SplitMix64.
class Random {
 public:
  size_t Below(size_t bound) {
    uint64_t z = state_ += 0x9E3779B97F4A7C15ull;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return static_cast<size_t>((z ^ (z >> 31)) % bound);
  }

 private:
  uint64_t state_ = 1;
};

void Mutate(Random& random, const std::vector<Bytes>& inputs, Bytes* bytes) {
  static constexpr uint32_t kNumbers[] = {0,      1,       2,          7,          16,
                                          127,    128,     255,        256,        0x7FFF,
                                          0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF};
  for (size_t count = 1 + random.Below(4); count > 0; --count) {
    const size_t size = bytes->size();
    const size_t at = random.Below(size + 1);
    const auto here = bytes->begin() + static_cast<std::ptrdiff_t>(at);
    switch (random.Below(7)) {
      case 0:
        if (at < size) (*bytes)[at] = static_cast<uint8_t>((*bytes)[at] ^ 1 << random.Below(8));
        break;
      case 1:
        if (at < size) (*bytes)[at] = static_cast<uint8_t>(random.Below(256));
        break;
      case 2: {
        const uint32_t number = kNumbers[random.Below(std::size(kNumbers))];
        const size_t aligned = at & ~size_t{3};
        if (aligned + 4 <= size) std::memcpy(bytes->data() + aligned, &number, 4);
        break;
      }
      case 3:
        bytes->resize(at);
        break;
      case 4:
        bytes->insert(here, 1 + random.Below(20), static_cast<uint8_t>(random.Below(256)));
        break;
      case 5: {
        const size_t end = std::min(size, at + random.Below(64));
        bytes->erase(here, bytes->begin() + static_cast<std::ptrdiff_t>(end));
        break;
      }
      case 6: {
        const Bytes& other = inputs[random.Below(inputs.size())];
        const size_t from = random.Below(other.size() + 1);
        const size_t length = std::min(other.size() - from, random.Below(64));
        const Bytes piece(other.begin() + static_cast<std::ptrdiff_t>(from),
                          other.begin() + static_cast<std::ptrdiff_t>(from + length));
        bytes->insert(here, piece.begin(), piece.end());
        break;
      }
    }
  }
}

void Run(const Bytes& bytes) {
  g_current = bytes;
  // A copy of exactly this size on the heap, so that the address sanitizer sees a read beyond it.
  const Bytes exact(bytes);
  LLVMFuzzerTestOneInput(exact.data(), exact.size());
}

int Replay(const std::string& folder, int mutations) {
  std::vector<Bytes> inputs = FuzzSeeds();
  if (!folder.empty() && std::filesystem::is_directory(folder)) {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    for (const auto& path : files) {
      std::ifstream file(path, std::ios::binary);
      inputs.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    }
  }
  inputs.emplace_back();
  for (const Bytes& input : inputs) Run(input);
  Random random;
  for (int i = 0; i < mutations; ++i) {
    Bytes bytes = inputs[random.Below(inputs.size())];
    Mutate(random, inputs, &bytes);
    Run(bytes);
  }
  std::printf("%zu inputs and %d mutations\n", inputs.size(), mutations);
  return 0;
}

int WriteSeeds(const std::string& folder) {
  std::filesystem::create_directories(folder);
  const std::vector<Bytes> seeds = FuzzSeeds();
  for (size_t i = 0; i < seeds.size(); ++i) {
    std::ofstream file(folder + "/seed-" + std::to_string(i), std::ios::binary);
    file.write(reinterpret_cast<const char*>(seeds[i].data()),
               static_cast<std::streamsize>(seeds[i].size()));
    if (!file) {
      std::fprintf(stderr, "cannot write to %s\n", folder.c_str());
      return 1;
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc == 3 && std::strcmp(argv[1], "--write-seeds") == 0) return WriteSeeds(argv[2]);
    std::signal(SIGABRT, KeepCurrentInput);
    std::signal(SIGSEGV, KeepCurrentInput);
    return Replay(argc > 1 ? argv[1] : "", argc > 2 ? std::atoi(argv[2]) : 20000);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "an exception came out: %s\n", error.what());
    std::abort();
  }
}
