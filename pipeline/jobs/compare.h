// Measures a container against source maps, from the files alone.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/container.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/ingest.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/measure.h"

namespace patina {

struct Comparison {
  std::string asset;
  std::string directory;  // of the container
  Measurement measurement;
  bool same_source = false;  // the source's files have the hashes that the manifest lists
};

// The maps that a material was baked from, or others to hold it against. `source` says where they
// are: folder, set or maps of a job; its other fields are not used but for repair_nonfinite,
// toksvig, normal_convention, color_space and ocio. Addressing, mips and working space are the
// container's. Errors: kConflict if a colour is not read as it was; those of MapsOfJob and
// ReadSource; kUnsupported for a BRDF.
Result<JobSource> ReadSourceOf(const Container& opened, const Job& source, ThreadPool& pool,
                               const CancelToken& cancel, ProgressSink& progress);
// Whether their files have the hashes that the manifest lists.
bool IsSameSource(const Container& opened, const JobSource& read);

// Errors: those of OpenContainer, VerifyPayloads, ReadSourceOf and MeasureContainer.
Result<Comparison> CompareContainer(const std::string& container, const Job& source,
                                    ThreadPool& pool, const CancelToken& cancel,
                                    ProgressSink& progress);

// The measures on one line: asset, container, psnr {overall, mip0, mean_mips, maps}, ssim, flip,
// normal_angle_deg, same_source, not_compared.
std::string ComparisonToJson(const Comparison& comparison);
// And as a table for a person.
std::string ComparisonText(const Comparison& comparison);

}  // namespace patina
