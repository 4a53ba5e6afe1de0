// Measures a written BRDF against its source: pairs with the decoder that renderers use, pictures
// and albedo with the SIMD kernels, which must agree with it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"
#include "formats/manifest.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/batch_evaluator.h"
#include "pipeline/brdf/sphere_render.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/sheet.h"

namespace patina {

// |log(1 + f) - log(1 + f of the source)| and its square, means over pairs and channels; negative
// values of the source count as 0.
struct Log1pError {
  uint64_t pairs = 0;  // that the source has data for
  double mae = 0;
  double mse = 0;
};

struct BrdfMeasurement {
  // Of a lit sphere; absent for a list of measurements. Of a simulated source: a smaller sphere,
  // with the noise of the simulation in its error.
  std::optional<brdf::ImageError> image;
  // Of a table: 8192 pairs each, from a fixed seed (brdf::DrawPair). Of a list: its measurements,
  // and nothing.
  Log1pError half_angles, directions;
  Log1pError all;  // of both together
  // Mean |f(wi, wo) - f(wo, wi)| over the mean of f, over the same pairs; what is decoded.
  double reciprocity = 0;
  // Directional albedo of what is decoded, at kAlbedoDegrees and azimuth 0: midpoints of 64 x 128
  // cells over the half vector, theta_h = u^2 pi / 2.
  std::array<std::array<double, 3>, kAlbedoDegrees.size()> albedo{};
  // Lit spheres, kSheetTile pixels a side; source is empty for a list of measurements.
  RgbImage source_picture, decoded_picture, difference_picture;
};

// The directional albedo of any BRDF, as above.
std::array<double, 3> DirectionalAlbedo(const brdf::EvaluatePairs& evaluate, double theta_i_deg);

// The evaluator of the container in `directory`, from its files alone. Errors: those of
// ReadIndexPack, CodebookOf, ExpandCorners, ReadWeights and BatchEvaluator::Create.
Result<brdf::BatchEvaluator> OpenBrdfContainer(const std::string& directory,
                                               const ManifestBrdf& model);

// Decodes the container in `directory` and compares it with its source. Deterministic. Errors:
// those of OpenBrdfContainer; kInternal for a decoded value that is not finite; kCancelled.
Result<BrdfMeasurement> MeasureBrdf(const std::string& directory, const ManifestBrdf& model,
                                    const brdf::Source& source, ThreadPool& pool,
                                    const CancelToken& cancel, ProgressSink& progress);

BrdfSummary SummarizeBrdf(const BrdfMeasurement& measurement);

}  // namespace patina
