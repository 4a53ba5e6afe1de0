// Bakes inputs with every variant and notes what each costs and gives.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/tradeoff/variants.h"

namespace patina {

// One input with one variant, or the mean over all inputs of a kind.
struct SweepRow {
  std::string asset;  // empty of a mean
  JobKind kind = JobKind::kMaterial;
  std::string variant;
  std::vector<std::pair<std::string, std::string>> settings;
  int inputs = 1;  // that a mean is of
  // In dB: PSNR over all mips of a material, of the lit sphere of a BRDF. From the written files.
  double quality_db = 0;
  double encode_s = 0;      // wall, of the whole bake
  double encode_cpu_s = 0;  // of all threads
  uint64_t bytes = 0;       // for an engine to load
  double decode_ns = 0;     // on one core: a texel with all its channels, or a pair of directions
  std::string problem;      // why there are no figures
  std::string container;
  // On the front of that measure: no other has as much quality for as little.
  bool front_encode = false, front_bytes = false, front_decode = false;
};

// Jobs of one kind with the variants of that kind. The containers go to
// <out>/runs/<variant>/<asset>; what is there of the same job and input is taken as it is, with the
// times of when it was baked. observer(row): of a bake.
std::vector<SweepRow> Sweep(std::span<const Job> jobs, std::span<const Variant> variants,
                            const std::string& out,
                            const std::function<JobObserver&(const std::string& label)>& observer,
                            const CancelToken& cancel);

// Sets decode_ns of all rows that have a container. The variants of an input take turns, so that all
// see the same machine; one input's decoders are in memory at a time.
Status MeasureDecoding(std::vector<SweepRow>* rows, const CancelToken& cancel);

// The mean of each variant that all inputs of its kind were baked with, in the order of the
// variants; bytes and times as arithmetic means. Fronts are marked.
std::vector<SweepRow> MeansOf(const std::vector<SweepRow>& rows);

// Marks the fronts among rows of one kind.
void MarkFronts(std::span<SweepRow> rows);

}  // namespace patina
