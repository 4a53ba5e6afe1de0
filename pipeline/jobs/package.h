// From a trained material to the payloads and the manifest of a container.
#pragma once

#include <map>

#include "formats/base/result.h"
#include "formats/container.h"
#include "formats/manifest.h"
#include "pipeline/jobs/ingest.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/measure.h"
#include "pipeline/material/train.h"

namespace patina {

// Adds features_0.dds ... and decoder.weights. Errors: those of EncodeDds, PackNetwork and
// StagingArea::AddPayload; kInternal in place of kInvalidArgument, since what was trained must be
// writable.
Status AddModel(const TrainedMaterial& model, StagingArea* staging);

// What manifests of every kind begin with: kind, asset, tool, fingerprint, seed, quality setting.
Manifest BeginManifest(const Job& job, JobKind kind, int recipe_version,
                       const std::string& fingerprint);

// The manifest of a container, without its quality. model: null when every channel is constant.
// Files whose names cannot stand in a manifest appear under similar ones.
Manifest DescribeContainer(const Job& job, const JobSource& source, const TrainedMaterial* model);

// Fills in manifest.quality; the gate is job.min_psnr_db.
void DescribeQuality(const Job& job, const Measurement& measurement, Manifest* manifest);

// A source file's name as a manifest takes it: the same, or a similar one that can stand there.
std::string ManifestPath(const std::string& file);

// kInvalidArgument becomes kInternal: what was trained must be writable.
Status AsInternal(Status status);

// Bytes of the payloads that an engine loads: feature textures, index grid, codebook, weights,
// sampler.
// PSNR of mip 0 at a point of the training, by map, learned channels only, in dB.
std::map<std::string, double> MapsOfPoint(const MaterialReference& reference,
                                          const CurvePoint& point);

}  // namespace patina
