// Commands beside a bake that read or write images.
#include <cstdio>
#include <filesystem>

#include "pipeline/cli/commands.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/compare.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/sample_brdf.h"
#include "pipeline/jobs/sample_btf.h"
#include "pipeline/jobs/sample_layered.h"
#include "pipeline/jobs/sample_scene.h"
#include "pipeline/jobs/sample_set.h"
#include "pipeline/jobs/sample_stack.h"
#include "pipeline/jobs/unpack.h"

namespace patina {

int UnpackCommand(const CommandLine& line, const CancelToken& cancel) {
  const UnpackArguments& given = line.unpack;
  ThreadPool pool(line.threads);
  SetImageIoThreads(pool.threads());
  UnpackOptions options;
  options.mip = given.mip;
  options.format = given.format == "exr"   ? UnpackFormat::kExr
                   : given.format == "png" ? UnpackFormat::kPng
                                           : UnpackFormat::kAuto;
  options.space = given.space;
  options.ocio = given.ocio;
  auto unpacked = UnpackContainer(given.container, given.out, options, pool, cancel);
  if (!unpacked) return FailCommand(unpacked.error());
  for (const std::string& warning : unpacked->warnings)
    std::fprintf(stderr, "patina: warning: %s\n", warning.c_str());
  if (line.verbosity != Verbosity::kQuiet) {
    for (const std::string& path : unpacked->paths) std::printf("%s\n", path.c_str());
  }
  return kExitDone;
}

int CompareCommand(const CommandLine& line, const CancelToken& cancel) {
  const CompareOptions& options = line.compare;
  Job source;
  std::error_code ignored;
  if (std::filesystem::is_regular_file(options.source, ignored)) {
    auto job = ReadJobFile(options.source);
    if (!job) return FailCommand(job.error());
    source = std::move(*job);
  } else {
    source.folder = options.source;
    source.asset = AssetNameFromPath(options.source);
  }
  if (!options.map_list.empty()) {
    auto maps = ReadMapListFile(options.map_list);
    if (!maps) return FailCommand(maps.error());
    source.maps = std::move(*maps);
    source.maps_folder = FolderOfFile(options.map_list);
  }
  if (!options.color_space.empty()) source.color_space = options.color_space;
  if (!options.ocio.empty()) source.ocio = options.ocio;
  source.repair_nonfinite = source.repair_nonfinite || options.repair_nonfinite;
  ThreadPool pool(line.threads);
  TerminalProgress progress(stderr, line.verbosity, source.asset);
  auto comparison = CompareContainer(options.container, source, pool, cancel, progress);
  progress.OnResult({});
  if (!comparison) return FailCommand(comparison.error());
  if (line.json) {
    std::printf("%s\n", ComparisonToJson(*comparison).c_str());
  } else {
    std::fputs(ComparisonText(*comparison).c_str(), stdout);
  }
  return kExitDone;
}

int SampleCommand(const CommandLine& line, const CancelToken& cancel) {
  const SampleOptions& options = line.sample;
  std::vector<std::string> paths;
  constexpr int kDefaultSize = 1024, kDefaultBtfSize = 64;
  const int size = options.size.value_or(options.kind == "btf" ? kDefaultBtfSize : kDefaultSize);
  if (options.kind == "btf") {
    if (size > kMaxSampleBtfSide) {
      return FailCommand({ErrorCode::kInvalidArgument,
                          "--size: " + std::to_string(size) + " texels are too many for a BTF; " +
                              "give at most " + std::to_string(kMaxSampleBtfSide)});
    }
    ThreadPool pool(line.threads);
    SetImageIoThreads(1);
    TerminalProgress progress(stderr, line.verbosity, "bumps");
    auto written =
        WriteSampleBtf(options.out, {size, options.images, options.seed}, pool, cancel, progress);
    progress.OnResult({});
    if (!written) return FailCommand(written.error());
    // Thousands of images need no line each.
    paths = {written->front()};
  }
  if (options.kind == "scene") {
    ThreadPool pool(line.threads);
    SetImageIoThreads(pool.threads());
    auto written = WriteSampleScene(options.out, size, options.seed, pool);
    if (!written) return FailCommand(written.error());
    paths = std::move(*written);
  }
  if (options.kind == "material" || options.kind == "all") {
    ThreadPool pool(line.threads);
    SetImageIoThreads(pool.threads());
    auto written = WriteSampleSet(options.out, size, options.seed, pool);
    if (!written) return FailCommand(written.error());
    paths = std::move(*written);
  }
  if (options.kind == "brdf" || options.kind == "all") {
    SampleBrdfOptions brdfs;
    brdfs.noise.seed = options.seed;
    const bool all = options.kind == "brdf";
    brdfs.files = all ? SampleBrdfNames() : std::vector<std::string>{"brushed.bin", "sparse.csv"};
    // Not beside the maps: whoever bakes their folder means the material.
    const std::string folder = all ? options.out : options.out + "/brdf";
    const Status written = WriteSampleBrdfs(folder, brdfs);
    if (!written) return FailCommand(written.error());
    for (const std::string& name : brdfs.files) paths.push_back(folder + "/" + name);
  }
  if (options.kind == "layered") {
    auto written = WriteSampleLayers(options.out);
    if (!written) return FailCommand(written.error());
    paths = std::move(*written);
  }
  if (options.kind == "svlayers") {
    auto written = WriteSampleStack(options.out, options.size.value_or(kDefaultSampleStackSide),
                                    options.seed);
    if (!written) return FailCommand(written.error());
    paths = std::move(*written);
  }
  if (line.verbosity != Verbosity::kQuiet) {
    for (const std::string& path : paths) std::printf("%s\n", path.c_str());
  }
  return kExitDone;
}

}  // namespace patina
