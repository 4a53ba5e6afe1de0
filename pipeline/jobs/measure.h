// Measures a written container against a reference: the one definition of quality for `bake` and
// `compare`.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/material/target_pyramid.h"
#include "pipeline/metrics/quality.h"

namespace patina {

// What stands for no error in every PSNR that is reported: JSON has no infinity.
inline constexpr double kCappedPsnrDb = 99.99;
inline double CapPsnr(double db) { return db < kCappedPsnrDb ? db : kCappedPsnrDb; }

struct Measurement {
  metrics::QualityResult quality;
  std::vector<std::string> not_compared;  // maps of only one of the two
};

// Sees each mip, as it is in memory; mips count from the finest one that is compared. planes: the
// channels of all maps in order.
using LevelViewer =
    std::function<void(int mip, std::span<const metrics::QualityMap> maps, int width, int height,
                       std::span<const metrics::PlanePair> planes)>;

// Decodes all mips of the container in `directory` with the reference decoder (formats/decoder),
// from its files alone, and compares them with the reference on texel centres.
//
// PSNR: on coded values (sRGB for colour of integer files, 0.5 + 0.5 n for normals), peak 1;
// logarithms are divided by the largest they reach, so that this is their peak too. The
// squared error of a mip is its mean over all texels and all channels of the source: z of normals
// (rebuilt from x and y on both sides) and constant channels count like every other, so a plain
// base colour, normal, packed set has nine. Overall: from the mean of that over all mips from 0
// down to 1x1, each mip with the same weight (Weinreich 2024). mean_mips: the mean of the PSNRs of
// the mips. SSIM, FLIP (of the base colour, or the first colour map) and the angle between normals:
// mip 0 only, for time; FLIP of colours as Rec. 709, whatever the working space.
//
// viewer: empty, or called for each mip, from the finest on.
// Errors: kNotFound, kCorruptData, kUnsupported, kResourceExhausted from the decoder; kConflict
// when sizes, encodings or scales of logarithms differ or no map is in both; kInternal for a
// decoded value that is not finite; kCancelled.
Result<Measurement> MeasureContainer(const std::string& directory,
                                     const MaterialReference& reference, ThreadPool& pool,
                                     const CancelToken& cancel, ProgressSink& progress,
                                     const LevelViewer& viewer);

PsnrSummary SummarizePsnr(const metrics::QualityResult& quality);

}  // namespace patina
