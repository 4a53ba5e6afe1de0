// The source of a job in memory, and the fingerprint of what it was made from.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/image/shared_images.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_sets.h"
#include "pipeline/material/reference.h"

namespace patina {

struct JobSource {
  SourceReference reference;
  std::optional<SceneLook> scene;   // of a material that comes from one
  std::vector<std::string> sha256;  // of reference.files, in their order
  ColorConfig color_config = ColorConfig::Builtin();
  std::string fingerprint;  // see FingerprintOf
};

// Reads maps as the job and their scene want them. images: of several jobs that share files; may be
// null.
// Errors: those of BuildReference and, led by "/ocio", of ColorConfig::Load; kConflict when a file
// changed while it was read.
Result<JobSource> ReadSource(const Job& job, const JobMaps& maps, ThreadPool& pool,
                             const CancelToken& cancel, ProgressSink& progress,
                             SharedImages* images = nullptr);

// SHA-256 of what decides the bytes of the container: recipe version, canonical job, and for each
// map its role, the hash of its file and how it is read, its colour space included; the hash of the
// configuration of colours, if it is not the built-in one or has converted something; and what a
// scene says. Not: where the files lie, what they are called, and when they were written.
std::string FingerprintOf(const Job& job, const JobMaps& maps, const SourceReference& reference,
                          const ColorConfig& color_config, const std::vector<std::string>& sha256);

}  // namespace patina
