// The maps that a material was baked from, as textures for the viewer to hold it against.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/api/http_types.h"
#include "formats/base/result.h"
#include "formats/container.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/ingest.h"

namespace patina::daemon {

// The filtered reference that quality is measured against (coded values on texel centres, all mips
// that the container has) as RGBA16F textures of four channels each. Halves are off by at most
// 2^-12 of a value.
//
// source.json: {"same_source": whether the files have the hashes of the manifest,
//   "textures": how many, "levels": [{"width", "height"} ...] from mip "first_mip" on,
//   "channels": one for each of the manifest's, null where the source has none of it, else
//   {"encoding", "scale"} and either {"constant"} or {"texture", "lane"}}.
// <texture>_<level>.bin: the halves of a level, little-endian, [y][x][4].
class SourceTextures {
 public:
  // From a folder of maps or a job file. Errors: those of ReadJobFile and ReadSourceOf; kConflict
  // if its size is not the container's.
  static Result<std::unique_ptr<const SourceTextures>> Load(const Container& container,
                                                            const std::string& path,
                                                            ThreadPool& pool,
                                                            const CancelToken& cancel,
                                                            ProgressSink& progress);

  // One of the files above; a problem of 404 for other names.
  HttpResponse Answer(const std::string& name) const;

 private:
  void Describe(const Container& container, bool same_source);
  std::string TexelsOf(size_t texture, const TargetLevel& level) const;

  MaterialReference reference_;
  std::string description_;
  std::vector<int> stored_;  // channels of the pyramid, four to a texture
};

}  // namespace patina::daemon
