// From the maps of a set to the filtered reference: mip pyramids of coded values on texel centres,
// and what they mean.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/effects/effects.h"
#include "pipeline/image/image.h"
#include "pipeline/image/map_finder.h"
#include "pipeline/material/color_choice.h"
#include "pipeline/material/target_pyramid.h"

namespace patina {

// Opacity at or above this counts as there when a mip's coverage is kept. The default of glTF's
// alphaCutoff.
inline constexpr float kOpacityCutoff = 0.5f;

// A map without a file.
struct ConstantMap {
  std::string role;
  std::vector<float> value;  // physical (linear), one for each component; no normals
};

struct ReferenceOptions {
  AddressMode address = AddressMode::kWrap;
  // kAuto: the file name's word, else a comparison with the displacement map, else OpenGL.
  // Otherwise overrides both, but not a convention that a list of maps gives.
  NormalConvention normal_convention = NormalConvention::kAuto;
  // NaN and infinity: replace them (see RepairNonFinite) instead of refusing the file.
  bool repair_nonfinite = false;
  // Mips of roughness grow by the variance of the normals below them (see WidenRoughness), where
  // both maps exist and neither is constant.
  bool widen_roughness = true;
  ColorOptions color;
  // Mips of opacity keep the coverage at kOpacityCutoff or at this; none: they are plain means.
  std::optional<float> opacity_cutoff = kOpacityCutoff;
  std::vector<ConstantMap> constants;  // in addition to the maps of the set
  EffectSwitches effects;
  // The mips that are wanted, where the effect is on; both absent: all.
  std::optional<std::array<int, 2>> lod_range;
  std::optional<TexelDensity> density;
  // Reads a file, perhaps one that others read, too; empty: ReadImage. Called by several threads.
  std::function<Result<Image>(const std::string& path)> read_image;
  uint64_t max_texels = uint64_t{1} << 26;  // of mip 0; larger sets are refused
  const CancelToken* cancel = nullptr;
};

// One file that was read.
struct ReferenceFile {
  std::string path;
  std::string file;  // as MapSource::file
  int width = 0;
  int height = 0;
  int channels = 0;
  SampleType type = SampleType::kUint8;
  std::string format;              // "png", "jpeg", ...
  std::vector<std::string> roles;  // in the order of MapRoles()
};

// How one map was stored, so that it can be written back the same way.
struct ReferenceMap {
  std::string role;
  int file = -1;  // index into files
  // 0-based, in the order of the map's components; x and y of a normal.
  std::vector<int> file_channels;
  SampleType type = SampleType::kUint8;
  bool inverted = false;  // the file holds 1 - value
  bool srgb = false;  // the file's numbers are sRGB-coded; otherwise linear, or as color_space says
  // Of a colour; empty for data, which are never converted.
  std::string color_space;
  std::string color_rule;  // see ColorRuleName
  bool converted = false;  // to the working space
  Encoding encoding = Encoding::kLinear;
  // Of a normal map's file; kAuto for all others.
  NormalConvention convention = NormalConvention::kAuto;
  bool resized = false;  // the file is smaller than the reference and was enlarged
};

struct SourceReference {
  MaterialReference material;
  int width = 0;  // of mip 0
  int height = 0;
  std::vector<ReferenceFile> files;  // each once, in the order of first use
  std::vector<ReferenceMap> maps;    // in the order of MapRoles()
  std::vector<MapNote> notes;        // the set's, and what the pixels added
  std::vector<Effect> effects;       // what became of each channel, in manifest order; then mips
  std::optional<std::array<int, 2>> lod_range;  // of the pyramid, if it is not the full chain
  // Complete sentences that begin with the file's name; also sent to the sink.
  std::vector<std::string> warnings;
};

// Reads the files of `set` and builds the reference.
//
// Channels stand in the order of MapRoles(). Coded values: colours of integer files as the sRGB
// curve of the working space's values, other colours linear or, where they span a large range, as
// logarithms (see ChooseEncodings); normals as 0.5 + 0.5 n, OpenGL, unit length (a texel without
// direction counts as (0, 0, 1), points below the surface are raised to it, z is rebuilt from x and
// y where the file has none or a constant one); data as the file has them, or 1 - value.
// Size: that of the largest map; smaller ones are enlarged by ResizeBicubic, with a warning. Maps
// that are constant have no say in the size.
// Mips: each side max(1, floor(side / 2)) down to 1x1; every level is the exact area mean (see
// mip_filter.h) of the level before in float: colours in linear light; normals as vectors,
// renormalised; roughness widened by the variance of the normals; opacity scaled to the coverage of
// mip 0; everything else in its own domain. A channel that is constant on mip 0, exactly or within
// the tolerance of `effects`, is not learned; constant_value is that value. Channels that have the
// same coded values on all mips share one channel of the pyramid; channels that mean nothing, as
// what governs them is 0, are left out. min_value and max_value are the range over all mips: it is
// that of mip 0 but for roughness and normals, which filtering can carry beyond it.
//
// The result does not depend on the number of threads. Sets the threads of SetImageIoThreads to
// those of `pool`. Errors: those of ReadImage; kInvalidArgument (an empty set, a normal map of one
// channel, channels that a file does not have, colour spaces), kCorruptData (NaN or infinity, with
// count and first place), kOutOfRange (max_texels), kResourceExhausted, kCancelled.
Result<SourceReference> BuildReference(const MapSet& set, const ReferenceOptions& options,
                                       ThreadPool& pool, ProgressSink& progress);

// F(M)(u, v, s): out[c] = coded learned channel c at (u, v), s mips above the source; clamped to
// the levels there are. Bicubic (Catmull-Rom) within a mip, texel centres at half integers
// (x = u * width - 0.5), addressing as the pyramid's; linear between the two mips around s. In
// double throughout: what faster filters are tested against. u and v within +-1000.
//   out: pyramid.channels values
void SampleReference(const TargetPyramid& pyramid, double u, double v, double s, double* out);

}  // namespace patina
