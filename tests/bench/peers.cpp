// What the usual texture codecs make of a set, measured exactly as a container of ours is.
//
// usage: patina_peers SET [--bytes N] [--astc-quality Q] [--threads N]
//   SET   a folder of maps
//   --bytes N         also ASTC at the block size nearest to N bytes
//   --astc-quality Q  fastest, fast, medium (default), thorough, exhaustive
// Prints one line of JSON for each codec: set, width, height, channels, codec, bytes, seconds,
// psnr_db, ssim, flip, normal_deg. BC1 + BC5 at full and at half resolution, ASTC 12x12.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/image/map_finder.h"
#include "pipeline/material/reference.h"
#include "tests/bench/peer_astc.h"
#include "tests/bench/peer_bc.h"

namespace patina::bench {
namespace {

struct Options {
  std::string folder;
  uint64_t bytes = 0;
  std::string astc_quality = "medium";
  int threads = 0;
};

std::optional<Options> ParseOptions(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const char* value = i + 1 < argc ? argv[i + 1] : nullptr;
    if (argument.rfind("--", 0) != 0) {
      if (!options.folder.empty()) return std::nullopt;
      options.folder = argument;
      continue;
    }
    if (value == nullptr) return std::nullopt;
    ++i;
    if (argument == "--bytes") {
      options.bytes = std::strtoull(value, nullptr, 10);
    } else if (argument == "--astc-quality") {
      options.astc_quality = value;
    } else if (argument == "--threads") {
      options.threads = std::atoi(value);
    } else {
      return std::nullopt;
    }
  }
  if (options.folder.empty() || options.threads < 0 || options.threads > 256) return std::nullopt;
  return options;
}

// A folder that is gone with the object.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "patina_peers_XXXXXX").string();
    if (mkdtemp(pattern.data()) != nullptr) path_ = pattern;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

void Print(const SourceReference& source, const std::string& set, const std::string& codec,
           bool nearest, const PeerResult& result) {
  nlohmann::ordered_json line;
  line["set"] = set;
  line["width"] = source.width;
  line["height"] = source.height;
  line["channels"] = source.material.pyramid.channels;
  line["codec"] = codec;
  line["nearest"] = nearest;
  line["bytes"] = result.bytes;
  line["seconds"] = result.seconds;
  const auto& quality = result.quality;
  line["psnr"] = {{"overall", quality.psnr.overall_db},
                  {"mip0", quality.psnr.mip0_db},
                  {"mean_mips", quality.psnr.mean_mips_db}};
  if (quality.ssim) line["ssim"] = *quality.ssim;
  if (quality.flip) line["flip"] = *quality.flip;
  if (quality.normal_angle_deg) line["normal_angle_deg"] = *quality.normal_angle_deg;
  std::printf("%s\n", line.dump().c_str());
  std::fflush(stdout);
}

Status Run(const Options& options) {
  ThreadPool pool(options.threads);
  const ScratchFolder scratch;
  if (scratch.path().empty())
    return Fail(ErrorCode::kIo, "no scratch folder can be made: set TMPDIR");
  PATINA_ASSIGN(const std::vector<MapSet> sets, FindMaps(options.folder));
  for (const MapSet& set : sets) {
    ReferenceOptions reading;
    // The codecs hold 0 to 1: scaled values, no logarithms.
    reading.color.logarithms = LogEncoding::kNever;
    PATINA_ASSIGN(const SourceReference source, BuildReference(set, reading, pool, NoProgress()));
    const MaterialReference& reference = source.material;
    const auto measure = [&](PeerCodec& codec, int first_level, const std::string& suffix,
                             bool nearest) -> Status {
      PATINA_ASSIGN(const PeerResult result, MeasurePeer(reference, codec, first_level, pool));
      Print(source, set.name, codec.name() + suffix, nearest, result);
      return {};
    };
    BcCodec bc;
    PATINA_TRY(measure(bc, 0, "", false));
    PATINA_TRY(measure(bc, 1, " half", false));
    constexpr AstcBlock kCoarsest = {12, 12};
    const AstcBlock nearest =
        options.bytes > 0 ? NearestAstcBlock(reference, options.bytes) : kCoarsest;
    const bool same = nearest.width == kCoarsest.width && nearest.height == kCoarsest.height;
    AstcCodec coarsest(kCoarsest, options.astc_quality, scratch.path());
    PATINA_TRY(measure(coarsest, 0, "", same && options.bytes > 0));
    if (!same) {
      AstcCodec astc(nearest, options.astc_quality, scratch.path());
      PATINA_TRY(measure(astc, 0, "", true));
    }
  }
  return {};
}

}  // namespace
}  // namespace patina::bench

int main(int argc, char** argv) {
  // The catch-all is for libraries that run out of memory; ours report by Status.
  try {
    const auto options = patina::bench::ParseOptions(argc, argv);
    if (!options) {
      std::fprintf(stderr,
                   "usage: patina_peers SET [--bytes N] [--astc-quality Q] [--threads N]\n");
      return 2;
    }
    const patina::Status status = patina::bench::Run(*options);
    if (status) return 0;
    std::fprintf(stderr, "patina_peers: %s\n", status.error().message.c_str());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "patina_peers: %s\n", error.what());
  }
  return 1;
}
