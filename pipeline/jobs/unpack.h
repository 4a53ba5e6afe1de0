// The maps of a container as images again, for tools without a decoder.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"

namespace patina {

enum class UnpackFormat {
  // PNG; but EXR for colours in a space of linear light, and where they go beyond 0 to 1 in a space
  // that was asked for.
  kAuto,
  kPng,  // 8 bit for sources of 8 bit, else 16; colour sRGB-coded, data as it is
  kExr   // half floats for sources of 8 bit and half floats, else floats; colour linear, data as it
         // is
};

struct UnpackOptions {
  std::optional<int> mip;  // absent: the finest that is stored
  UnpackFormat format = UnpackFormat::kAuto;
  // Of colour maps: a space of the configuration. Empty: as files are read that say nothing, sRGB
  // in PNG and linear Rec.709 in EXR, whatever the container's working space is.
  std::string space;
  std::string ocio;  // the configuration; empty: $OCIO, else the built-in one
};

struct Unpacked {
  std::vector<std::string> paths;
  std::vector<std::string> warnings;  // values that the format cannot hold
};

// Decodes mip `options.mip` of a container (see OpenContainer for `container`) and writes one image
// for each map into `folder` (made if missing), named by role: albedo.png, normal.png, ao.png ...
// in the size of that mip. Normals are 0.5 + 0.5 n of x, y, z, OpenGL, in both formats. Existing
// files of those names are replaced. Errors: those of OpenContainer, VerifyPayloads and the
// decoder; kUnsupported for a BRDF; kOutOfRange for a mip that is not stored; kCancelled,
// kIo, kResourceExhausted. Data maps are the same in every space. EXR files of ACEScg and
// ACES2065-1 name their primaries. Also errors of ColorConfig, led by "--ocio" or "--space".
Result<Unpacked> UnpackContainer(const std::string& container, const std::string& folder,
                                 const UnpackOptions& options, ThreadPool& pool,
                                 const CancelToken& cancel);

}  // namespace patina
