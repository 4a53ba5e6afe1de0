// What is read from which channel of which file, decided from the maps of a set and the range of
// their samples.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/image/image.h"
#include "pipeline/image/map_finder.h"
#include "pipeline/image/map_roles.h"
#include "pipeline/material/color_choice.h"
#include "pipeline/material/target_pyramid.h"

namespace patina {

// One file of a set with its pixels.
struct LoadedFile {
  Image image;
  ImageStats stats;
  bool resized = false;
};

// One map: its channels, and how samples become coded values.
struct MapPlan {
  const MapRole* role = nullptr;
  int file = 0;               // index into the loaded files
  std::vector<int> channels;  // of the image; a normal has two, or three with z
  // Every channel used has one value everywhere, so the file fits any size.
  bool constant_file = false;
  bool invert = false;
  bool srgb = false;  // the samples are sRGB-coded
  ColorChoice color;  // of a colour
  Encoding encoding = Encoding::kLinear;
  float scale = 1;  // of kSignedLog
  // Normals only:
  bool flip_y = false;
  bool signed_samples = false;  // samples are components in [-1, 1], not 0.5 + 0.5 of them
  NormalConvention convention = NormalConvention::kAuto;

  int components() const {
    return role->kind == MapKind::kScalar ? 1 : role->kind == MapKind::kColor ? 3 : 2;
  }
  // Planes that mips are filtered from: a normal's z is filtered too.
  int work_planes() const { return role->kind == MapKind::kNormal ? 3 : components(); }
  // LoadMapRow gives coded values; else working ones, from which EncodeMapRow makes them.
  bool loads_coded() const { return encoding == Encoding::kSrgb && color.transform == nullptr; }
};

// "r", "g", "b", "x", "y" or "" for component i of a map.
const char* ComponentName(MapKind kind, int component);

// Plans `source`, whose file is `file`. Adds to `warnings` what was guessed, and to `notes` what
// was left out; returns a plan without channels for an optional map that says nothing. Conventions
// of normals are left at the source's; colours are kSrgb or kLinear. Errors: kInvalidArgument
// (channels that are not there, a colour space given to a data map), those of ChooseColor.
Result<MapPlan> PlanMap(const MapSource& source, int file_index, const LoadedFile& file,
                        const ColorOptions& color, std::vector<std::string>* warnings,
                        std::vector<MapNote>* notes);

// Texels of a normal map that had to be mended.
struct NormalDefects {
  uint64_t undefined = 0;  // no direction: became (0, 0, 1)
  uint64_t below = 0;      // z < 0: raised to z = 0
};

// Row y of a map: planes[i] receives component i: coded values if plan.loads_coded(), else colours
// as linear values of the working space, the unit vector x, y, z itself (OpenGL) of a normal, data
// as they are. Each plane holds image-width floats; `width` is that of the reference, which the
// image must have unless the file is constant.
void LoadMapRow(const MapPlan& plan, const LoadedFile& file, int width, int y,
                float* const planes[3], NormalDefects* defects);

// Coded values of one plane of a row that LoadMapRow gave. coded: may be `loaded`.
void EncodeMapRow(const MapPlan& plan, const float* loaded, int width, float* coded);
// And what mips are filtered from, in place: linear light.
void LinearizeMapRow(const MapPlan& plan, float* loaded, int width);

}  // namespace patina
