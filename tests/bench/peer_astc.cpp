#include "tests/bench/peer_astc.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <vector>

#include "pipeline/image/image_io.h"

extern char** environ;

namespace patina::bench {
namespace {

// TGA, uncompressed, 24 bits: the cheapest format that astcenc reads.
Status WriteTga(const std::string& path, const Rgba8& image) {
  std::vector<uint8_t> bytes = {0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  for (const int side : {image.width, image.height}) {
    bytes.push_back(static_cast<uint8_t>(side & 255));
    bytes.push_back(static_cast<uint8_t>(side >> 8));
  }
  bytes.push_back(24);
  bytes.push_back(0x20);  // rows from the top
  for (size_t i = 0; i < image.texels.size(); i += 4) {
    for (const int c : {2, 1, 0}) bytes.push_back(image.texels[i + c]);
  }
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) return Fail(ErrorCode::kIo, path + ": cannot be created");
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
  if (std::fclose(file) != 0 || !written) return Fail(ErrorCode::kIo, path + ": cannot be written");
  return {};
}

Status RunProgram(const std::vector<std::string>& arguments) {
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (const auto& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  // It prints its own measures, whatever it is told.
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int refused = posix_spawnp(&child, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (refused != 0) {
    return Fail(ErrorCode::kNotFound,
                arguments[0] + ": cannot be started: install the package astcenc");
  }
  int state = 0;
  if (waitpid(child, &state, 0) != child || !WIFEXITED(state) || WEXITSTATUS(state) != 0) {
    return Fail(ErrorCode::kInternal, arguments[0] + " failed on " + arguments[2]);
  }
  return {};
}

uint64_t LevelBytes(const AstcBlock& block, int width, int height) {
  return 16ull * static_cast<uint64_t>((width + block.width - 1) / block.width) *
         static_cast<uint64_t>((height + block.height - 1) / block.height);
}

std::string BlockName(const AstcBlock& block) {
  return std::to_string(block.width) + "x" + std::to_string(block.height);
}

}  // namespace

std::string AstcCodec::name() const { return "ASTC " + BlockName(block_) + " " + quality_; }

Result<CodedLevel> AstcCodec::RoundTrip(const Rgba8& image, bool normal, ThreadPool& pool) {
  const std::string in = scratch_ + "/in.tga", out = scratch_ + "/out.tga";
  PATINA_TRY(WriteTga(in, image));
  std::vector<std::string> arguments = {"astcenc",
                                        "-tl",
                                        in,
                                        out,
                                        BlockName(block_),
                                        "-" + quality_,
                                        "-silent",
                                        "-j",
                                        std::to_string(pool.threads())};
  if (normal) arguments.push_back("-normal");
  PATINA_TRY(RunProgram(arguments));
  PATINA_ASSIGN(const Image decoded, ReadImage(out));
  if (decoded.width() != image.width || decoded.height() != image.height) {
    return Fail(ErrorCode::kInternal, out + ": astcenc changed the size");
  }
  CodedLevel level;
  level.decoded = Rgba8(image.width, image.height);
  level.bytes = LevelBytes(block_, image.width, image.height);
  std::vector<float> row(static_cast<size_t>(image.width));
  for (int c = 0; c < 3; ++c) {
    const int channel = decoded.channels() >= 3 ? c : 0;
    for (int y = 0; y < image.height; ++y) {
      LoadRow(decoded, y, channel, row.data());
      for (int x = 0; x < image.width; ++x) {
        level.decoded.Texel(x, y)[c] = static_cast<uint8_t>(std::lround(255.0f * row[x]));
      }
    }
  }
  return level;
}

AstcBlock NearestAstcBlock(const MaterialReference& reference, uint64_t bytes) {
  constexpr AstcBlock kBlocks[] = {{4, 4},  {5, 4},  {5, 5}, {6, 5},  {6, 6},   {8, 5},   {8, 6},
                                   {10, 5}, {10, 6}, {8, 8}, {10, 8}, {10, 10}, {12, 10}, {12, 12}};
  const auto textures = static_cast<uint64_t>(PlanTextures(reference).size());
  AstcBlock best;
  double best_distance = std::numeric_limits<double>::infinity();
  for (const AstcBlock& block : kBlocks) {
    uint64_t size = 0;
    for (const TargetLevel& level : reference.pyramid.levels) {
      size += textures * LevelBytes(block, level.width, level.height);
    }
    const double distance =
        std::abs(std::log(static_cast<double>(size) / static_cast<double>(bytes)));
    if (distance < best_distance) {
      best_distance = distance;
      best = block;
    }
  }
  return best;
}

}  // namespace patina::bench
