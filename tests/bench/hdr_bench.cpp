// Whether float colours are better learned as logarithms or as scaled values, by what the written
// container decodes to: the measurement behind kMinHdrPeak and kMinHdrRange.
//
// usage: patina_hdr_bench [--side N] [--seeds N] [--set FOLDER]...
// For each texture a row: its range (largest magnitude over the median of those that are not 0),
// and of both encodings the mean and the 95th percentile of |decoded - x| / (|x| + median / 16)
// over mip 0, which counts dark and bright alike, and the mean over the brightest 0.1 %. Textures
// are made: smooth noise times a lognormal of the deviation named, with discs of the peak named on
// one texel in three hundred; or the first colour map of floats of a folder.
#include <stdlib.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "formats/decoder/patina_decoder.h"
#include "pipeline/base/rng.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/package.h"
#include "pipeline/material/color_encoding.h"

namespace patina::bench {
namespace {

namespace fs = std::filesystem;

// One row of noise lattice values, interpolated.
std::vector<float> MakeTexture(int side, double deviation, double peak, uint64_t seed) {
  Rng rng(seed, 3);
  constexpr int kLattice = 32;
  std::vector<float> lattice(size_t{kLattice} * kLattice * 3);
  for (float& value : lattice) value = rng.Uniform() + rng.Uniform() + rng.Uniform() - 1.5f;
  std::vector<float> values(size_t{3} * side * side);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const double u = static_cast<double>(x) * kLattice / side,
                   v = static_cast<double>(y) * kLattice / side;
      const int x0 = static_cast<int>(u), y0 = static_cast<int>(v);
      for (int c = 0; c < 3; ++c) {
        const auto at = [&](int i, int j) {
          return static_cast<double>(
              lattice[size_t{3} * (size_t(j % kLattice) * kLattice + size_t(i % kLattice)) + c]);
        };
        const double fx = u - x0, fy = v - y0;
        const double noise = (at(x0, y0) * (1 - fx) + at(x0 + 1, y0) * fx) * (1 - fy) +
                             (at(x0, y0 + 1) * (1 - fx) + at(x0 + 1, y0 + 1) * fx) * fy;
        values[size_t{3} * (size_t(y) * side + x) + c] =
            static_cast<float>(0.3 * std::exp(2 * deviation * noise));
      }
    }
  }
  const int discs = peak > 0 ? std::max(1, side * side / 300 / 12) : 0;
  for (int i = 0; i < discs; ++i) {
    const int cx = static_cast<int>(rng.Below(side)), cy = static_cast<int>(rng.Below(side));
    const double brightness = peak * (0.25 + 0.75 * static_cast<double>(rng.Uniform()));
    for (int dy = -2; dy <= 2; ++dy) {
      for (int dx = -2; dx <= 2; ++dx) {
        if (dx * dx + dy * dy > 4) continue;
        const size_t texel = size_t((cy + dy + side) % side) * side + (cx + dx + side) % side;
        for (int c = 0; c < 3; ++c)
          values[3 * texel + c] = static_cast<float>(brightness * (1 - 0.2 * c));
      }
    }
  }
  return values;
}

struct Score {
  double mean = 0, p95 = 0, brightest = 0;
};

