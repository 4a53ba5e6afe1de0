// What a job of kind "svbrdf" learns from: a set of measured images, a layered material with maps,
// a texture set, or a material of a scene.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/layered/layered_stack.h"
#include "formats/manifest.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/job.h"
#include "pipeline/svbrdf/varying_source.h"

namespace patina {

// What SvbrdfSource::format and manifests call a texture set, one of a scene too.
inline constexpr const char* kTextureSetFormat = "texture_set";

// A source that was read, and the fingerprint of what is made from it.
struct SvbrdfSource {
  std::string format;  // "image_set", "layered", kTextureSetFormat
  std::shared_ptr<const svbrdf::VaryingSource> texels;
  uint64_t images = 0;                      // measured ones
  std::vector<std::string> paths;           // of all files, those of the images or maps last
  std::vector<std::string> digests;         // SHA-256 of each
  std::vector<ManifestBrdfFile> files;      // for the manifest
  std::string images_sha256;                // as in ManifestImageSet
  std::string fingerprint;                  // recipe version, canonical job, what was read and how
  std::string found;                        // for people
  std::optional<layered::Stack> simulated;  // with the means of its maps; else f is exact
  std::vector<std::string> effects, left_out;  // of what f follows from; empty of images
  std::vector<std::string> warnings;
  std::optional<SceneLook> scene;  // of a material of one; its bindings are all of one transform
};

// Reads the source and hashes its files; pixels of measured images are looked at by
// VaryingSource::Draw alone. Images inside a scene's file are written to `scratch_folder`, which is
// to stay until after CheckUnchanged. Errors: those of ReadImageSet, Sha256OfFile, ReadVaryingStack
// and StackModel::Load, MapsOfJob, ReadPbrMaps, LoadSourceMaps and PbrModel::Make; kCancelled.
Result<SvbrdfSource> ReadSvbrdfSource(const Job& job, const std::string& scratch_folder,
                                      ThreadPool& pool, const CancelToken& cancel,
                                      ProgressSink& progress);

// Whether the files still are what was read: who copies a set meanwhile must not get a container
// under a wrong name. Errors: kConflict; those of Sha256OfFile; kCancelled.
Status CheckUnchanged(const SvbrdfSource& source, ThreadPool& pool, const CancelToken& cancel);

}  // namespace patina
