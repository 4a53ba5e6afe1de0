// Measures a written spatially varying BRDF against the source that it was made from, with the
// decoder that renderers use.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/model_bytes.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/sphere_render.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/measure_brdf.h"
#include "pipeline/jobs/sheet.h"
#include "pipeline/svbrdf/varying_source.h"

namespace patina {

// The plane under one of the source's pairs, as one of its images shows it, under a light of which
// a white diffuse surface that faces it has the value 1: f cos(theta) pi. The middle square, at
// most kPlaneSide a side.
struct SvbrdfPlane {
  size_t image = 0;                    // pair of the source
  double light_deg = 0, view_deg = 0;  // from the normal
  brdf::ImageError error;
  double mse = 0;                                                // of linear values within [0, 1]
  RgbImage source_picture, decoded_picture, difference_picture;  // at most kSheetTile a side
};

inline constexpr int kPlaneSide = 512;

struct SvbrdfMeasurement {
  std::vector<SvbrdfPlane> planes;  // VaryingSource::planes
  brdf::ImageError error;           // means over the planes
  double mse = 0;
  Log1pError log1p;  // of 256 texels each of up to 64 images
};

// Deterministic. Errors: those of LoadSvbrdfDecoder and VaryingSource::Values; kInternal for a
// decoded value that is not finite; kCancelled.
Result<SvbrdfMeasurement> MeasureSvbrdf(const std::string& directory,
                                        const svbrdf::VaryingSource& source, ThreadPool& pool,
                                        const CancelToken& cancel, ProgressSink& progress);

SvbrdfSummary SummarizeSvbrdf(const SvbrdfMeasurement& measurement, const ManifestBrdf& brdf,
                              uint64_t bytes);

}  // namespace patina
