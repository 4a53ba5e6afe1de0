// Reads the name of an image file: material, map, resolution and variant.
#pragma once

#include <string>
#include <vector>

#include "pipeline/image/map_roles.h"

namespace patina {

// "Rock020_1K_NormalGL.jpg" is stem "Rock020" (words rock020), token normal, OpenGL, 1024 texels.
struct MapName {
  // What the map is; nullptr if no word at the end of the name says so.
  const MapToken* token = nullptr;
  NormalConvention convention = NormalConvention::kAuto;
  std::string color_space = "auto";  // from words like "srgb", "linear"
  // Lower case; what comes before the token, without resolutions and levels.
  std::vector<std::string> stem_words;
  std::string stem;  // the same as written in the name
  // All words but resolutions and the like, whatever their meaning.
  std::vector<std::string> all_words;
  std::string tile;          // UDIM tile ("1001") or empty
  int resolution = 0;        // texels a side that the name states, or 0
  int level_of_detail = 0;   // n of "LODn"
  int variant = 0;           // n of "VARn", or of a bare number after the token
  bool bare_number = false;  // a number that is no resolution, level or tile followed the token
};

// Pure function of the name without its extension. Words are split at _ - . space and brackets and
// where CamelCase begins a new word. The token is the longest run of words that FindMapToken knows,
// as near the end as the words after it allow: only resolutions ("2k", "1024", "1K-JPG"), bit
// depths, colour spaces, "map", "tex", LOD, UDIM and variant numbers may follow. So
// "metal_plate_02_diff_1k" is a diffuse map and "color_normal_thing_rough" a roughness map.
MapName ParseMapName(const std::string& name);

// What follows the last dot of a file's name, with the dot, in lower case; "" if there is none.
std::string LowerExtension(const std::string& file);

// True for the extensions of image formats that are read: png jpg jpeg tga tif tiff exr hdr dds, in
// any case.
bool HasImageExtension(const std::string& file_name);

}  // namespace patina