// Trains, writes, decodes and compares. range: receives that of the map.
Result<Score> Measure(const MapSet& set, LogEncoding logarithms, uint64_t seed,
                      const std::string& scratch, double* range) {
  ThreadPool pool(0);
  ReferenceOptions options;
  options.color.logarithms = logarithms;
  JobSource source;
  PATINA_ASSIGN(source.reference, BuildReference(set, options, pool, NoProgress()));
  source.sha256.assign(source.reference.files.size(), std::string(64, '0'));
  source.fingerprint = std::string(64, '0');
  const MaterialReference& material = source.reference.material;
  Job job;
  job.asset = "hdr";
  job.quality = Quality::kPreview;
  job.seed = seed;
  TrainOptions training;
  training.quality = job.quality;
  training.seed = seed;
  PATINA_ASSIGN(
      const TrainedMaterial model,
      TrainMaterial(material,
                    ShapeForProfile(job.profile, source.reference.width, source.reference.height),
                    training, pool, NoProgress()));
  PATINA_ASSIGN(StagingArea staging, StagingArea::Create(scratch, job.asset));
  PATINA_TRY(AddModel(model, &staging));
  PATINA_TRY(staging.WriteManifest(DescribeContainer(job, source, &model)));
  Decoder decoder;
  std::string problem;
  if (Decoder::Load(staging.directory(), &decoder, &problem) != Decoder::LoadStatus::kOk)
    return Fail(ErrorCode::kInternal, problem);
  const std::vector<float> decoded = decoder.DecodeMip(0);
  const TargetLevel& mip = material.pyramid.levels[0];
  std::vector<double> truth, got;
  for (size_t c = 0; c < decoder.channels().size(); ++c) {
    const TargetChannel& target = material.channels[c];
    if (target.learned_index < 0 || target.component.empty()) continue;
    for (int y = 0; y < mip.height; ++y) {
      for (int x = 0; x < mip.width; ++x) {
        const size_t at = (c * mip.height + y) * mip.width + x;
        const Decoder::Channel& channel = decoder.channels()[c];
        truth.push_back(
            static_cast<double>(Decoder::ToPhysical(channel, mip.At(x, y, target.learned_index))));
        got.push_back(static_cast<double>(Decoder::ToPhysical(channel, decoded[at])));
      }
    }
  }
  std::vector<double> sorted;
  for (const double value : truth) {
    if (value != 0) sorted.push_back(std::fabs(value));
  }
  std::sort(sorted.begin(), sorted.end());
  const double median = sorted[sorted.size() / 2];
  const double bright = sorted[sorted.size() - 1 - sorted.size() / 1000];
  *range = sorted.back() / median;
  std::vector<double> errors;
  Score score;
  size_t brightest = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    errors.push_back(std::fabs(got[i] - truth[i]) / (std::fabs(truth[i]) + median / 16));
    score.mean += errors.back();
    if (std::fabs(truth[i]) >= bright) {
      score.brightest += errors.back();
      ++brightest;
    }
  }
  score.mean /= static_cast<double>(errors.size());
  score.brightest /= static_cast<double>(brightest);
  std::sort(errors.begin(), errors.end());
  score.p95 = errors[errors.size() * 95 / 100];
  return score;
}

int Row(const std::string& name, const MapSet& set, uint64_t seed, const std::string& scratch) {
  double range = 0;
  auto linear = Measure(set, LogEncoding::kNever, seed, scratch, &range);
  auto logarithms = Measure(set, LogEncoding::kAlways, seed, scratch, &range);
  if (!linear || !logarithms) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(),
                 (linear ? logarithms : linear).error().message.c_str());
    return 1;
  }
  std::printf("%-28s %9.0f   %8.4f %8.4f   %8.4f %8.4f   %8.4f %8.4f\n", name.c_str(), range,
              linear->mean, logarithms->mean, linear->p95, logarithms->p95, linear->brightest,
              logarithms->brightest);
  std::fflush(stdout);
  return 0;
}

int Run(int argc, char** argv) {
  int side = 256, seeds = 1;
  std::vector<std::string> sets;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--side") == 0) side = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--seeds") == 0) seeds = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--set") == 0) sets.emplace_back(argv[i + 1]);
  }
  if (argc % 2 == 0 || side < 16 || side > 4096 || seeds < 1) {
    std::fprintf(stderr, "usage: patina_hdr_bench [--side N] [--seeds N] [--set FOLDER]...\n");
    return 2;
  }
  std::string scratch = (fs::temp_directory_path() / "patina-hdr-XXXXXX").string();
  if (mkdtemp(scratch.data()) == nullptr) return 1;
  std::printf("%-28s %9s   %17s   %17s   %17s\n", "texture", "range", "mean: linear log",
              "p95: linear log", "top: linear log");
  int worst = 0;
  for (uint64_t seed = 1; seed <= static_cast<uint64_t>(seeds); ++seed) {
    for (const double deviation : {0.3, 1.0, 2.0}) {
      for (const double peak : {0.0, 4.0, 16.0, 64.0, 1024.0, 1e5}) {
        const std::vector<float> values = MakeTexture(side, deviation, peak, seed);
        const std::string file = scratch + "/hdr_emissive.exr";
        if (!WriteImage(file, WriteFormat::kExrFloat, side, side, 3, values.data())) return 1;
        MapRequest request;
        request.role = "emissive";
        request.file = file;
        auto set = ResolveMaps({request}, scratch, "hdr");
        if (!set) return 1;
        char name[64];
        std::snprintf(name, sizeof name, "deviation %.1f, peak %.0f", deviation, peak);
        worst |= Row(name, *set, seed, scratch);
      }
    }
  }
  for (const std::string& folder : sets) {
    auto found = FindMaps(folder);
    if (found) worst |= Row(found->front().name, found->front(), 1, scratch);
  }
  std::error_code ignored;
  fs::remove_all(scratch, ignored);
  return worst;
}

}  // namespace
}  // namespace patina::bench

int main(int argc, char** argv) { return patina::bench::Run(argc, argv); }
